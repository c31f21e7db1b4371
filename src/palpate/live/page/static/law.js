// Which law it is, by how much, and the numbers that laws have in common. Every line has its place
// from the beginning on, whatever the law: nothing moves when it changes.

import { rounded, scaleOf, withError } from "./digits.js";
import { element, say } from "./words.js";

const $ = (id) => document.getElementById(id);
const BADGES = {
  none: ["no verdict yet", "open"], before: ["of before", "no"], alone: ["alone on offer", "open"],
  open: ["undecided", "no"], weak: ["not sure", "partly"], strong: ["strong evidence", "yes"],
};
const STRONG = 10; // as in palpate.estimators.law_verdicts
const DECADES = 6; // of the bars: 1 to a million
const TURNS = 4;
const NUMBERS = [
  ["stiffness", "Dynamic stiffness K′", "N/m"], ["damping", "Dynamic damping B′", "N·s/m"],
  ["loss_tangent", "Loss tangent tan δ", ""], ["instantaneous_stiffness", "Stiffness at once", "N/m"],
  ["relaxed_stiffness", "Stiffness once relaxed", "N/m"], ["relaxation_time", "Relaxation time", "s"],
];

/** Rows for the laws on offer; made anew where others are. */
export function buildLaw(verdict) {
  $("law").hidden = !verdict;
  if (!verdict) return;
  $("law-rows").replaceChildren(...verdict.offered.map((name) => {
    const bar = element("i", { className: "law-bar" });
    const track = element("td", { className: "law-track" }, bar);
    const row = element("tr", {}, element("th", { scope: "row" }, name), track, element("td", {}, "–"));
    row.dataset.law = name;
    return row;
  }));
  $("law-numbers").replaceChildren(...NUMBERS.map(([, name]) =>
    element("div", {}, element("dt", {}, name), element("dd", {}, "–"))));
  $("law-turns").replaceChildren(...Array.from({ length: TURNS }, () => element("li", {}, " ")));
  $("law-at").textContent = " ";
  $("law-flags").replaceChildren();
}

export function showLaw(verdict, now) {
  if (!verdict) return;
  const [badge, kind] = BADGES[verdict.certainty] ?? BADGES.none;
  const known = verdict.certainty !== "none";
  say($("law-name"), known ? verdict.law : "Not known yet");
  say($("law-badge"), badge);
  $("law-badge").className = `badge ${kind}`;
  say($("law-lead"), leadWords(verdict));
  say($("law-since"), sinceWords(verdict, now));
  showTurns(verdict.turns, now);
  showStandings(verdict);
  showNumbers(verdict);
  showFlags(verdict.flags);
  $("law").classList.toggle("past", verdict.certainty === "before");
}

function leadWords({ certainty, lead, second, samples, effective_samples: independent }) {
  const evidence = `${rounded(independent, 3)} independent samples of ${rounded(samples, 4)}.`;
  switch (certainty) {
    case "none": return "Press: the first verdict needs some samples in contact.";
    case "before": return `Of before, as are the parameters; since then there are ${rounded(samples, 3)} samples, too few for a verdict.`;
    case "alone": return `No other law competes. ${evidence}`;
    case "open": return `It cannot be told from ${second}: only ${difference(lead)} before it. ${evidence}`;
    default: return `${difference(lead)} before ${second}; ten are strong evidence. ${evidence}`;
  }
}

function sinceWords({ certainty, since, changes }, now) {
  if (certainty === "none" || certainty === "before" || !Number.isFinite(since)) return "";
  const times = changes === 1 ? "once" : `${changes} times`;
  const turned = changes ? `changed ${times} since` : "as from";
  return `In force for ${ago(now - since)}; ${turned} the evidence began.`;
}

const ago = (seconds) => `${Math.max(seconds, 0).toFixed(1)} s`;

/** The last turns, so that a verdict that flickers is seen. */
function showTurns(turns, now) {
  const last = turns.slice(-TURNS).reverse();
  [...$("law-turns").children].forEach((item, k) => {
    const turn = last[k];
    say(item, turn ? `${ago(now - turn[0])} ago: ${turn[1] ?? "evidence given up"}` : "");
  });
}

function showStandings({ standings, law, known }) {
  const least = standings.find((each) => each.law === law)?.score ?? 0;
  for (const row of $("law-rows").children) {
    const found = known ? standings.find((each) => each.law === row.dataset.law) : undefined;
    const chosen = Boolean(found) && found.law === law;
    const behind = found ? found.score - least : NaN;
    const [, track, score] = row.children;
    row.classList.toggle("chosen", chosen);
    track.firstChild.style.width = `${chosen || !found ? 0 : length(behind)}%`;
    track.firstChild.classList.toggle("close", behind < STRONG);
    say(score, chosen ? "in force" : found ? difference(behind) : "–");
  }
}

/** Of scores: to a tenth below a hundred. */
const difference = (score) => (score < 100 ? Math.max(score, 0).toFixed(1) : rounded(score, 3));
const length = (score) => 100 * Math.min(Math.log10(1 + Math.max(score, 0)) / DECADES, 1);

function showNumbers({ numbers, depth, frequency, spectrum, certainty }) {
  const scale = scaleOf(depth ?? NaN, "m");
  const known = Number.isFinite(depth) && Number.isFinite(frequency) && numbers.stiffness;
  say($("law-at"), known ? `A small oscillation about ${rounded(depth * scale.factor, 3)} ${scale.unit}, ` +
    `${rounded(frequency / (2 * Math.PI), 3)} Hz, the motion's own` : " ");
  [...$("law-numbers").children].forEach((row, k) => {
    const [name, , unit] = NUMBERS[k];
    const found = numbers[name];
    let words = found ? withError(found[0] ?? NaN, [found[1] ?? NaN], unit) : "–";
    if (!found && known) words = absent(name, spectrum);
    say(row.lastChild, certainty === "none" ? "–" : words);
  });
}

/** Why a law has no such number. */
function absent(name, spectrum) {
  if (name === "relaxation_time" && spectrum) {
    return `${rounded(spectrum[0], 2)} to ${rounded(spectrum[1], 2)} s, assumed`;
  }
  return name === "relaxation_time" ? "no memory" : "as K′: no memory";
}

function showFlags(flags) {
  const text = JSON.stringify(flags);
  if ($("law-flags").dataset.flags === text) return;
  $("law-flags").dataset.flags = text;
  const items = flags.length ? flags : ["nothing is open"];
  $("law-flags").replaceChildren(...items.map((each) => element("li", {}, each)));
}
