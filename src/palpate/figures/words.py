"""What titles say of an identification."""

from pathlib import Path

from palpate.identification import Identification


def name_of(result: Identification) -> str:
    """Name of the recording's file; what no font has, such as a byte that is not UTF-8, is �."""
    name = Path(result.contact.source).name
    return "".join(sign if sign.isprintable() else "\N{REPLACEMENT CHARACTER}" for sign in name)
