"""Young's modulus of a cylinder, or a block, that is compressed between plates: E = S h/A.

S is the stiffness at the working depth, h the height and A the area of the section, both before
compression: a homogeneous material, plates without friction, small strains.
"""

import math
from typing import Any

from palpate.digits import rounded
from palpate.identification.diagnosis.outcome import UNKNOWN, Diagnosis, Quantity
from palpate.identification.quantities.elastic_modulus import SMALL_STRAIN
from palpate.validation import Plain, check_field, finite_or_none, frozen


@frozen
class Specimen(Plain):
    """A specimen of constant section between two plates.

    Parameters
    ----------
    area : float
        A, m², in (0, 1].
    height : float
        h, m, in (0, 1].

    Examples
    --------
    >>> import palpate
    >>> specimen = palpate.Specimen(area=4e-4, height=0.1)
    >>> result = palpate.identify("examples/recordings/ball.csv")
    >>> round(result.compression_modulus(specimen).value.value, -3)  # Pa
    500000.0
    """

    area: float
    height: float

    def __post_init__(self) -> None:
        check_field(self, "area", 0.0, 1.0, open_low=True)
        check_field(self, "height", 0.0, 1.0, open_low=True)


@frozen
class CompressionModulus:
    """Young's modulus E, Pa, of a compressed specimen, or why there is none.

    Parameters
    ----------
    value : Quantity
        E = S h/A at the working depth, with the relative errors of the stiffness S; those of area
        and height are not in it. NaN if refused.
    specimen : Specimen
        The specimen.
    strain : float
        Working depth over height.
    refused : str or None
        Why there is no modulus.
    remarks : tuple of str
        Remarks for the reader.

    Examples
    --------
    >>> import palpate
    >>> result = palpate.identify("examples/recordings/ball.csv")
    >>> modulus = result.compression_modulus(palpate.Specimen(area=4e-4, height=0.1))
    >>> round(modulus.value.value, -3), round(modulus.strain, 3)  # Pa, 1
    (500000.0, 0.088)
    """

    value: Quantity
    specimen: Specimen
    strain: float
    refused: str | None = None
    remarks: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain numbers and text; undefined numbers are None."""
        return {
            **self.value.as_dict(),
            "specimen": self.specimen.as_dict(),
            "strain": finite_or_none(self.strain),
            "refused": self.refused,
            "remarks": list(self.remarks),
        }


def compute_compression_modulus(found: Diagnosis, specimen: Specimen) -> CompressionModulus:
    """Return Young's modulus from the stiffness at working depth and the size of the specimen.

    Parameters
    ----------
    found : Diagnosis
        The diagnosis of the identification.
    specimen : Specimen
        The specimen.
    """
    there = found.working_depth
    strain = there.depth / specimen.height
    refused = None
    if not math.isfinite(there.stiffness.value):
        refused = "the law has no stiffness at the working depth"
    elif strain >= 1.0:
        refused = "the working depth is larger than the height of the specimen"
    if refused:
        return CompressionModulus(UNKNOWN, specimen, strain, refused)
    remarks = []
    if found.verdict.stiffness == "do-not-trust":
        remarks.append("the diagnosis does not trust the stiffness")
    if strain > SMALL_STRAIN:
        remarks.append(f"E = S h/A assumes small strains; the strain is {rounded(strain, 2)}")
    if 4.0 * specimen.area > math.pi * specimen.height**2:
        remarks.append(
            "the specimen is wider than it is high: friction on the plates may raise the modulus"
        )
    value = there.stiffness.scaled(specimen.height / specimen.area)
    return CompressionModulus(value, specimen, strain, remarks=tuple(remarks))
