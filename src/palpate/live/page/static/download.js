// Export of the shown data as a CSV table, which `palpate identify` can read.

import { element } from "./words.js";

const COLUMNS = { penetration: "penetration_m", velocity: "velocity_m_s", force: "force_N" };

export function table(store, page) {
  const law = page.loop.law ?? { names: [], symbols: [] };
  const names = {
    ...COLUMNS,
    predicted_force: "predicted_force",
    stiffness: "stiffness", stiffness_error: "stiffness_standard_error",
    damping: "damping", damping_error: "damping_standard_error",
    ...Object.fromEntries((law.names ?? law.symbols).flatMap((name, k) => [
      [`parameter_${k}`, name], [`error_${k}`, `${name}_standard_error`]])),
    margin: "validity_margin", state: "state", lateness: "lateness_s",
  };
  const channels = Object.keys(names);
  const columns = channels.map((name) => store.of(name));
  const lines = [
    `# made by: palpate live, from ${String(page.loop.source).replaceAll(/\s+/g, " ")}`,
    `# method: ${page.loop.method}; stiffness and damping at ${page.depth.value ?? "unknown"} m; ` +
      `every ${store.every === 1 ? "sample" : `${store.every}th sample`}; seven digits`,
    ["time_s", ...channels.map((name) => names[name])].join(","),
  ];
  for (let k = store.start; k < store.end; k += 1) {
    const row = columns.map((each) => (Number.isFinite(each[k]) ? Number(each[k].toPrecision(7)) : ""));
    lines.push([store.times[k], ...row].join(","));
  }
  return `${lines.join("\n")}\n`;
}

export function download(store, page) {
  const url = URL.createObjectURL(new Blob([table(store, page)], { type: "text/csv" }));
  const link = element("a", { href: url, download: "palpate-live.csv" });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(url), 10000);
}
