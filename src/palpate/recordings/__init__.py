"""Recordings made elsewhere, read as they are, and contacts written as recordings."""

from palpate.recordings.columns import write_contact as write_contact
from palpate.recordings.formats import FORMATS as FORMATS
from palpate.recordings.formats import Format as Format
from palpate.recordings.formats import Request as Request
from palpate.recordings.opening import open_recording as open_recording
from palpate.recordings.recording import Faults as Faults
from palpate.recordings.recording import Recording as Recording
