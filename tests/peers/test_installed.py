"""An engine that is not there is no defect, and no silence either."""

import pytest

from peers.installed import installed


def test_an_absent_engine_is_a_skip_that_says_how_to_get_it() -> None:
    with pytest.raises(pytest.skip.Exception, match=r"no_such_engine.*palpate\[peers\]"):
        installed("no_such_engine")
