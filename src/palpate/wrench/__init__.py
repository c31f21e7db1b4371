"""The tool on a wrist sensor: its payload, mount, zero and clock, from one log of its wrench."""

from palpate.wrench.compensation import PayloadCompensation as PayloadCompensation
from palpate.wrench.payload import Payload as Payload
