"""The page's style sheet: the look of the reports, and what only this page has."""

from pathlib import Path

from palpate.figures.style import DARK, LIGHT
from palpate.reports.style import STYLE

STATIC = Path(__file__).parent / "static"


def style_sheet() -> str:
    """Return it, with the colours of figures as variables, light and dark."""
    light = "".join(f"{name}: {colour}; " for name, colour in LIGHT.variables().items())
    dark = "".join(f"{name}: {colour}; " for name, colour in DARK.variables().items())
    return "\n".join(
        [
            STYLE,
            f":root {{ {light}}}",
            f"@media (prefers-color-scheme: dark) {{ :root {{ {dark}}} }}",
            (STATIC / "live.css").read_text(encoding="utf-8"),
        ]
    )
