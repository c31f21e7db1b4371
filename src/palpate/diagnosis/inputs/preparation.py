"""What was assumed, found or left out on the way from the recording."""

from palpate.diagnosis.data import Data
from palpate.diagnosis.finding import Finding, Mark
from palpate.remarks import Remark


def preparation(data: Data) -> list[Finding]:
    """Return a finding for each remark of the contact, in its words."""
    return [_finding(remark) for remark in data.contact.remarks]


def _finding(remark: Remark) -> Finding:
    # What spoils the whole recording spoils both; what calls for care is said of the whole, unless
    # the numbers at working depth suffer from it.
    mark: Mark = "trust"
    if remark.severity == "do-not-trust" or (remark.numbers and remark.severity == "with-care"):
        mark = remark.severity
    return Finding(
        remark.step,
        remark.sentence,
        remark.remedy,
        stiffness=mark,
        damping=mark,
        severity=remark.severity,
    )
