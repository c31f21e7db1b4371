"""How the page of the paper's claims looks, beside what every page has."""

PAPER = """
nav h2 { margin-top: 1.5rem; font-size: 1.1rem; }
nav ul { columns: 20rem; padding-left: 1.2rem; }
.counts { list-style: none; padding: 0; display: flex; flex-wrap: wrap; gap: 0.4rem 1.5rem; }
.hinge { color: var(--soft); font-size: 0.9em; }
figure img { display: block; width: 100%; max-width: 62rem; height: auto; }
td q { display: block; min-width: 15rem; max-width: 26rem; }
td .badge { display: inline-block; min-width: 8rem; }
"""
