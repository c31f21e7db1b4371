// The page: stores, draws and shows what the server sends, and sends the user's requests back.

import { Connection } from "./connection.js";
import { Controls } from "./controls.js";
import { level, marked, shared, TimePanel } from "./curves.js";
import { download } from "./download.js";
import { Plane } from "./plane.js";
import { Store } from "./store.js";
import { theme, watchTheme } from "./theme.js";
import { $, element, fill, say } from "./words.js";

const SLOW = 2; // frames with losses before the page requests fewer samples

let store = null, page = null, panels = [], built = "", paused = false, fresh = false;
let losses = 0, every = 1, drawn = 0, drawnSince = performance.now(), rate = 0;
const OFTEN = ["free", "contact"]; // these change too quickly for a screen reader

watchTheme(() => { fresh = true; });
const plane = new Plane($("loop"));
const connection = new Connection({ onFrame, onMessage, onWords });
const controls = new Controls({
  ask(what, options) {
    if (connection.ask(what, options)) say($("answer"), "");
    else say($("answer"), "No connection to palpate: the request was not sent.");
  },
  onPause(now) {
    paused = now;
    if (!paused) connection.ask("every", { value: every }); // with the samples of the pause
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
    // Another version of the server may have other channels.
    if (String(store?.names) !== String(message.channels)) store = new Store(message.channels, 10);
    every = 1;
    controls.hello(message.methods, message.choices);
    if (paused) controls.show(page);
  } else if (message.kind === "refused") {
    say($("answer"), `Request refused: ${message.words}`);
  } else if (message.kind === "page") {
    show(message);
    if (message.ended) connection.why = message.loop.stopped ? "The run has ended" : "The loop has ended unexpectedly";
  }
}

function onWords(text, broken) {
  say($("link"), text);
  document.body.classList.toggle("stale", broken);
  if (broken) say($("spoken"), text.split(":")[0]);
  $("link").classList.toggle("broken", broken);
}

function show(message) {
  showState(message);
  controls.show(message);
  // Stiffness stands alone at the top; damping is in a fold, its mark in the fold's title.
  const [stiffness, damping] = message.facts.working;
  fill({ ...message.facts, working: [stiffness], damping: [damping], "damping-mark": damping[3] });
  if (!paused) {
    page = message;
    build(message);
    fill(message.view);
    showLaw(message);
    plane.curve = message.now.curve ?? {};
    fresh = true;
  }
  const thinned = (every > 1 ? `, every ${every}th sample` : "") + (store.dropped ? `, ${store.dropped} samples dropped` : "");
  onWords(`${paused ? "View paused" : `Connected, ${rate} frames/s${thinned}`}`, false);
}

/** Show the state, and announce it to screen readers. */
function showState({ state, facts }) {
  $("state").dataset.state = state;
  say($("spoken"), OFTEN.includes(state) ? "" : facts["state-name"]);
}

/** The card of the force laws, shown only if the estimator compares several. */
function showLaw({ loop: { verdict }, view }) {
  $("law").hidden = !verdict;
  if (!verdict) return;
  $("law-badge").className = `badge ${view["law-kind"]}`;
  $("law").classList.toggle("past", verdict.certainty === "before");
}

/** Make the panels of the identified law, again whenever the law changes. */
function build({ loop, view }) {
  const [[stiffness], [damping], ...shown] = view.curves;
  const key = JSON.stringify([loop.law?.kind, shown, loop.needs_condition_10]);
  if (key === built) {
    [panels[1].name, panels[2].name] = [stiffness, damping];
    for (const panel of panels.slice(1, 3)) panel.entitle();
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
  const estimates = view.curves.map(([name, unit, channel, error], k) => new TimePanel($("panels"), {
    name, unit, label: `${name}, with a band of two standard errors`, marks,
    lines: [{ channel, error, colour: () => theme.lines[k % 6] }],
  }));
  panels = [force, ...estimates];
  if (loop.needs_condition_10) {
    panels.push(new TimePanel($("panels"), {
      kind: "margin", name: "Validity margin of the linearisation (below 0: the estimate is biased)", fixed: [-1, 1],
      lines: [{ channel: "margin", colour: () => theme.lines[3] }], marks: level(0),
    }));
  }
  // Until the law is known there are fewer panels, and the content below would shift.
  if (loop.law?.kind) document.body.classList.add("ready");
}

function draw() {
  requestAnimationFrame(draw);
  if (!fresh || !store?.length || !panels.length) return;
  fresh = false;
  const piecesOf = shared(store);
  if ($("curves-fold").open) for (const panel of panels) panel.draw(store, piecesOf);
  plane.draw(store);
  drawn += 1;
  const now = performance.now();
  if (now - drawnSince >= 1000) {
    rate = Math.round((1000 * drawn) / (now - drawnSince));
    drawn = 0;
    drawnSince = now;
  }
}

const observer = new ResizeObserver(() => {
  for (const panel of [...panels, plane]) panel.resize();
  fresh = true;
});
observer.observe($("panels")); // a fold that is opened has another size
observer.observe($("loop"));
requestAnimationFrame(draw);

// For a browser's developer tools, and the tests.
globalThis.palpate = { get store() { return store; }, get page() { return page; }, get rate() { return rate; }, connection };
