"""An estimator by the law that it is to find: what ``identify(law=…)`` and ``--law`` take."""

from typing import Any

from palpate.errors import InvalidParameterError
from palpate.estimators.contact_estimator import ESTIMATORS, ContactEstimator, estimator_named
from palpate.estimators.law_verdicts import CANDIDATES
from palpate.estimators.variable_projection import VariableProjection
from palpate.estimators.viscoelastic import ViscoelasticContact
from palpate.force_laws import FORCE_LAWS, GeneralisedHuntCrossley
from palpate.validation import one_of

USUAL = "hunt-crossley"
_DAMPERS = {"none": "spring", "hunt-crossley": "hunt-crossley", "half-space": "half-space"}


def _by_name() -> dict[str, dict[str, str]]:
    """Settings of :class:`ViscoelasticContact` by the law that is asked for."""
    settings: dict[str, dict[str, str]] = {"auto": {}, "any": {"memory": "any"}}
    settings["half-space"] = {"damping": "half-space", "memory": "none"}
    both = [(each.damping, each.memory) for each in CANDIDATES if each.memory != "none"]
    settings |= {memory: {"memory": memory} for _, memory in both}
    named = ((f"{_DAMPERS[each]}+{memory}", each, memory) for each, memory in both)
    return settings | {name: {"damping": each, "memory": memory} for name, each, memory in named}


_SETTINGS = _by_name()


def law_names() -> tuple[str, ...]:
    """Return what a law may be asked for by: its kind, or how it is to be found."""
    plain = [kind for kind in FORCE_LAWS if kind != GeneralisedHuntCrossley.kind]
    able = {estimator.law_type.kind for estimator in ESTIMATORS.values()}
    return tuple(dict.fromkeys([USUAL, *_SETTINGS, *(kind for kind in plain if kind in able)]))


def estimator_by_law(
    law: str | None = None, method: str | None = None
) -> tuple[type[ContactEstimator], dict[str, Any]]:
    """Return the estimator of a law, and the settings by which it finds it.

    Parameters
    ----------
    law : str, optional
        ``"hunt-crossley"``, ``"kelvin-voigt"`` or another law that one method identifies;
        ``"auto"``, the everyday law by which the samples are best explained; ``"any"``, of all laws
        that there are; ``"half-space"``; a kind of memory, ``"flat"``, ``"single"`` or
        ``"power-law"``, with the damper that the samples say; or both, ``"half-space+single"``.
    method : str, optional
        Name of an estimator; it has to be one of that law.

    Raises
    ------
    InvalidParameterError
        There is no such law or method, or they do not go together.
    """
    given = None if method is None else estimator_named(method)
    if law is None:
        return given or VariableProjection, {}
    one_of("law", law, law_names())
    settings = _SETTINGS.get(law)
    if given is ViscoelasticContact and law == USUAL:
        settings = {"damping": law, "memory": "none"}
    able = [each for each in ESTIMATORS.values() if each.law_type.kind == law]
    if settings is not None:
        able = [ViscoelasticContact]
    found = given or able[0]  # the default before all others
    if found not in able:
        own = f"the {found.law_type.kind} law alone"
        if found is ViscoelasticContact:
            own = ", ".join((USUAL, *_SETTINGS))
        raise InvalidParameterError(
            f"law {law} and method {found.method} do not go together, which identifies {own}: "
            "leave one of them out"
        )
    return found, dict(settings or {})
