"""Colours of figures and pages; without matplotlib, because the live page uses them too."""

from dataclasses import asdict

from palpate.validation import frozen


@frozen
class Theme:
    """Colours of Okabe & Ito, which colour-blind readers can distinguish, for one background."""

    background: str
    ink: str
    grid: str
    measured: str
    lines: tuple[str, ...]

    def variables(self) -> dict[str, str]:
        """Return the colours by their names in a page's style sheet."""
        named = asdict(self)
        named |= {f"line-{k}": colour for k, colour in enumerate(named.pop("lines"))}
        return {f"--drawing-{name}": colour for name, colour in named.items()}


LIGHT = Theme(
    "#ffffff",
    "#1a1a1a",
    "#dddddd",
    "#8c8c8c",
    ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#a6761d", "#332288", "#5a6b00"),
)
DARK = Theme(
    "#16181c",
    "#e8e8e8",
    "#3a3d44",
    "#9a9a9a",
    ("#56b4e9", "#e69f00", "#2fc99a", "#e39ac3", "#c9b458", "#a89bff", "#9fb33c"),
)
