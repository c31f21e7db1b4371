"""Checks of the data and of the fit, error bars, and the verdict of an identification.

``recording`` checks the data. ``fit`` fits the law again to window means. ``sensor``,
``delay``, ``material``, ``change``, ``geometry``, ``excitation``, ``forecast`` and ``misfit``
search that fit for causes and faults. ``causes`` names one cause and weighs all of them, ``bars``
computes error bars, and ``verdict`` runs everything. ``docs/explain/marks.md`` explains the marks.
"""

from palpate.identification.diagnosis.outcome import Diagnosis as Diagnosis
from palpate.identification.diagnosis.outcome import Episode as Episode
from palpate.identification.diagnosis.outcome import ModelSelection as ModelSelection
from palpate.identification.diagnosis.outcome import Quantity as Quantity
from palpate.identification.diagnosis.outcome import Verdict as Verdict
from palpate.identification.diagnosis.outcome import Where as Where
from palpate.identification.diagnosis.outcome import WorkingDepth as WorkingDepth
from palpate.identification.diagnosis.outcome import stack_depths as stack_depths
from palpate.identification.diagnosis.recording import Data as Data
from palpate.identification.diagnosis.verdict import diagnose_parts as diagnose_parts
