"""Options as TOML, which ``--config`` takes back."""

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from palpate.contact import Contact

# No TOML may hold them, not even in a comment; a name of a file and a note may.
_CONTROL = re.compile(r"[\x00-\x08\x0a-\x1f\x7f]")


def as_toml(options: Mapping[str, Any], comments: Iterable[str]) -> str:
    """Return options as TOML, with comments below them.

    Parameters
    ----------
    options : mapping
        Values by their option's name without dashes before it.
    comments : iterable of str
        Lines.
    """
    lines = [f"{name} = {_value(value)}" for name, value in options.items()]
    lines += [""] if lines else []
    lines += [f"# {_CONTROL.sub('?', ' '.join(each.split()))}" for each in comments]
    return "\n".join(lines) + "\n"


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple | list):
        return f"[{', '.join(_value(each) for each in value)}]"
    if isinstance(value, int | float):
        return repr(value)
    # JSON's escapes are TOML's, but for those of characters beyond 16 bits: left as they are; and
    # JSON leaves the one control character beyond its range.
    return json.dumps(str(value), ensure_ascii=False).replace("\x7f", "\\u007f")


def how_made(contact: Contact, files: Sequence[Path]) -> list[str]:
    """Of which files a contact was made, and how, a line each: for comments."""
    made = contact.provenance
    if len(files) > 1:  # the first one's stands there without its name too
        made = {name: words for name, words in made.items() if " of " in name} or made
    lines = [f"of {file}" for file in files]
    lines += [f"{channel}: {words}" for channel, words in made.items()]
    return lines + [f"{remark.step}: {remark.sentence}" for remark in contact.remarks]
