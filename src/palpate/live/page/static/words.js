// Words come finished from the server: each goes to the place of its name in the document.

export const $ = (id) => document.getElementById(id);

export function element(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

/** Text that is written only where it is another: what stays the same is not laid out anew. */
export function say(place, words) {
  if (place.textContent !== words) place.textContent = words;
}

// How a row is made, by the name of its place or else by its kind.
const ROWS = {
  numbers: ([name, words]) => element("div", { className: "number-tile" },
    element("small", {}, name), element("b", {}, words)),
  "law-rows": ([name, width, close, words, chosen]) => {
    const bar = element("i", { className: close ? "law-bar close" : "law-bar" });
    bar.style.width = `${width}%`;
    return element("tr", { className: chosen ? "chosen" : "" }, element("th", { scope: "row" }, name),
      element("td", { className: "law-track" }, bar), element("td", {}, words));
  },
  diagnosis: ([words, kind, badge]) => (badge
    ? element("p", {}, element("b", { className: `badge ${kind}` }, badge), words)
    : element("p", { className: kind }, words)),
  DL: ([name, words, kind = ""]) => element("div", { className: kind },
    element("dt", {}, name), element("dd", {}, words)),
  OL: (words) => element("li", {}, words),
  UL: (words) => element("li", {}, words),
  TBODY: (cells) => element("tr", {}, ...cells.map((each, k) => element(k ? "td" : "th", {},
    ...(Array.isArray(each) ? each.map((line) => element("div", {}, line)) : [each])))),
};
const made = new WeakMap();

/** Fill places with texts and rows; of the rows those that are others. */
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
