"""Channels of a recording: which is which, in which unit, on which clock, in which frame."""

from palpate.input.channels.roles import Columns as Columns
from palpate.input.channels.roles import Roles as Roles
from palpate.input.channels.roles import choose_roles as choose_roles
