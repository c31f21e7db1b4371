"""How the report's page looks, in light and in dark."""

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
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0.5rem 0 1rem; }
h2 { font-size: 1.35rem; line-height: 1.3; margin: 2.5rem 0 0.75rem; }
p, li { max-width: 46rem; }
a { color: var(--link); }
a:focus-visible, .wide:focus-visible { outline: 3px solid var(--link); outline-offset: 2px; }
nav h2 { margin-top: 1.5rem; font-size: 1.1rem; }
nav ul { columns: 20rem; padding-left: 1.2rem; }
section { border-top: 1px solid var(--line); margin-top: 2.5rem; }
.made { margin: 1rem 0; color: var(--soft); font-size: 0.92rem; }
.made div { display: flex; gap: 0.75rem; }
.made dt { flex: 0 0 5.5rem; }
.made dd { margin: 0; }
.counts { list-style: none; padding: 0; display: flex; flex-wrap: wrap; gap: 0.4rem 1.5rem; }
.note { border-left: 4px solid var(--no); padding-left: 0.75rem; }
.hinge { color: var(--soft); font-size: 0.9em; }
figure { margin: 1rem 0; }
figure img { display: block; width: 100%; max-width: 62rem; height: auto; }
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
td q { display: block; min-width: 15rem; max-width: 26rem; }
.badge { font-weight: 600; }
td .badge { display: inline-block; min-width: 8rem; }
.yes { color: var(--yes); } .partly { color: var(--partly); }
.no { color: var(--no); } .open { color: var(--open); }
@media print { section { break-inside: avoid-page; } .wide { overflow: visible; } }
"""
