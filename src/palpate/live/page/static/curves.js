// Curves of the last ten seconds, drawn with uPlot.

import { Range, scaleOf, spread } from "./ranges.js";
import { Pieces } from "./store.js";
import { faint, theme } from "./theme.js";

const uPlot = globalThis.uPlot;
const AXIS = 62; // pixels left of a panel, constant so that nothing shifts
export const RIGHT = 16; // pixels for half of the last axis label
const FONT = "12px system-ui, sans-serif";
const BAND = 2; // standard errors

/** Make the figure of one plot: a caption, and an area of fixed size. */
export function figure(parent, kind, label) {
  const made = document.createElement("figure");
  made.className = `panel ${kind}`;
  made.setAttribute("role", "group");
  made.setAttribute("aria-label", label);
  const caption = made.appendChild(document.createElement("figcaption"));
  const drawn = made.appendChild(document.createElement("div"));
  drawn.className = "drawn";
  parent.append(made);
  return { made, caption, drawn };
}

export function axes(across) {
  const look = { stroke: () => theme.ink, font: FONT, grid: { stroke: () => theme.grid, width: 1 },
    ticks: { stroke: () => theme.grid, width: 1, size: 4 } };
  return [
    { ...look, size: 30, space: 45, ...across },
    { ...look, size: AXIS, space: 32, values: (_, splits) => splits.map(tick) },
  ];
}

// Rounded, so that 0.1 + 0.2 prints as 0.3.
export const tick = (value) => String(Number(value.toPrecision(6))).replace("-", "−");

/** Curves over time that share a unit. */
export class TimePanel {
  constructor(parent, { kind = "", name, unit = "", lines, label, fixed = null, marks = null }) {
    this.lines = lines;
    this.unit = unit;
    this.name = name;
    this.marks = marks;
    this.fixed = fixed;
    this.factor = 1;
    this.range = new Range();
    const { made, caption, drawn } = figure(parent, kind, label ?? name);
    this.figure = made;
    this.drawn = drawn;
    this.title = caption.appendChild(document.createElement("b"));
    for (const line of lines.filter((each) => each.key)) {
      const key = caption.appendChild(document.createElement("span"));
      key.className = `key key-${line.key}`;
      key.textContent = line.label;
    }
    this.entitle();
    this.build();
  }

  entitle() {
    const text = this.shownUnit ?? this.unit;
    const words = text ? `${this.name} [${text}]` : this.name;
    if (this.title.textContent !== words) this.title.textContent = words;
  }

  build() {
    const series = [{}], bands = [];
    for (const line of this.lines) {
      series.push({ stroke: () => line.colour(), width: line.width ?? 1.5, points: { show: false } });
      if (!line.error) continue;
      const edge = { stroke: "transparent", width: 0, points: { show: false } };
      bands.push({ series: [series.length, series.length + 1], fill: () => faint(line.colour()) });
      series.push(edge, { ...edge });
    }
    this.plot = new uPlot({
      width: Math.max(this.drawn.clientWidth, 100),
      height: Math.max(this.drawn.clientHeight, 100),
      legend: { show: false },
      cursor: { show: false },
      padding: [6, RIGHT, 0, 0],
      scales: {
        x: { time: false, range: () => [-this.seconds, 0] },
        y: { range: () => this.fixed ?? [this.range.low * this.factor, this.range.high * this.factor] },
      },
      axes: axes({ values: (_, splits) => splits.map((value) => (value === 0 ? "now" : `${tick(value)} s`)) }),
      series,
      bands,
      hooks: { draw: this.marks ? [(plot) => this.marks(plot, this)] : [] },
    }, [[], ...series.slice(1).map(() => [])], this.drawn);
    this.plot.over.parentElement.setAttribute("aria-hidden", "true");
  }

  get seconds() { return this.store?.seconds ?? 10; }

  resize() {
    const width = this.drawn.clientWidth, height = this.drawn.clientHeight;
    if (!width) return; // in a closed fold
    if (width !== this.plot.width || height !== this.plot.height) this.plot.setSize({ width, height });
  }

  /** Draw the store; panels of the same width share the pieces. */
  draw(store, piecesOf) {
    this.store = store;
    const pieces = piecesOf(Math.max(Math.round(this.plot.width - AXIS - RIGHT), 50));
    const data = [pieces.x];
    const extent = [Infinity, -Infinity];
    for (const line of this.lines) {
      const values = pieces.extremes(line.channel);
      data.push(values);
      const edges = line.error
        ? [pieces.edge(line.channel, line.error, BAND), pieces.edge(line.channel, line.error, -BAND)] : [];
      data.push(...edges);
      this.extend(extent, values, line.error ? edges : null);
    }
    if (!this.fixed) this.range.fit(...extent);
    this.rescale();
    if (this.factor !== 1) {
      for (let k = 1; k < data.length; k += 1) {
        data[k] = data[k].map((value) => (value === null ? null : value * this.factor));
      }
    }
    this.plot.setData(data);
    this.figure.classList.toggle("absent", data.slice(1).every((values) => values.every((value) => value === null)));
  }

  /** Extend the range: by all of a measurement; by an estimate without its start, and its present error band. */
  extend(extent, values, edges) {
    const [low, high] = spread(values, edges ? 0.04 : 0);
    extent[0] = Math.min(extent[0], Number.isNaN(low) ? Infinity : low);
    extent[1] = Math.max(extent[1], Number.isNaN(high) ? -Infinity : high);
    if (!edges) return;
    const last = values.findLastIndex((value) => value !== null);
    if (last < 0) return;
    const up = edges[0][last] ?? values[last], down = edges[1][last] ?? values[last];
    let most = Math.max(Math.abs(values[last]), high - low); // an initial estimate has infinite errors
    if (most < 1e-6 * (up - down)) most = up - down; // at zero only the error gives a scale
    extent[0] = Math.min(extent[0], Math.max(down, values[last] - most));
    extent[1] = Math.max(extent[1], Math.min(up, values[last] + most));
  }

  rescale() {
    const scale = scaleOf(Math.max(Math.abs(this.range.low), Math.abs(this.range.high)), this.unit);
    this.factor = this.fixed ? 1 : scale.factor;
    this.shownUnit = this.fixed ? this.unit : scale.unit;
    this.entitle();
  }

  remove() {
    this.plot.destroy();
    this.figure.remove();
  }
}

/** Draw a horizontal line at a limit. */
export function level(value) {
  return ({ ctx, bbox, valToPos }) => {
    ctx.save();
    ctx.strokeStyle = theme.bad;
    ctx.lineWidth = 1.5 * devicePixelRatio;
    ctx.beginPath();
    ctx.moveTo(bbox.left, valToPos(value, "y", true));
    ctx.lineTo(bbox.left + bbox.width, valToPos(value, "y", true));
    ctx.stroke();
    ctx.restore();
  };
}

/** Draw vertical lines at material changes, and a strip that shows states other than free and contact. */
export function marked(changes, words) {
  return (plot, panel) => {
    const { ctx, bbox } = plot;
    const store = panel.store;
    if (!store?.length) return;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    const ratio = devicePixelRatio;
    ctx.strokeStyle = theme.lines[1];
    ctx.fillStyle = theme.text;
    ctx.lineWidth = 1.5 * ratio;
    ctx.setLineDash([5 * ratio, 4 * ratio]);
    ctx.font = `${12 * ratio}px system-ui, sans-serif`;
    ctx.textBaseline = "top";
    let row = 0;
    for (const change of changes()) {
      const ago = change.time - store.now;
      if (ago < -store.seconds || ago > 0) continue;
      const x = plot.valToPos(ago, "x", true);
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      if (!words) continue;
      const text = words(change);
      const onLeft = x > bbox.left + 0.5 * bbox.width;
      ctx.textAlign = onLeft ? "right" : "left";
      ctx.fillText(text, x + (onLeft ? -6 : 6) * ratio, bbox.top + (4 + 16 * (row % 3)) * ratio);
      row += 1;
    }
    if (words) states(plot, store, ratio);
    ctx.restore();
  };
}

function states(plot, store, ratio) {
  const { ctx, bbox } = plot;
  const state = store.of("state");
  let begun = store.start;
  for (let k = store.start + 1; k <= store.end; k += 1) {
    if (k < store.end && state[k] === state[begun]) continue;
    const colour = theme.states[state[begun]];
    if (colour) {
      const left = plot.valToPos(store.times[begun] - store.now, "x", true);
      const right = plot.valToPos(store.times[k - 1] - store.now, "x", true);
      ctx.fillStyle = colour;
      ctx.fillRect(left, bbox.top + bbox.height - 5 * ratio, Math.max(right - left, 2 * ratio), 5 * ratio);
    }
    begun = k;
  }
}

/** Cache the pieces of one frame by the number of pixels. */
export function shared(store) {
  const made = new Map();
  return (pixels) => {
    if (!made.has(pixels)) made.set(pixels, new Pieces(store, pixels));
    return made.get(pixels);
  };
}
