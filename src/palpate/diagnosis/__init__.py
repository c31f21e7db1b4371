"""What may be wrong with an identification: checks, each a small file, and the verdict.

Checks of the data are in :mod:`palpate.diagnosis.inputs`; causes of misfit are columns or searches
beside the fit (``columns``, ``memory``, ``delay``, ``surface``, ``change``); ``marking`` names one
of them and weighs all. ``docs/diagnosis.md`` says what each sentence means.
"""

from palpate.diagnosis.data import Data
from palpate.diagnosis.diagnosing import diagnose_parts
from palpate.diagnosis.finding import (
    MARKS,
    Diagnosis,
    Episode,
    Finding,
    Quantity,
    Verdict,
    WorkingDepth,
    stacked,
)
from palpate.diagnosis.laws import Laws

__all__ = [
    "MARKS",
    "Data",
    "Diagnosis",
    "Episode",
    "Finding",
    "Laws",
    "Quantity",
    "Verdict",
    "WorkingDepth",
    "diagnose_parts",
    "stacked",
]
