"""Write the page of findings from the registry: one item and one anchor for each check.

    python docs/write_findings.py

The text stands in ``src/palpate/findings.md``, and ``palpate explain`` prints it too.
"""

from itertools import groupby
from pathlib import Path

from palpate.findings import MAY_CAP, Check

DOCS = Path(__file__).parent
PAGE = DOCS / "reference" / "findings.md"
HEAD = """\
<!-- Written by docs/write_findings.py from the registry; edit src/palpate/findings.md instead. -->

# What each finding means

`palpate diagnose` prints each finding with its numbers and the next step.
`palpate explain` prints the text below:

```sh
palpate explain clock offset
```

Each item says what happened, what it means for the numbers, and what to do.
Most findings widen an error bar, and [the bar decides the mark](../explain/marks.md).
*May lower a mark* stands where no error bar covers the fault: the finding lowers a mark by itself.
"""
#: What the picture of a finding shows; ``docs/images/make_pictures.py`` draws them.
PICTURES = {
    Check.FORCE_JUMP: "Force over time: from one sample on the recorded force is 1.6 N lower",
    Check.SPIKES: "Force over time: single samples stand far above their neighbours",
    Check.SATURATION: "Force over time: the recorded force is cut off at 3.7 N",
    Check.DEAD_BAND: "Force over time: the recorded force is zero until it jumps to 0.8 N",
    Check.DELAY: "Force over penetration: the loop of a force that is 20 ms late is narrower",
}
#: The pages that say more.
MORE = {
    Check.CHANNELS: "../explain/preparation.md",
    Check.CLOCK_OFFSET: "../how-to/late-force.md",
    Check.DELAY: "../how-to/late-force.md",
    Check.SKEW: "../how-to/late-force.md",
    Check.LATE_FORCE: "../how-to/late-force.md",
    Check.PAYLOAD: "../how-to/payload.md",
    Check.FORCE_FRAME: "../how-to/payload.md",
    Check.DIRECTION: "../explain/preparation.md",
    Check.MEMORY: "../explain/relaxation.md",
    Check.RELAXED_STIFFNESS: "../explain/relaxation.md",
    Check.EXCITATION: "../how-to/motion.md",
    Check.ONE_WAY: "../how-to/motion.md",
    Check.GUARD: "numerics.md",
    Check.MODULUS: "../how-to/afm.md",
    Check.ENGINE: "engines.md",
}
PICTURE = """\
<picture>
  <source media="(prefers-color-scheme: dark)" srcset="../images/findings/{0}-dark.svg">
  <img src="../images/findings/{0}.svg" alt="{1}">
</picture>"""


def item(check: Check) -> str:
    """Return the item of one check."""
    happened, _, rest = check.meaning.replace("→ ", "*What to do:* ").partition("\n")
    lowers = " *May lower a mark.*" if check in MAY_CAP else ""
    parts = [f"### {check}", happened + lowers]
    if check in PICTURES:
        parts.append(PICTURE.format(check.anchor, PICTURES[check]))
    page = MORE.get(check)
    parts.append(rest.strip() + (f" [More]({page})." if page else ""))
    return "\n\n".join(parts)


def page() -> str:
    """Return the page."""
    parts = [HEAD.strip()]
    for subject, checks in groupby(Check, lambda check: check.subject):
        parts += [f"## {subject.capitalize()}", *map(item, checks)]
    return "\n\n".join(parts) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
