"""Every registered estimator keeps every promise."""

import pytest
from conformance import CHECKS, variants

import palpate


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
