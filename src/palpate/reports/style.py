"""How every page looks, in light and in dark, on a desk and on a phone."""

from palpate.figures.style import DARK, LIGHT

STYLE = """
:root {
  color-scheme: light dark;
  --back: #ffffff; --ink: #1a1a1a; --soft: #595959; --line: #d4d4d4; --band: #f4f5f6;
  --link: #005a92; --yes: #00553c; --partly: #6b4a00; --no: #9c2f00; --open: #595959;
}
@media (prefers-color-scheme: dark) {
  :root {
    --back: #16181c; --ink: #e8e8e8; --soft: #a8abb2; --line: #3a3d44; --band: #1f2227;
    --link: #7cc4f0; --yes: #4fd6ab; --partly: #e6b84a; --no: #ff9d66; --open: #a8abb2;
  }
}
* { box-sizing: border-box; }
body {
  margin: 0 auto; padding: 1.5rem clamp(1rem, 3vw, 2.5rem) 4rem; max-width: 84rem;
  background: var(--back); color: var(--ink);
  font: 1rem/1.55 system-ui, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif;
}
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0.5rem 0 1rem; overflow-wrap: anywhere; }
h2 { font-size: 1.35rem; line-height: 1.3; margin: 2.5rem 0 0.75rem; }
p, li { max-width: 46rem; }
a { color: var(--link); }
a:focus-visible, .wide:focus-visible { outline: 3px solid var(--link); outline-offset: 2px; }
section { border-top: 1px solid var(--line); margin-top: 2.5rem; }
.made { margin: 1rem 0; color: var(--soft); font-size: 0.92rem; }
.made div { display: flex; gap: 0.75rem; }
.made dt { flex: 0 0 5.5rem; }
.made dd { margin: 0; overflow-wrap: anywhere; min-width: 0; }
.note { border-left: 4px solid var(--no); padding-left: 0.75rem; }
.soft { color: var(--soft); font-size: 0.9em; }
figure { margin: 1rem 0; }
figcaption { color: var(--soft); font-size: 0.92rem; max-width: 46rem; margin-top: 0.5rem; }
.wide { overflow-x: auto; margin: 1rem 0; }
table { border-collapse: collapse; font-size: 0.88rem; font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 600; padding: 0.25rem 0; }
th, td { text-align: left; vertical-align: top; padding: 0.4rem 0.8rem 0.4rem 0; }
th, td { border-bottom: 1px solid var(--line); }
thead th { color: var(--soft); font-weight: 600; }
tbody th { font-weight: 500; }
tbody tr:hover { background: var(--band); }
td p { margin: 0 0 0.3rem; min-width: 13rem; }
.badge { font-weight: 600; white-space: nowrap; }
.yes { color: var(--yes); } .partly { color: var(--partly); }
.no { color: var(--no); } .open { color: var(--open); }
@media print { section { break-inside: avoid-page; } .wide { overflow: visible; } }
"""

#: Of drawings that stand in the page itself: one of each serves light and dark.
DRAWINGS = "\n".join(
    [
        ":root {",
        *(f"  {name}: {colour};" for name, colour in LIGHT.variables().items()),
        "}",
        "@media (prefers-color-scheme: dark) {",
        "  :root {",
        *(f"    {name}: {colour};" for name, colour in DARK.variables().items()),
        "  }",
        "}",
        ".drawing svg { display: block; width: 100%; height: auto; max-width: 62rem; }",
        ".drawing.narrow { display: none; }",
        "@media (max-width: 40rem) {",
        "  .drawing.narrow { display: block; }",
        "  .drawing.spread { display: none; }",
        "}",
        "",
    ]
)

#: What the report of an identification has beside that.
REPORT = """
.verdict { border-left: 6px solid; padding: 0.2rem 0 0.2rem 1rem; margin: 1rem 0; }
.verdict .badge { font-size: 1.35rem; }
.verdict p { margin: 0.3rem 0; color: var(--ink); }
.tiles { display: flex; flex-wrap: wrap; gap: 1rem; margin: 1.25rem 0; }
.tile { border: 1px solid var(--line); border-radius: 8px; padding: 0.7rem 1rem; min-width: 13rem; }
.tile b { display: block; font-size: 1.45rem; font-weight: 600; line-height: 1.3; }
.tile small { color: var(--soft); display: block; }
#numbers td, #comparison td { white-space: nowrap; } /* a number and its error are one */
#law tbody th { white-space: nowrap; }
pre { background: var(--band); padding: 0.75rem 1rem; overflow-x: auto; font-size: 0.85rem; }
code { overflow-wrap: anywhere; }
@media (max-width: 40rem) { .tile { flex: 1 1 100%; } h1 { font-size: 1.5rem; } }
"""
