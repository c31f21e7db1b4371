"""From what was recorded to a contact: its channels, its velocity, its gate and its units."""

from palpate.preparation.online import OnlinePreparation
from palpate.preparation.preparing import Columns, prepare
from palpate.preparation.suggestions import choose_gate

__all__ = ["Columns", "OnlinePreparation", "choose_gate", "prepare"]
