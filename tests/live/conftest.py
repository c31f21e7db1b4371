"""What all tests of the live part share."""

import pytest

from palpate.live import running


@pytest.fixture(autouse=True)
def patient(monkeypatch):
    """On a busy machine a sink's process takes longer to begin and to end than a person waits."""
    monkeypatch.setattr(running, "PATIENCE", 60.0)
