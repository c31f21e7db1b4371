// Colours of the style sheet, for the canvases.

const scheme = matchMedia("(prefers-color-scheme: dark)");
export const theme = {};

function read() {
  const style = getComputedStyle(document.documentElement);
  const of = (name) => style.getPropertyValue(name).trim();
  theme.text = of("--ink");
  theme.ink = of("--soft");
  theme.grid = of("--drawing-grid");
  theme.measured = of("--drawing-measured");
  theme.lines = [0, 1, 2, 3, 4, 5].map((k) => of(`--drawing-line-${k}`));
  theme.states = { 2: of("--link"), 3: of("--partly"), 4: of("--no"), 5: of("--no"), 6: of("--partly") };
  theme.bad = of("--no");
}

export function watchTheme(redraw) {
  read();
  scheme.addEventListener("change", () => { read(); redraw(); });
}

export const faint = (colour) => `color-mix(in srgb, ${colour} 25%, transparent)`;
