"""Whatever numbers come: no estimator raises, and a copied state continues as if never saved."""

import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from palpate import Status
from palpate.method.estimators import ESTIMATORS

NUMBERS = st.one_of(st.floats(), st.floats(-0.02, 0.05), st.floats(-50.0, 50.0))
SAMPLES = st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS), max_size=30)


@pytest.mark.long
@pytest.mark.parametrize("method", ESTIMATORS)
@given(before=SAMPLES, after=SAMPLES)
def test_a_copy_continues_bit_for_bit_on_any_samples(method, before, after):
    estimator = ESTIMATORS[method]()
    assert all(isinstance(estimator.update(*sample), Status) for sample in before)
    copy = pickle.loads(pickle.dumps(estimator))
    assert [copy.update(*each) for each in after] == [estimator.update(*each) for each in after]
    one, other = (each.estimate() for each in (copy, estimator))
    assert one.parameters.tobytes() == other.parameters.tobytes()
    assert one.standard_errors.tobytes() == other.standard_errors.tobytes()
