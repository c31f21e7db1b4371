"""Preparation of a contact from a recording: channels, units, velocity, surface and gate."""

from palpate.preparation.gates import choose_gate as choose_gate
from palpate.preparation.online import OnlinePreparation as OnlinePreparation
from palpate.preparation.payload import Payload as Payload
from palpate.preparation.payload_compensation import PayloadCompensation as PayloadCompensation
from palpate.preparation.preparing import prepare as prepare
from palpate.preparation.settings import Preparation as Preparation
