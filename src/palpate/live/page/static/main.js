// The page: what the server sends is kept, drawn and said; what a person asks goes back.

import { Connection } from "./connection.js";
import { Controls } from "./controls.js";
import { level, marked, shared, TimePanel } from "./curves.js";
import { download } from "./download.js";
import { Plane } from "./plane.js";
import { Store } from "./store.js";
import { theme, watchTheme } from "./theme.js";
import { $, element, fill, say } from "./words.js";

const SLOW = 2; // frames with losses before fewer samples are asked for

let store = null, page = null, panels = [], plane = null, built = "", paused = false, fresh = false;
let losses = 0, every = 1, drawn = 0, drawnSince = performance.now(), rate = 0;
const OFTEN = ["free", "contact"]; // these come and go too quickly to be read out

watchTheme(() => { fresh = true; });
const connection = new Connection({ onFrame, onMessage, onWords });
const controls = new Controls({
  ask(what, options) {
    if (connection.ask(what, options)) say($("answer"), "");
    else say($("answer"), "There is no connection: nothing was asked.");
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
    say($("answer"), `Refused: ${message.words}`);
  } else if (message.kind === "page") {
    show(message);
    if (message.ended) connection.why = message.loop.stopped ? "The run is over" : "The loop is gone";
  }
}

function onWords(text, broken) {
  say($("link"), text);
  if (broken) say($("spoken"), text.split(":")[0]);
  $("link").classList.toggle("broken", broken);
}

function show(message) {
  showState(message);
  controls.show(message);
  fill(message.facts);
  if (!paused) {
    page = message;
    build(message);
    fill(message.view);
    showLaw(message);
    plane.curve = message.now.curve ?? {};
    fresh = true;
  }
  const thinned = (every > 1 ? `, every ${every}th sample` : "") + (store.dropped ? `, ${store.dropped} dropped here` : "");
  onWords(`${paused ? "View paused" : `Connected, ${rate} frames/s${thinned}`}`, false);
}

/** The gravest that holds, in words; a watchdog says what it saw. */
function showState({ state, facts }) {
  $("state").dataset.state = state;
  say($("spoken"), OFTEN.includes(state) ? "" : facts["state-name"]);
}

/** The card of laws, where there are several. */
function showLaw({ loop: { verdict }, view }) {
  $("law").hidden = !verdict;
  if (!verdict) return;
  $("law-badge").className = `badge ${view["law-kind"]}`;
  $("law").classList.toggle("past", verdict.certainty === "before");
}

/** Panels for the law that is identified; made anew where another is. */
function build({ loop, view }) {
  const [[atDepth], ...shown] = view.curves;
  const key = JSON.stringify([loop.law?.kind, shown, loop.verdict?.offered, loop.needs_condition_10]);
  if (key === built) {
    panels[1].name = atDepth;
    panels[1].entitle();
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
    marks: marked(changes, (change) => change.words),
  });
  plane = new Plane($("panels"));
  const estimates = view.curves.map(([name, unit, channel, error], k) => new TimePanel($("panels"), {
    name, unit, label: `${name}, with a band of two standard errors`, marks,
    lines: [{ channel, error, colour: () => theme.lines[k % 6] }],
  }));
  panels = [force, ...estimates];
  if (loop.needs_condition_10) {
    panels.push(new TimePanel($("panels"), {
      kind: "margin", name: "Margin of condition 10 (below 0 the estimate is biased)", fixed: [-1, 1],
      lines: [{ channel: "margin", colour: () => theme.lines[3] }], marks: level(0),
    }));
  }
  // Before the loop says its law there are fewer panels, and what is below them would move.
  if (loop.law?.kind) document.body.classList.add("ready");
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
