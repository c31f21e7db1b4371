"""Preparation of a contact from a recording: channels, units, velocity, surface and gate."""

from palpate.preparation.gates import choose_gate as choose_gate
from palpate.preparation.preparing import prepare as prepare
from palpate.preparation.roles import Columns as Columns
from palpate.preparation.roles import Roles as Roles
from palpate.preparation.roles import choose_roles as choose_roles
from palpate.preparation.settings import Preparation as Preparation
