// What is said in words.

import { duration, rounded, withError } from "./digits.js";

export const STATES = {
  free: ["○", "Free", "The probe touches nothing; the estimate is held."],
  contact: ["●", "Contact", "The estimate is refreshed with every sample."],
  held: ["Ⅱ", "Held", "On request: nothing is learned until it is resumed."],
  changed: ["◆", "Changed", "The material has changed; the estimate was reinitialised."],
  invalid: ["✕", "Invalid", "Samples come that cannot be taken; the estimate is held."],
  lost: ["?", "Lost", "No sample comes; the estimate is held."],
  taring: ["▽", "Taring", "The force without contact is measured: touch nothing."],
  none: ["·", "No run yet", ""],
  dead: ["✕", "Stopped", "The loop does not answer any more; what it found last is shown."],
  ended: ["■", "Ended", "The run is over; what it found is shown."],
};

export function element(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

/** "K = 99000 ± 1100 N/mⁿ", a line a parameter. */
function lawWords(law, found) {
  if (!law?.symbols || !found?.parameters) return ["unknown"];
  return law.symbols.map((symbol, k) => element("div", {},
    `${symbol} = ${withError(found.parameters[k] ?? NaN, [found.errors[k] ?? NaN], law.units[k])}`));
}

export function changeWords(change) {
  const of = (found) => rounded(found?.stiffness?.[0] ?? NaN, 3);
  return `${of(change.before)} → ${of(change.after)} N/m`;
}

/** Text that is written only where it is another: what stays the same is not laid out anew. */
export function say(place, words) {
  if (place.textContent !== words) place.textContent = words;
}

export function fillChanges(table, changes, now) {
  const rows = changes.slice().reverse().map((change) => element("tr", {},
    element("td", {}, `${rounded(Math.max(now - change.time, 0), 3)} s ago`),
    element("td", {}, ...lawWords(change.law, change.before)),
    element("td", {}, ...lawWords(change.law, change.after))));
  if (!rows.length) rows.push(element("tr", {}, element("td", { colSpan: 3, className: "soft" }, "none")));
  table.tBodies[0].replaceChildren(...rows);
}

export function fillTimes(table, loop) {
  const row = (name, each) => element("tr", {}, element("th", { scope: "row" }, name),
    ...["p50", "p99", "p99.9", "max"].map((key) => element("td", {}, duration(each?.[key] ?? NaN))),
    element("td", {}, Number.isFinite(each?.within)
      ? `${(100 * each.within).toFixed(each.within < 0.999 ? 1 : 3)} % in ${duration(each.limit)}` : "–"));
  table.tBodies[0].replaceChildren(row("after its sample", loop.lateness), row("update and estimate", loop.cycle));
}

/** Counts, with those marked that ought to be none. */
export function fillCounts(list, page, store) {
  const { counts = {}, lateness = {} } = page.loop;
  const late = Number.isFinite(lateness.within) ? Math.round((1 - lateness.within) * lateness.count) : 0;
  const rows = [
    ["samples", counts.taken], ["learned", counts.learned], ["changes", counts.changes],
    ["lost", counts.lost, true], ["repeated", counts.repeated, true], ["disordered", counts.disordered, true],
    ["malformed", counts.malformed, true], ["refused", counts.refused, true], ["late", late, true],
    ["silences", counts.silences, true],
    ["page: dropped", (page.page.dropped ?? 0) + store.dropped, true],
    ["page: skipped for all", page.page.skipped, true],
    ["page: bad requests", (page.page.malformed ?? 0) + (page.page.refused ?? 0), true],
    ["page: browsers", page.page.clients],
  ];
  for (const [name, count, bad] of rows) {
    let place = list.querySelector(`[data-name="${name}"]`);
    if (!place) {
      place = element("div", {}, element("dt", {}, name), element("dd"));
      place.dataset.name = name;
      list.append(place);
    }
    say(place.lastChild, String(count ?? 0));
    place.classList.toggle("bad", Boolean(bad && count));
  }
  list.title = counts.last_fault ? `last fault: ${counts.last_fault}` : "";
}

/** Whatever the diagnosis says of itself. */
export function fillDiagnosis(place, board) {
  const words = board ? readable(board) : [];
  const text = words.join("\n");
  if (!words.length || place.dataset.text === text) return;
  place.dataset.text = text;
  place.replaceChildren(...words.map((each) => element("p", {}, each)));
}

function readable(board) {
  return Object.entries(board).flatMap(([name, value]) => {
    if (value === null || value === "" || (Array.isArray(value) && !value.length)) return [];
    if (Array.isArray(value)) return value.map((each) => `• ${typeof each === "object" ? Object.values(each).join(": ") : each}`);
    if (typeof value === "object") return readable(value);
    if (typeof value === "number") return [`${name.replaceAll("_", " ")}: ${rounded(value, 4)}`];
    return [`${name.replaceAll("_", " ")}: ${value}`];
  });
}
