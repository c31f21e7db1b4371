"""Recordings made elsewhere, read as they are, and contacts written as recordings."""

from palpate.recordings.columns import write_contact
from palpate.recordings.formats import FORMATS, Format, Request
from palpate.recordings.opening import open_recording
from palpate.recordings.recording import Faults, Recording

__all__ = [
    "FORMATS",
    "Faults",
    "Format",
    "Recording",
    "Request",
    "open_recording",
    "write_contact",
]
