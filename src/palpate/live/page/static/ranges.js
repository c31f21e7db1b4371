// Ranges of axes, which change only when the shown data require it.

const LEAST = 5e-4; // shortest range relative to the values: the labels of a shorter one are too wide

export class Range {
  constructor() {
    this.low = 0;
    this.high = 1;
    this.known = false;
  }

  /** Include low to high; shrink a range that is much too wide. */
  fit(low, high) {
    if (!(Number.isFinite(low) && Number.isFinite(high))) return;
    const middle = 0.5 * (low + high);
    const span = Math.max(high - low, LEAST * Math.abs(middle), 1e-300);
    const inside = low >= this.low && high <= this.high;
    if (this.known && inside && span > 0.3 * (this.high - this.low)) return;
    this.low = middle - 0.56 * span;
    this.high = middle + 0.6 * span;
    if (low >= 0 && this.low < 0) this.low = 0;
    this.known = true;
  }
}

/** Smallest and largest of the values, without a fraction at either end. */
export function spread(values, left = 0) {
  const known = values.filter((value) => value !== null && Number.isFinite(value));
  if (!known.length) return [NaN, NaN];
  if (!left) {
    let low = Infinity, high = -Infinity;
    for (const value of known) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
    return [low, high];
  }
  known.sort((a, b) => a - b);
  return [known[Math.floor(left * (known.length - 1))], known[Math.ceil((1 - left) * (known.length - 1))]];
}

const POWERS = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };
const PREFIXES = { 9: "G", 6: "M", 3: "k", 0: "", "-3": "m", "-6": "µ", "-9": "n", "-12": "p" };

/** The unit in which the largest value is in [1, 1000), as in palpate's figures. */
export function scaleOf(largest, unit) {
  if (!(Number.isFinite(largest) && largest > 0) || !/^[Nm]/.test(unit)) return { factor: 1, unit };
  let power = 3 * Math.floor(Math.log10(largest * (1 + 1e-9)) / 3);
  if (unit.startsWith("m")) power = Math.min(power, 0);
  if (power in PREFIXES) return { factor: 10 ** -power, unit: PREFIXES[power] + unit };
  return { factor: 10 ** -power, unit: `10${[...String(power)].map((sign) => POWERS[sign]).join("")} ${unit}` };
}
