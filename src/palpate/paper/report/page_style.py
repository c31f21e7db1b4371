"""How the page of the paper's claims looks, beside what every page has."""

PAPER = """
nav h2 { margin-top: 1.5rem; font-size: 1.1rem; }
nav ul { columns: 20rem; padding-left: 1.2rem; }
.counts { list-style: none; padding: 0; display: flex; flex-wrap: wrap; gap: 0.4rem 1.5rem; }
.abstract { list-style: none; padding: 0; }
.abstract li { margin: 0.5rem 0; padding-left: 1.6rem; text-indent: -1.6rem; }
.abstract .badge { display: inline-block; width: 1.6rem; text-indent: 0; }
figure svg { display: block; width: 100%; height: auto; max-width: 62rem; }
figure .wide:focus-visible { outline-offset: -2px; }
#claims q { display: block; max-width: 34rem; }
#claims .badge { white-space: normal; }
#not-held h3 { font-size: 1rem; margin-bottom: 0; }
#not-held small { color: var(--soft); white-space: nowrap; }
.claim { border-left: 4px solid var(--line); padding: 0.1rem 0 0.1rem 1rem; margin: 1.25rem 0; }
.claim p { margin: 0.25rem 0; }
.claim small { color: var(--soft); }
@media (max-width: 40rem) {
  figure svg { min-width: 44rem; }
  #claims thead { position: absolute; clip-path: inset(50%); }
  #claims table, #claims tbody, #claims tr, #claims th, #claims td { display: block; }
  #claims caption { display: block; } #claims .none { display: none; }
  #claims tr { border-bottom: 1px solid var(--line); padding: 0.6rem 0; }
  #claims th, #claims td { border: 0; padding: 0.1rem 0; }
  #claims td[data-name]::before { content: attr(data-name) ": "; color: var(--soft); }
}
@media print {
  :root { font-size: 75%; } nav { display: none; } section { break-inside: auto; }
  h2, caption, thead { break-after: avoid; } tr, figure, .claim { break-inside: avoid; }
}
"""
