// Ranges of axes that stay as they are until what is shown needs others.

const LEAST = 5e-4; // of what is shown: numbers beside a shorter one have more digits than room

export class Range {
  constructor() {
    this.low = 0;
    this.high = 1;
    this.known = false;
  }

  /** Hold low to high; a range that is much too wide shrinks. */
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

/** Least and largest of numbers, but for a part at either end. */
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
