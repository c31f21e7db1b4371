"""Recordings from files."""

from palpate.recordings.opening import FORMATS as FORMATS
from palpate.recordings.opening import Format as Format
from palpate.recordings.opening import Request as Request
from palpate.recordings.opening import open_recording as open_recording
from palpate.recordings.recording import Faults as Faults
from palpate.recordings.recording import Recording as Recording
