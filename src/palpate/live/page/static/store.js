// The last seconds at full rate, in typed arrays of fixed size.

const MOST = 1 << 16; // rows: 10 s at 6.5 kHz, less from a faster source
const HEADER = 24; // bytes: thinning, rows, number of the first, dropped, void

export class Store {
  constructor(channels, seconds) {
    this.seconds = seconds;
    this.names = channels;
    this.at = Object.fromEntries(channels.map((name, place) => [name, place]));
    // Twice as long, so that the shown rows are always contiguous.
    this.times = new Float64Array(2 * MOST);
    this.values = channels.map(() => new Float32Array(2 * MOST));
    this.start = this.end = 0;
    this.dropped = this.rows = 0;
    this.every = 1;
  }

  get length() { return this.end - this.start; }
  get now() { return this.end ? this.times[this.end - 1] : NaN; }

  /** Add a frame from the server; return how many rows were dropped before it. */
  take(buffer) {
    const head = new DataView(buffer);
    const count = head.getUint32(4, true);
    const dropped = head.getUint32(16, true);
    this.every = head.getUint32(0, true);
    if (head.getUint32(20, true)) this.start = this.end = 0;
    this.dropped += dropped;
    this.rows += count;
    this.append(new Float64Array(buffer, HEADER, count),
      this.values.map((_, place) => new Float32Array(buffer, HEADER + 8 * count + 4 * count * place, count)));
    return dropped;
  }

  append(times, values) {
    const count = times.length;
    if (!count) return;
    if (this.end + count > this.times.length) this.toTheFront();
    this.times.set(times, this.end);
    this.values.forEach((each, place) => each.set(values[place], this.end));
    this.end += count;
    const oldest = this.now - this.seconds;
    while (this.start < this.end && (this.times[this.start] < oldest || this.length > MOST)) this.start += 1;
  }

  toTheFront() {
    const from = Math.max(this.start, this.end - MOST);
    this.times.copyWithin(0, from, this.end);
    for (const each of this.values) each.copyWithin(0, from, this.end);
    this.end -= from;
    this.start = 0;
  }

  of(name) { return this.values[this.at[name]]; }
}

/** Start of the piece of data behind each pixel; the pieces are fixed in time, so that nothing flickers. */
export class Pieces {
  constructor(store, pixels) {
    const { times, start, end, seconds, now } = store;
    // Few samples are drawn one by one.
    this.single = store.length < 4 * pixels;
    this.store = store;
    if (this.single) {
      this.x = Array.from({ length: store.length }, (_, k) => times[start + k] - now);
      return;
    }
    const width = seconds / pixels;
    const first = Math.floor((now - seconds) / width);
    this.begins = new Int32Array(pixels + 2);
    this.x = [];
    let place = start;
    for (let k = 0; k <= pixels; k += 1) {
      const left = (first + k) * width;
      while (place < end && times[place] < left) place += 1;
      this.begins[k] = place;
      this.x.push(left + 0.25 * width - now, left + 0.75 * width - now);
    }
    this.begins[pixels + 1] = end;
  }

  /** The smallest and the largest value of each piece, in the order of time; null without data. */
  extremes(name) {
    const values = this.store.of(name);
    if (this.single) return this.each((k) => values[k]);
    const found = new Array(this.x.length);
    for (let k = 0; 2 * k < found.length; k += 1) {
      let low = Infinity, high = -Infinity, lowAt = 0, highAt = 0;
      for (let i = this.begins[k]; i < this.begins[k + 1]; i += 1) {
        const value = values[i];
        if (value < low) { low = value; lowAt = i; }
        if (value > high) { high = value; highAt = i; }
      }
      const none = low === Infinity;
      found[2 * k] = none ? null : lowAt <= highAt ? low : high;
      found[2 * k + 1] = none ? null : lowAt <= highAt ? high : low;
    }
    return found;
  }

  /** The outer edge of value + factor × error of each piece. */
  edge(name, error, factor) {
    const values = this.store.of(name), errors = this.store.of(error);
    if (this.single) return this.each((k) => values[k] + factor * errors[k]);
    const found = new Array(this.x.length);
    for (let k = 0; 2 * k < found.length; k += 1) {
      let outer = NaN;
      for (let i = this.begins[k]; i < this.begins[k + 1]; i += 1) {
        const value = values[i] + factor * errors[i];
        if (!(factor > 0 ? value <= outer : value >= outer) && value === value) outer = value;
      }
      found[2 * k] = found[2 * k + 1] = outer === outer ? outer : null;
    }
    return found;
  }

  each(value) {
    const { start } = this.store;
    return this.x.map((_, k) => {
      const found = value(start + k);
      return Number.isFinite(found) ? found : null;
    });
  }
}
