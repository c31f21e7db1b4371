"""What may be wrong with an identification: checks, each a small file, and the verdict.

Checks of the data are in :mod:`palpate.diagnosis.data`; causes of misfit are columns or searches
beside the fit (``columns``, ``memory``, ``delay``, ``surface``, ``change``); ``marking`` names one
of them and weighs all. ``docs/diagnosis.md`` says what each sentence means.
"""

from palpate.diagnosis.data import Data as Data
from palpate.diagnosis.diagnosing import diagnose_parts as diagnose_parts
from palpate.diagnosis.finding import MARKS as MARKS
from palpate.diagnosis.finding import Diagnosis as Diagnosis
from palpate.diagnosis.finding import Episode as Episode
from palpate.diagnosis.finding import Finding as Finding
from palpate.diagnosis.finding import Laws as Laws
from palpate.diagnosis.finding import Quantity as Quantity
from palpate.diagnosis.finding import Verdict as Verdict
from palpate.diagnosis.finding import WorkingDepth as WorkingDepth
from palpate.diagnosis.finding import stacked as stacked
