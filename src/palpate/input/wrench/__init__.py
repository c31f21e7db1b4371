"""The tool on a wrist sensor: its payload, mount, zero and clock, from one log of its wrench."""

from palpate.input.wrench.compensation import PayloadCompensation as PayloadCompensation
from palpate.input.wrench.payload import Payload as Payload
