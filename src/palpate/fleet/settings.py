"""How the contacts of a fleet are prepared and identified: one value, which every row names."""

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from typing import Any, Literal, get_args

from palpate._core import __version__
from palpate.contact import Contact
from palpate.errors import InvalidParameterError
from palpate.estimators import ContactEstimator, estimator_named
from palpate.force_laws import ForceLaw
from palpate.preparation import Columns, choose_gate
from palpate.preparation.settings import Preparation
from palpate.settings import ContactGate
from palpate.validation import shown

DiagnosisDepth = Literal["none", "input", "full"]


@dataclasses.dataclass(frozen=True, kw_only=True, slots=True)
class Settings:
    """How each contact is prepared and identified.

    Parameters
    ----------
    method : str
        Of the estimator.
    estimator : mapping
        Its settings, where they are not the usual ones, such as ``{"surface": "estimate"}``.
    preparation : mapping
        What :func:`palpate.prepare` is given beside a recording.
    diagnosis : str
        ``"none"``; ``"input"``, the checks of the data, which cost as much as the identification;
        or ``"full"``, with a verdict for each, which costs some fifty times that.
    minimum_penetration, minimum_force : float, optional
        Contact is deeper, m, and firmer, N, than this.
    version : str
        Of the palpate that asks; a worker of another refuses.

    Raises
    ------
    InvalidParameterError
        One is outside its range, or there is no such method.
    """

    method: str = "variable-projection"
    estimator: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    preparation: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    diagnosis: DiagnosisDepth = "input"
    minimum_penetration: float | None = None
    minimum_force: float | None = None
    version: str = dataclasses.field(default_factory=lambda: __version__)

    def __post_init__(self) -> None:
        if self.diagnosis not in get_args(DiagnosisDepth):
            raise InvalidParameterError(
                f"diagnosis must be none, input or full, not {shown(self.diagnosis)}"
            )
        given = estimator_named(self.method)()
        unknown = [name for name in self.estimator if name not in given.settings]
        if unknown:
            raise InvalidParameterError(f"{self.method} has no setting {unknown[0]}")
        given.replace(**self.estimator)
        names = {field.name for field in dataclasses.fields(Preparation)}
        other = [name for name in self.preparation if name not in names]
        if other:
            raise InvalidParameterError(f"a preparation has no setting {other[0]}")
        Preparation(**self.preparation)

    @property
    def law(self) -> type[ForceLaw]:
        """The force law that the method identifies."""
        law: type[ForceLaw] = estimator_named(self.method)().law_type
        return law

    @property
    def searches_surface(self) -> bool:
        """Whether the estimator is to find the surface."""
        return self.estimator.get("surface") == "estimate"

    def estimator_for(self, contact: Contact) -> ContactEstimator:
        """Return a fresh estimator, with a gate for this contact where one is asked for."""
        made = estimator_named(self.method)().replace(**self.estimator)
        if self.minimum_penetration is None and self.minimum_force is None:
            return made
        if made.chooses_samples:  # nothing beside what is asked for
            force = self.minimum_force or 0.0
            gate = ContactGate(self.minimum_penetration or 0.0, force, force)
        else:
            gate = choose_gate(
                contact,
                minimum_penetration=self.minimum_penetration,
                minimum_force=self.minimum_force,
            )
        return made.replace(gate=gate)

    def plain(self) -> dict[str, Any]:
        """Return them as JSON has it."""
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        made: dict[str, Any] = json.loads(json.dumps(values, default=_plain, sort_keys=True))
        return made

    @property
    def digest(self) -> str:
        """A short name for exactly these settings, and this version."""
        text = json.dumps(self.plain(), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def _plain(value: Any) -> Any:
    if isinstance(value, Columns):
        usual = Columns()
        return {
            field.name: getattr(value, field.name)
            for field in dataclasses.fields(value)
            if getattr(value, field.name) != getattr(usual, field.name)
        }
    if isinstance(value, Mapping):
        return dict(value)
    return repr(value)
