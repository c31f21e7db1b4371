// The page: what the server sends is kept, drawn and said; what a person asks goes back.

import { Connection } from "./connection.js";
import { Controls } from "./controls.js";
import { level, marked, shared, TimePanel } from "./curves.js";
import { rounded, scaleOf, withError } from "./digits.js";
import { buildLaw, showLaw } from "./law.js";
import { download } from "./download.js";
import { Plane } from "./plane.js";
import { Store } from "./store.js";
import { theme, watchTheme } from "./theme.js";
import * as words from "./words.js";

const $ = (id) => document.getElementById(id);
const NAMES = { K: "Stiffness", B: "Damping", n: "Exponent", M: "Relaxing stiffness", "α": "Spectrum's exponent", "τ₂": "Relaxation time" };
const SLOW = 2; // frames with losses before fewer samples are asked for

let store = null, page = null, panels = [], plane = null, built = "", paused = false, fresh = false;
let losses = 0, every = 1, drawn = 0, drawnSince = performance.now(), rate = 0;
const OFTEN = ["free", "contact"]; // these come and go too quickly to be read out

watchTheme(() => { fresh = true; });
const connection = new Connection({ onFrame, onMessage, onWords });
const controls = new Controls({
  ask(what, options) {
    if (connection.ask(what, options)) words.say($("answer"), "");
    else words.say($("answer"), "There is no connection: nothing was asked.");
  },
  onPause(now) {
    paused = now;
    if (!paused) connection.ask("every", { value: every }); // with all that was missed
  },
  onDownload() { if (store && page) download(store, page); },
});

function onFrame(buffer) {
  if (!store || paused) return;
  losses = store.take(buffer) ? losses + 1 : losses;
  if (losses >= SLOW && every < 8) {
    every *= 2;
    losses = 0;
    connection.ask("every", { value: every });
  }
  fresh = true;
}

function onMessage(message) {
  if (message.kind === "hello") {
    // Of another version of the server they may be others.
    if (String(store?.names) !== String(message.channels)) store = new Store(message.channels, 10);
    every = 1;
    controls.hello(message.methods, message.choices);
    if (paused) controls.show(page);
  } else if (message.kind === "refused") {
    words.say($("answer"), `Refused: ${message.words}`);
  } else if (message.kind === "page") {
    show(message);
    if (message.ended) connection.why = message.loop.stopped ? "The run is over" : "The loop is gone";
  }
}

function onWords(text, broken) {
  words.say($("link"), text);
  if (broken) words.say($("spoken"), text.split(":")[0]);
  $("link").classList.toggle("broken", broken);
}

function show(message) {
  showState(message);
  controls.show(message);
  words.fillCounts($("counts"), message, store);
  words.fillTimes($("times"), message.loop);
  $("said").replaceChildren(...(message.loop.said ?? []).slice().reverse().map((each) => words.element("li", {}, each)));
  words.fillDiagnosis($("diagnosis"), message.others.diagnosis);
  if (!paused) {
    page = message;
    build(message);
    showNumbers(message);
    showLaw(message.loop.verdict, store.now);
    plane.curve = message.now.curve ?? {};
    words.fillChanges($("changes"), message.changes, store.now);
    fresh = true;
  }
  const thinned = every > 1 ? `, every ${every}th sample` : "";
  onWords(`${paused ? "View paused" : `Connected, ${rate} frames/s${thinned}`}`, false);
}

/** The gravest that holds, in words; a watchdog says what it saw. */
function showState({ loop, alive, ended }) {
  const name = ended && loop.stopped ? "ended" : alive && !ended ? (loop.state ?? "none") : "dead";
  const [lamp, title, text] = words.STATES[name] ?? words.STATES.none;
  $("state").dataset.state = name;
  words.say($("lamp"), lamp);
  words.say($("state-name"), title);
  words.say($("state-words"), (alive && !ended && loop.fault) || text);
  words.say($("spoken"), OFTEN.includes(name) ? "" : title);
  words.say($("source"), loop.source ?? "");
}

/** Panels for the law that is identified; made anew where another is. */
function build({ loop, depth }) {
  const law = loop.law ?? { symbols: [], units: [] };
  const shown = shownOf(law);
  const key = JSON.stringify([law.kind, shown, loop.verdict?.offered, loop.needs_condition_10]);
  const at = depth.value ? ` at ${millimetres(depth.value)}` : " at working depth";
  const [stiff] = atDepth(law);
  if (key === built) {
    const there = panels.find((panel) => panel.atDepth);
    there.name = `${stiff}${at}`;
    there.entitle();
    return;
  }
  built = key;
  panels.forEach((panel) => panel.remove());
  $("panels").replaceChildren();
  const changes = () => page?.changes ?? [];
  const marks = marked(changes, null);
  const force = new TimePanel($("panels"), {
    kind: "force", name: "Force", unit: "N", label: "Force, measured and predicted",
    lines: [
      { channel: "force", key: "measured", label: "measured", colour: () => theme.measured, width: 2 },
      { channel: "predicted_force", key: "predicted", label: "predicted", colour: () => theme.lines[0] },
    ],
    marks: marked(changes, words.changeWords),
  });
  plane = new Plane($("panels"));
  const estimate = (name, unit, channel, error, colour) => new TimePanel($("panels"), {
    name, unit, label: `${name}, with a band of two standard errors`, marks,
    lines: [{ channel, error, colour: () => theme.lines[colour] }],
  });
  const stiffness = estimate(`${stiff}${at}`, "N/m", "stiffness", "stiffness_error", 0);
  stiffness.atDepth = true;
  panels = [force, stiffness, ...shown.map((k) =>
    estimate(symbolOf(law, k), law.units[k], `parameter_${k}`, `error_${k}`, (k + 1) % 6))];
  if (loop.needs_condition_10) {
    panels.push(new TimePanel($("panels"), {
      kind: "margin", name: "Margin of condition 10 (below 0 the estimate is biased)", fixed: [-1, 1],
      lines: [{ channel: "margin", colour: () => theme.lines[3] }], marks: level(0),
    }));
  }
  tiles(law);
  buildLaw(loop.verdict);
  document.body.classList.add("ready");
}

/** What K and B come to at a depth: of a law that may remember the spring once it has relaxed, and the damper alone. */
const atDepth = (law) => (law.remembers ? ["Relaxed", "Damper"] : ["Stiffness", "Damping"]);

/** Places of the parameters that some law on offer has as its own. */
const shownOf = (law) => law.shown ?? law.symbols.map((_, k) => k);
const symbolOf = (law, k) => (law.symbols[k] === "τ₂" ? "τ" : law.symbols[k]); // alone it is the only one

const millimetres = (depth) => {
  const scale = scaleOf(depth, "m");
  return `${rounded(depth * scale.factor, 3)} ${scale.unit}`;
};

function tiles(law) {
  const names = ["", "", ...shownOf(law).map((k) =>
    `${[NAMES[law.symbols[k]], symbolOf(law, k)].filter(Boolean).join(" ")}${law.units[k] ? ` [${law.units[k]}]` : ""}`)];
  $("numbers").replaceChildren(...names.map((name) => words.element("div", { className: "number-tile" },
    words.element("small", {}, name), words.element("b", {}, "unknown"))));
}

function showNumbers({ now, loop, depth }) {
  const law = loop.law ?? { symbols: [], units: [] };
  const at = depth.value ? ` at ${millimetres(depth.value)}${depth.chosen ? ", chosen" : ""}` : " at working depth";
  const texts = [
    withError(now.stiffness?.[0] ?? NaN, [now.stiffness?.[1] ?? NaN]),
    withError(now.damping?.[0] ?? NaN, [now.damping?.[1] ?? NaN]),
    ...shownOf(law).map((k) => numberWords(now, loop, k)),
  ];
  [...$("numbers").children].forEach((tile, k) => words.say(tile.lastChild, texts[k] ?? ""));
  const [stiff, damper] = atDepth(law);
  words.say($("numbers").children[0].firstChild, `${stiff}${at} [N/m]`);
  words.say($("numbers").children[1].firstChild, `${damper}${at} [N·s/m]`);
}

/** A parameter as the law in force has it: its own with its error, one that was given, or none. */
function numberWords(now, { law, verdict }, k) {
  const value = now.parameters?.[k] ?? NaN, name = law.names[k];
  if (verdict?.parameters && verdict.own.includes(name) && verdict.fixed.includes(name)) {
    return `${rounded(verdict.parameters[k], 6)} (given)`;
  }
  if (verdict && !verdict.parameters) return "unknown";
  if (verdict?.parameters && !verdict.own.includes(name)) return "not in this law";
  return withError(value, [now.errors?.[k] ?? NaN]);
}

function draw() {
  requestAnimationFrame(draw);
  if (!fresh || !store?.length || !panels.length) return;
  fresh = false;
  const piecesOf = shared(store);
  for (const panel of panels) panel.draw(store, piecesOf);
  plane.draw(store);
  drawn += 1;
  const now = performance.now();
  if (now - drawnSince >= 1000) {
    rate = Math.round((1000 * drawn) / (now - drawnSince));
    drawn = 0;
    drawnSince = now;
  }
}

new ResizeObserver(() => {
  for (const panel of [...panels, plane].filter(Boolean)) panel.resize();
  fresh = true;
}).observe($("panels"));
requestAnimationFrame(draw);

// For whoever looks at it with a browser's own tools.
globalThis.palpate = { get store() { return store; }, get page() { return page; }, get rate() { return rate; }, connection };
