"""Help as a person reads it: usage, examples, and options under headings, at any width."""

import types
from pathlib import Path
from typing import Annotated, Any, Literal, NewType, Union, get_args, get_origin

from rich.cells import cell_len
from rich.console import Console
from rich.text import Text

from palpate.cli.layout import say

#: Beyond it an option has a line of its own, as every option has where there is less width.
WIDEST_LABEL = 30
LEAST_WIDTH = 56

_PLACEHOLDERS: dict[Any, str] = {Path: "FILE", float: "NUMBER", int: "COUNT", str: "NAME"}


class Help:
    """Prints a command's help; cyclopts calls it with what it found in the signatures."""

    def __call__(self, console: Console, options: Any, panel: Any) -> None:
        """Print one heading with its commands or options."""
        if not panel.entries:
            return
        console.print()
        say(console, Text(str(panel.title), "bold"))
        labels = [_label(entry) for entry in panel.entries]
        widest = max(
            (cell_len(each) for each in labels if cell_len(each) <= WIDEST_LABEL), default=0
        )
        for entry, label in zip(panel.entries, labels, strict=True):
            _print_entry(console, label, _described(entry), widest)

    def render_usage(self, console: Console, options: Any, usage: Any) -> None:
        """Print how the command is written."""
        words = _plain(usage).removeprefix("Usage:").strip()
        if words:
            say(console, Text.assemble(("Usage: ", "bold"), words), hang=7)

    def render_description(self, console: Console, options: Any, description: Any) -> None:
        """Print what it does: paragraphs are folded, and what is indented stays a line."""
        for paragraph in _raw(description).split("\n\n"):
            if not paragraph.strip():
                continue
            console.print()
            if paragraph.startswith(" "):
                for line in paragraph.split("\n"):
                    say(console, f"  {line.strip()}", hang=6)
            else:
                say(console, " ".join(paragraph.split()), hang=0)


def _print_entry(console: Console, label: str, words: str, widest: int) -> None:
    if console.width < LEAST_WIDTH or cell_len(label) > widest:
        say(console, f"  {label}", "cyan", hang=4)
        say(console, f"      {words}", hang=6)
    else:
        text = Text("  ").append(label.ljust(widest), "cyan").append(f"  {words}")
        say(console, text, hang=widest + 4)


def _label(entry: Any) -> str:
    """``--start NUMBER``, ``-o, --output FILE``, ``--[no-]offset``, ``FILES...``."""
    place = getattr(entry, "positional_label", None)
    names = [place] if place else [name for name in (*entry.shorts, *entry.names) if name]
    if not names or not names[0].startswith("-"):
        many = "..." if get_origin(_bare(entry.type)) is tuple else ""
        return f"{', '.join(names)}{many}"
    turned = [name for name in names if name.startswith(("--no-", "--empty-"))]
    positive = [name for name in names if f"--{name[5:]}" not in names or name not in turned]
    if entry.default == "True":
        positive = [name.replace("--", "--[no-]", 1) for name in positive]
    return f"{', '.join(positive)} {_placeholder(entry.type)}".rstrip()


def _placeholder(kind: Any) -> str:
    """What stands for a value of a type."""
    bare = _bare(kind)
    if isinstance(bare, NewType):
        return str(bare.__name__).upper()
    if get_origin(bare) is tuple:
        return f"{_placeholder(get_args(bare)[0])}..."
    if get_origin(bare) is Literal:
        return "|".join(map(str, get_args(bare)))
    return _PLACEHOLDERS.get(bare, "")


def _bare(kind: Any) -> Any:
    """The type without what is optional; of several the one that is no choice among words."""
    if get_origin(kind) is Annotated:
        return _bare(get_args(kind)[0])
    if get_origin(kind) in (Union, types.UnionType):
        parts = [_bare(part) for part in get_args(kind) if part is not type(None)]
        free = [part for part in parts if get_origin(part) is not Literal]
        return (free or parts)[0]
    return kind


def _described(entry: Any) -> str:
    words = _plain(entry.description)
    if entry.required:
        return f"{words} (required)"
    if entry.default in (None, "False", "()", ""):
        return words
    default = "on" if entry.default == "True" else entry.default.removesuffix(".0")
    return f"{words} (unless given: {default})"


def _plain(words: Any) -> str:
    return " ".join(_raw(words).split())


def _raw(words: Any) -> str:
    """The text of what cyclopts hands over, without marks of literals."""
    inner = getattr(words, "primary_renderable", words)
    text = getattr(inner, "plain", inner)
    return str(text or "").replace("``", "")
