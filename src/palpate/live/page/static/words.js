// The server composes every text; here each goes into the element whose id is its key.

export const $ = (id) => document.getElementById(id);

export function element(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

/** Set an element's text only if it differs, so that the browser lays out nothing else again. */
export function say(place, words) {
  if (place.textContent !== words) place.textContent = words;
}

const tile = ([name, words]) => element("div", { className: "number-tile" },
  element("small", {}, name), element("b", {}, words));
const headline = ([name, words, kind, badge, why, now]) => element("div", { className: `number-tile ${kind}` },
  element("small", {}, name), element("b", {}, words),
  element("p", {}, kind === "no" ? "Not usable: " : "", element("b", { className: `badge ${kind}` }, badge), why && `: ${why}`),
  element("p", { className: "now" }, now));
const paragraph = ([words, kind, link = ""]) => element("p", { className: kind },
  link ? element("a", { href: link, target: "_blank", rel: "noopener" }, words) : words);
// How a row is made: by the id of its parent, else by the parent's tag.
const ROWS = {
  numbers: tile,
  working: headline,
  damping: headline,
  diagnosis: paragraph,
  gains: paragraph,
  DL: ([name, words, kind = ""]) => element("div", { className: kind },
    element("dt", {}, name), element("dd", {}, words)),
  OL: (words) => element("li", {}, words),
  UL: (words) => element("li", {}, words),
  TBODY: (cells) => element("tr", {}, ...cells.map((each, k) => element(k ? "td" : "th", {},
    ...(Array.isArray(each) ? each.map((line) => element("div", {}, line)) : [each])))),
};
const made = new WeakMap();

/** Fill elements with texts and rows; rows that are unchanged stay as they are. */
export function fill(view) {
  for (const [name, words] of Object.entries(view)) {
    const place = $(name)?.tBodies?.[0] ?? $(name);
    if (place && Array.isArray(words)) fillRows(place, words, ROWS[name] ?? ROWS[place.tagName]);
    else if (place) say(place, words);
  }
}

function fillRows(place, rows, make) {
  rows.forEach((row, k) => {
    const text = JSON.stringify(row), there = place.children[k];
    if (there && made.get(there) === text) return;
    const fresh = make(row);
    made.set(fresh, text);
    if (there) there.replaceWith(fresh);
    else place.append(fresh);
  });
  while (place.children.length > rows.length) place.lastElementChild.remove();
}
