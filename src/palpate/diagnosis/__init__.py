"""What may be wrong with an identification: checks of the data and of the fit, and the verdict.

``recording`` has the checks of the data. ``fit`` fits the law again to means over windows
(``windows``). ``sensor``, ``delay``, ``material``, ``change``, ``geometry``, ``excitation``,
``forecast`` and ``misfit`` look for causes and faults in that fit. ``causes`` names one cause and
weighs all, ``bars`` turns them into error bars, and ``verdict`` runs everything.
``docs/diagnosis.md`` says what each sentence means.
"""

from palpate.diagnosis.outcome import Diagnosis as Diagnosis
from palpate.diagnosis.outcome import Episode as Episode
from palpate.diagnosis.outcome import ModelSelection as ModelSelection
from palpate.diagnosis.outcome import Quantity as Quantity
from palpate.diagnosis.outcome import Verdict as Verdict
from palpate.diagnosis.outcome import WorkingDepth as WorkingDepth
from palpate.diagnosis.outcome import stack_depths as stack_depths
from palpate.diagnosis.recording import Data as Data
from palpate.diagnosis.verdict import diagnose_parts as diagnose_parts
