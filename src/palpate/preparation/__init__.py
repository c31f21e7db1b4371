"""From what was recorded to a contact: its channels, its velocity, its gate and its units."""

from palpate.preparation.online import OnlinePreparation
from palpate.preparation.preparing import prepare
from palpate.preparation.roles import Columns, Roles, roles_of
from palpate.preparation.settings import Preparation
from palpate.preparation.suggestions import choose_gate

__all__ = [
    "Columns",
    "OnlinePreparation",
    "Preparation",
    "Roles",
    "choose_gate",
    "prepare",
    "roles_of",
]
