"""Recordings from files."""

from palpate.input.recordings.opening import FORMATS as FORMATS
from palpate.input.recordings.opening import Format as Format
from palpate.input.recordings.opening import Request as Request
from palpate.input.recordings.opening import open_recording as open_recording
from palpate.input.recordings.recording import Faults as Faults
from palpate.input.recordings.recording import Recording as Recording
