"""Formats that palpate does not read: how to save them as CSV."""

from pathlib import Path

from palpate.recordings.opening import Request
from palpate.recordings.recording import Recording

_REMEDIES = {
    b"TDSm": "a TDMS file of LabVIEW, which palpate does not read; save it as CSV, by python -c "
    '\'from nptdms import TdmsFile; TdmsFile("IN.tdms").as_dataframe().to_csv("OUT.csv")\'',
    b"\xd0\xcf\x11\xe0": "an Excel file before .xlsx, or one with a password, which palpate does "
    "not read; open it in a spreadsheet program and save it as .xlsx or CSV",
}


def read(path: Path, request: Request) -> Recording:
    """Refuse a file, and say how to save it as CSV.

    Raises
    ------
    RecordingError
        Always.
    """
    with path.open("rb") as file:
        begin = file.read(4)
    raise request.error(f"this is {_REMEDIES[begin]}")
