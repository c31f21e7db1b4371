"""Every registered estimator keeps every promise, and a broken promise is noticed."""

import pytest
from conformance import CHECKS, check, variants

import palpate
from palpate import Status


@pytest.mark.parametrize("name", palpate.ESTIMATORS)
@pytest.mark.parametrize("promise", CHECKS.values(), ids=CHECKS)
def test_every_estimator_keeps_every_promise(promise, name):
    kind, broken = palpate.ESTIMATORS[name], {}
    for words, settings in variants(kind).items():
        try:
            promise(kind, settings)
        except AssertionError as error:
            broken[words] = str(error)
    assert not broken


class Forgetful(palpate.KelvinVoigtRLS):
    """Its copies have learned nothing."""

    __slots__ = ()

    def copy(self):
        return type(self)(**self.settings)

    def __reduce__(self):
        return self._again, ()


class Erasing(palpate.KelvinVoigtRLS):
    """It starts again when contact is lost."""

    __slots__ = ()

    def leave_contact(self):
        self.reset()
        super().leave_contact()


class Taking(palpate.KelvinVoigtRLS):
    """It claims to take what it refuses."""

    __slots__ = ()

    def update(self, penetration, velocity, force, dt=None):
        super().update(penetration, velocity, force, dt)
        return Status.UPDATED


class Undocumented(palpate.KelvinVoigtRLS):
    """It has a setting that nobody knows of."""

    __slots__ = ()

    def __init__(self, *, colour="red", **settings):
        super().__init__(**settings)


BROKEN = {
    Forgetful: "saved and restored is never stopped",
    Erasing: "out of contact it is held",
    Taking: "refused samples change nothing",
    Undocumented: "settings are kept and documented",
}


@pytest.mark.parametrize("kind", BROKEN, ids=lambda kind: kind.__name__)
def test_a_broken_promise_is_named(kind):
    with pytest.raises(AssertionError, match=f"{kind.__name__}, .*: "):
        check(kind)
    with pytest.raises((AssertionError, TypeError, AttributeError)):
        CHECKS[BROKEN[kind]](kind, {})
