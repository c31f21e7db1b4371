// Numbers with the digits that their error allows: palpate.digits in the browser's language, held to
// it by a test.

const POWERS = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };
const PLAIN = (power) => power >= -3 && power < 5;

/** A number and its errors: "4300 ± 1600", "(1.000 ± 0.008)·10⁵". */
export function withError(value, errors, unit = "") {
  const known = errors.filter((error) => Number.isFinite(error) && error > 0);
  let words;
  if (!Number.isFinite(value)) words = "unknown";
  else if (!known.length) words = rounded(value, 4);
  else words = together(value, known);
  if (Number.isFinite(value) && !errors.every(Number.isFinite)) words += " ± unknown";
  return `${words} ${unit}`.trimEnd();
}

/** A number alone, in so many significant digits. */
export function rounded(value, digits) {
  if (!Number.isFinite(value)) return "unknown";
  if (value === 0) return "0";
  const power = powerOf(Number(exponential(value, digits - 1)));
  if (PLAIN(power)) return trimmed(fixed(value, Math.max(digits - 1 - power, 0)));
  return trimmed(fixed(scaled(value, power), digits - 1)) + `·10${superscript(power)}`;
}

function together(value, errors) {
  const [largest, place] = lastPlace(Math.max(...errors));
  const power = value ? Math.max(powerOf(value), powerOf(largest)) : powerOf(largest);
  if (PLAIN(power)) {
    return [written(value, place), ...errors.map((each) => errorTo(each, place))].join(" ± ");
  }
  const [first, ...rest] = [value, ...errors].map((each) => scaled(each, power));
  const parts = [written(first, place - power), ...rest.map((each) => errorTo(each, place - power))];
  return `(${parts.join(" ± ")})·10${superscript(power)}`;
}

function lastPlace(error) {
  const power = powerOf(error);
  const leading = Math.trunc(100 * scaled(error, power));
  if (leading <= 354) return [error, power - 1];
  if (leading <= 949) return [error, power];
  return [Number(`1e${power + 1}`), power];
}

function errorTo(error, place) {
  return written(error, Math.min(place, powerOf(Number(exponential(error, 0)))));
}

function written(value, place) {
  const words = place <= 0 ? fixed(value, -place)
    : String(even(value / 10 ** place) * 10 ** place);
  return words.startsWith("-") && !/[1-9]/.test(words) ? words.slice(1) : words;
}

// Of two that are equally near the even one, as Python has it; toFixed takes the larger.
function fixed(value, places) {
  const size = Math.abs(value);
  const long = size.toFixed(Math.min(places + 40, 100)); // exact digits
  const end = long.indexOf(".") + 1 + places;
  const tail = long.slice(end);
  let words = size.toFixed(places);
  if (/^50*$/.test(tail)) {
    const kept = long.slice(0, places ? end : end - 1);
    if (Number(kept.at(-1)) % 2 === 0) words = kept;
  }
  return (value < 0 || Object.is(value, -0) ? "-" : "") + words;
}

function exponential(value, places) {
  const words = value.toExponential(places);
  const digits = Math.abs(value).toPrecision(Math.min(places + 40, 100)).replace(".", "").replace(/e.*/, "").replace(/^0+/, "");
  if (/^50*$/.test(digits.slice(places + 1)) && Number(digits[places]) % 2 === 0) {
    const power = powerOf(value);
    const kept = digits.slice(0, places + 1);
    return `${value < 0 ? "-" : ""}${kept[0]}${places ? "." + kept.slice(1) : ""}e${power}`;
  }
  return words;
}

function even(value) {
  const low = Math.floor(value);
  const over = value - low;
  if (over === 0.5) return low % 2 === 0 ? low : low + 1;
  return over < 0.5 ? low : low + 1;
}

function scaled(value, power) {
  const [mantissa, exponent] = value.toExponential(16).split("e");
  return Number(`${mantissa}e${Number(exponent) - power}`);
}

function powerOf(value) {
  return value ? Number(value.toExponential().split("e")[1]) : 0;
}

function trimmed(words) {
  return words.includes(".") ? words.replace(/0+$/, "").replace(/\.$/, "") : words;
}

export function superscript(power) {
  return [...String(power)].map((sign) => POWERS[sign]).join("");
}

const PREFIXES = { 9: "G", 6: "M", 3: "k", 0: "", "-3": "m", "-6": "µ", "-9": "n", "-12": "p" };

/** A unit in which the largest value is from 1 to below 1000, as the figures choose it. */
export function scaleOf(largest, unit) {
  if (!(Number.isFinite(largest) && largest > 0) || !/^[Nm]/.test(unit)) return { factor: 1, unit };
  let power = 3 * Math.floor(Math.log10(largest * (1 + 1e-9)) / 3);
  if (unit.startsWith("m")) power = Math.min(power, 0);
  if (power in PREFIXES) return { factor: 10 ** -power, unit: PREFIXES[power] + unit };
  return { factor: 10 ** -power, unit: `10${superscript(power)} ${unit}` };
}

/** Of 1, with as many digits as its distance from all needs, rounded down: what is not all never looks so. */
export function percent(part) {
  if (!Number.isFinite(part)) return "–";
  const rest = Number((100 * (1 - part)).toFixed(9));
  const digits = rest <= 0 ? 0 : Math.min(Math.max(1 - Math.floor(Math.log10(rest)), 0), 4);
  return `${(Math.floor(100 * part * 10 ** digits + 1e-6) / 10 ** digits).toFixed(digits)} %`;
}

/** A time in the unit that fits it: "6.3 µs". */
export function duration(seconds) {
  if (!Number.isFinite(seconds)) return "–";
  const scale = scaleOf(seconds, "m");
  return seconds === 0 ? "0 s" : `${rounded(seconds * scale.factor, 2)} ${scale.unit.slice(0, -1)}s`;
}
