// What is said in words.

import { duration, percent, rounded, scaleOf, withError } from "./digits.js";

export const STATES = {
  free: ["○", "Free", "The probe touches nothing; the estimate is held."],
  contact: ["●", "Contact", "The estimate is refreshed with every sample."],
  held: ["Ⅱ", "Held", "On request: nothing is learned until it is resumed."],
  changed: ["◆", "Changed", "The material has changed; the estimate was reinitialised."],
  invalid: ["✕", "Invalid", "Samples come that cannot be taken; the estimate is held."],
  lost: ["?", "Lost", "No sample comes; the estimate is held."],
  taring: ["▽", "Taring", "The force without contact is measured: touch nothing."],
  none: ["·", "Starting", "The source is being opened."],
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
  const shown = law.shown ? law.shown.filter((k) => found.parameters[k] !== null) : [...law.symbols.keys()];
  return shown.map((k) => element("div", {},
    `${law.symbols[k]} = ${withError(found.parameters[k] ?? NaN, [found.errors[k] ?? NaN], law.units[k])}`));
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
      ? `${percent(each.within)} in ${duration(each.limit)}` : "–"));
  table.tBodies[0].replaceChildren(row("after its sample", loop.lateness), row("update and estimate", loop.cycle));
}

// Counts that are as they should be, however many there are.
const FINE = { taken: "samples", learned: "learned", changes: "changes" };

/** Counts, with those marked that ought to be none. */
export function fillCounts(list, page, store) {
  const counts = page.loop.counts ?? {};
  const rows = Object.entries(FINE).map(([name, words]) => [words, counts[name]]);
  for (const [name, count] of Object.entries(counts)) {
    if (!(name in FINE) && typeof count === "number") rows.push([name.replaceAll("_", " "), count, true]);
  }
  rows.push(
    ["page: dropped", (page.page.dropped ?? 0) + store.dropped, true],
    ["page: skipped for all", page.page.skipped, true],
    ["page: bad requests", (page.page.malformed ?? 0) + (page.page.refused ?? 0), true],
    ["page: stalled", (page.page.stalled ?? 0) + (page.page.turned_away ?? 0), true],
    ["page: browsers", page.page.clients],
    ...Object.entries(page.others).map(([name, other]) => [`${name}: dropped`, other.dropped, true]),
  );
  for (const [name, count, bad] of rows) {
    let place = [...list.children].find((each) => each.dataset.name === name);
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

const BADGES = { trust: "yes", "with-care": "partly", "do-not-trust": "no" };

/** The last verdict, its reason, and the numbers at their depths with all that is known to move them. */
export function fillDiagnosis(place, found) {
  const run = `${found?.runs ?? found?.at} ${found?.outdated ?? ""}`;
  if (!found?.at || place.dataset.run === run) return;
  place.dataset.run = run;
  const verdict = found.verdict?.overall ?? "";
  const seconds = rounded(found.window[1] - found.window[0], 2);
  const made = [
    element("p", {}, element("b", { className: `badge ${(!found.outdated && BADGES[verdict]) || "open"}` },
      verdict ? verdict.replaceAll("-", " ") : "no verdict"), `: ${found.reason ?? ""}`),
  ];
  if (found.outdated) made.unshift(element("p", {}, `Of before: ${found.outdated}.`));
  if (found.remedy) made.push(element("p", {}, found.remedy));
  const quantity = (each, unit) => withError(each?.value ?? NaN, [each?.standard_error ?? NaN, each?.systematic ?? NaN], unit);
  for (const each of found.working_depths ?? []) {
    const scale = scaleOf(each.depth, "m");
    made.push(element("p", {}, `At ${rounded(each.depth * scale.factor, 3)} ${scale.unit}: ` +
      `stiffness ${quantity(each.stiffness, "N/m")}, damping ${quantity(each.damping, "N·s/m")}`));
  }
  made.push(element("p", { className: "soft" }, `By ${found.method}, of the last ${seconds} s at ${found.at}, ${found.samples} samples.`));
  place.replaceChildren(...made);
}

/** What the laboratory is made of, which identification should give back. */
export function truthWords(truth, law) {
  if (!truth || typeof truth !== "object") return "";
  const { kind, ...values } = truth;
  const symbol = (name) => (kind === law?.kind ? (law.symbols[law.names.indexOf(name)] ?? name) : name.replaceAll("_", " "));
  const parts = Object.entries(values).filter(([, value]) => typeof value === "number")
    .map(([name, value]) => `${symbol(name)} = ${rounded(value, 4)}`);
  return `Truth: ${[kind, ...parts].join(", ")}`;
}
