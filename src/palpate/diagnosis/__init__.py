"""What may be wrong with an identification: checks of the data and of the fit, and the verdict.

``data`` has the checks of a recording, ``fit`` the law fitted once more, in averages; causes of
misfit are columns or searches beside that fit (``delay``, ``change``); ``marks`` names one of them,
weighs all, and says what is left to doubt; ``diagnosing`` runs everything. ``docs/diagnosis.md``
says what each sentence means.
"""

from palpate.diagnosis.data import Data as Data
from palpate.diagnosis.diagnosing import diagnose_parts as diagnose_parts
from palpate.diagnosis.finding import Diagnosis as Diagnosis
from palpate.diagnosis.finding import Episode as Episode
from palpate.diagnosis.finding import Laws as Laws
from palpate.diagnosis.finding import Quantity as Quantity
from palpate.diagnosis.finding import Verdict as Verdict
from palpate.diagnosis.finding import WorkingDepth as WorkingDepth
from palpate.diagnosis.finding import stacked as stacked
