// Force over penetration: the loops of the last ten seconds, and the quasi-static law.

import { axes, figure, RIGHT, tick } from "./curves.js";
import { Range, scaleOf } from "./ranges.js";
import { faint, theme } from "./theme.js";

const uPlot = globalThis.uPlot;
const RECENT = 1; // s drawn in full colour
const MOST = 2500; // points of the older part

export class Plane {
  constructor(parent) {
    const { made, caption, drawn } = figure(parent, "plane absent", "Force over penetration");
    this.figure = made;
    this.drawn = drawn;
    caption.innerHTML = "<b>F [N] over x [mm]</b><span class='key key-measured'>measured</span><span class='key key-law'>static law</span>";
    this.title = caption.firstChild;
    this.across = new Range();
    this.up = new Range();
    this.curve = {};
    this.plot = new uPlot({
      width: Math.max(drawn.clientWidth, 100),
      height: Math.max(drawn.clientHeight, 100),
      legend: { show: false },
      cursor: { show: false },
      padding: [6, RIGHT, 0, 0],
      scales: {
        x: { time: false, range: () => [this.across.low * this.deep.factor, this.across.high * this.deep.factor] },
        y: { range: () => [this.up.low * this.firm.factor, this.up.high * this.firm.factor] },
      },
      axes: axes({ values: (_, splits) => splits.map(tick) }),
      series: [{}, { points: { show: false } }],
      hooks: { draw: [() => this.loops()] },
    }, [[0, 1], [null, null]], drawn);
    this.plot.over.parentElement.setAttribute("aria-hidden", "true");
  }

  get deep() { return scaleOf(Math.max(Math.abs(this.across.low), Math.abs(this.across.high)), "m"); }
  get firm() { return scaleOf(Math.max(Math.abs(this.up.low), Math.abs(this.up.high)), "N"); }

  resize() {
    const width = this.drawn.clientWidth, height = this.drawn.clientHeight;
    if (!width) return; // in a closed fold
    if (width !== this.plot.width || height !== this.plot.height) this.plot.setSize({ width, height });
  }

  draw(store) {
    this.store = store;
    const x = store.of("penetration"), y = store.of("force");
    let left = 0, right = -Infinity, low = 0, high = -Infinity;
    for (let k = store.start; k < store.end; k += 1) {
      if (x[k] > right) right = x[k];
      if (x[k] < left) left = x[k];
      if (y[k] > high) high = y[k];
      if (y[k] < low) low = y[k];
    }
    this.figure.classList.remove("absent");
    this.across.fit(Math.max(left, -0.3 * right), right);
    this.up.fit(low, high);
    const words = `F [${this.firm.unit}] over x [${this.deep.unit}]`;
    if (this.title.textContent !== words) this.title.textContent = words;
    this.plot.setData([[0, 1], [null, null]]);
  }

  loops() {
    const { plot, store } = this;
    if (!store?.length) return;
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.lineJoin = "round";
    let recent = store.end;
    while (recent > store.start && store.times[recent - 1] > store.now - RECENT) recent -= 1;
    const every = Math.max(Math.ceil((recent - store.start) / MOST), 1);
    this.path(store.start, recent, every, faint(theme.measured), 1);
    this.path(recent, store.end, 1, theme.measured, 2);
    this.law();
    ctx.restore();
  }

  path(from, until, every, colour, width) {
    const { ctx } = this.plot;
    const x = this.store.of("penetration"), y = this.store.of("force");
    const [toX, toY] = this.places();
    ctx.beginPath();
    let pen = false;
    for (let k = from; k < until; k += every) {
      const known = x[k] === x[k] && y[k] === y[k];
      if (known && pen) ctx.lineTo(toX(x[k]), toY(y[k]));
      else if (known) ctx.moveTo(toX(x[k]), toY(y[k]));
      pen = known;
    }
    ctx.strokeStyle = colour;
    ctx.lineWidth = width * devicePixelRatio;
    ctx.stroke();
  }

  law() {
    const { penetration, force } = this.curve;
    if (!penetration) return;
    const { ctx } = this.plot;
    const [toX, toY] = this.places();
    ctx.beginPath();
    penetration.forEach((x, k) => {
      if (force[k] !== null) ctx.lineTo(toX(x), toY(force[k]));
    });
    ctx.strokeStyle = theme.lines[1];
    ctx.lineWidth = 2 * devicePixelRatio;
    ctx.stroke();
  }

  places() {
    const { left, top, width, height } = this.plot.bbox;
    const { across, up } = this;
    return [
      (x) => left + width * (x - across.low) / (across.high - across.low),
      (y) => top + height * (1 - (y - up.low) / (up.high - up.low)),
    ];
  }
}
