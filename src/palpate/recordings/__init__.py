"""Recordings made elsewhere, read as they are, and contacts written as recordings."""

from palpate.recordings.csv import write_contact
from palpate.recordings.opening import READERS, open_recording
from palpate.recordings.recording import Recording

__all__ = ["READERS", "Recording", "open_recording", "write_contact"]
