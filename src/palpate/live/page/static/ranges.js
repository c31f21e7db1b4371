// Ranges of axes that stay as they are until what is shown needs others.

/** A round step, of which about so many fit. */
function step(span, many) {
  const raw = span / many;
  const power = 10 ** Math.floor(Math.log10(raw));
  return power * ([1, 2, 5].find((k) => k * power >= raw * 0.999) ?? 10);
}

export class Range {
  constructor(least = 0) {
    this.low = 0;
    this.high = 1;
    this.known = false;
    this.least = least; // the shortest that makes sense
  }

  /** Hold low to high; a range that is much too wide shrinks. */
  fit(low, high) {
    if (!(Number.isFinite(low) && Number.isFinite(high))) return;
    const middle = 0.5 * (low + high);
    const span = Math.max(high - low, this.least, 1e-6 * Math.abs(middle), 1e-300);
    const inside = low >= this.low && high <= this.high;
    if (this.known && inside && span > 0.3 * (this.high - this.low)) return;
    const round = step(1.2 * span, 5);
    this.low = Math.floor((middle - 0.55 * span) / round) * round;
    this.high = Math.ceil((middle + 0.55 * span) / round) * round;
    if (low >= 0 && this.low < 0) this.low = 0;
    this.known = true;
  }

  forget() { this.known = false; }
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
