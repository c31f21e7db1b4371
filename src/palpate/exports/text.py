"""Text for engines: numbers that read back exactly, and comments."""

from collections.abc import Sequence


def digits(value: float) -> str:
    """A number in the fewest digits that read back as the same float."""
    return f"{value:.0f}" if value == int(value) and abs(value) < 1e15 else repr(float(value))


def xml_comment(notes: Sequence[str], indent: str = "") -> str:
    """Lines as an XML comment, in which two hyphens may not stand together."""
    lines = [line.replace("--", "- -") for note in notes for line in note.splitlines()]
    inside = "\n".join(f"{indent}  {line}".rstrip() for line in lines)
    return f"{indent}<!--\n{inside}\n{indent}-->"


def hash_comment(notes: Sequence[str], indent: str = "") -> str:
    """Lines as comments that begin with #."""
    lines = [line for note in notes for line in note.splitlines()]
    return "\n".join(f"{indent}# {line}".rstrip() for line in lines)
