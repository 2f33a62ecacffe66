// Texts of numbers, and the ticks of an axis.
const PREFIXES = [[1e9, "G"], [1e6, "M"], [1e3, "k"], [1, ""], [1e-3, "m"], [1e-6, "µ"], [1e-9, "n"]];
const CHARACTERS = 8; // of a tick's text
const THIN = "\u202f"; // a narrow space

// The step of 1, 2 or 5 that divides a range into about `wanted`.
export function tickStep(range, wanted) {
  const raw = range / Math.max(wanted, 1);
  if (!(raw > 0) || !isFinite(raw)) return 0;
  const power = 10 ** Math.floor(Math.log10(raw));
  return power * [1, 2, 5, 10].find((each) => each * power >= raw * 0.999);
}

export function ticks(low, high, wanted) {
  const step = tickStep(high - low, wanted), at = [];
  if (!step) return { step: 1, at };
  // A range below the precision of its numbers has no ticks.
  if (low + step === low || high - step === high) return { step, at };
  for (let n = Math.ceil(low / step - 1e-9); n * step <= high + step * 1e-9; n++) at.push(n * step);
  return { step, at };
}

const digitsOf = (step) => Math.max(-Math.floor(Math.log10(step) + 1e-9), 0);

// The text of a tick, with the digits of its step.
export function tickText(value, step) {
  if (Math.abs(value) < step * 1e-6) value = 0;
  if (Math.abs(value) >= 1e15) return exponential(value, 3);
  return fixed(value, Math.min(digitsOf(step), 12));
}

// Short, distinct texts of ticks. `note` is their common factor or offset.
export function tickTexts(at, step) {
  const most = at.reduce((found, value) => Math.max(found, Math.abs(value)), 0);
  const digits = digitsOf(step);
  const characters = (size, places) => Math.max(Math.floor(Math.log10(size) + 1e-9), 0) + 1 + (places ? places + 1 : 0);
  if (!most) return { texts: at.map(() => "0"), note: "" };
  if (most < 1e6 && characters(most, digits) <= CHARACTERS) return { texts: at.map((value) => grouped(tickText(value, step))), note: "" };
  const power = 3 * Math.floor(Math.log10(most) / 3 + 1e-9), unit = 10 ** power;
  if (characters(most / unit, digitsOf(step / unit)) <= CHARACTERS)
    return { texts: at.map((value) => tickText(value / unit, step / unit)), note: `×10${superscript(power)}` };
  // For long numbers that differ little, show the differences from one of them.
  const coarse = 10 ** Math.ceil(Math.log10(at.at(-1) - at[0] + step) + 1e-9);
  const base = Math.floor(at[0] / coarse + 1e-9) * coarse;
  if (!base) return { texts: at.map((value) => exponential(value, 3)), note: "" };
  const rest = tickTexts(at.map((value) => value - base), step);
  const many = Math.abs(base) >= 1e15 ? exponential(base, 9) : grouped(tickText(base, Math.min(coarse, 1e15)));
  return { texts: rest.texts, note: `${rest.note}${base < 0 ? " − " : " + "}${many.replace("−", "")}`.trim() };
}

// A number with this many digits behind the point, without −0.
export function fixed(value, digits) {
  const text = value.toFixed(digits);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

const exponential = (value, digits) => value.toExponential(digits).replace("e+", "e").replaceAll("-", "−");

const superscript = (power) => String(power).replace(/./g, (each) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(each)]);

// Separates thousands in numbers of at least five digits.
export function grouped(text) {
  const [whole, part] = text.split(".");
  const apart = whole.replace("−", "").length < 5 ? whole : whole.replace(/\B(?=(\d{3})+$)/g, THIN);
  return part === undefined ? apart : `${apart}.${part}`;
}

// A measured value, with five significant digits and all digits before the point; with more digits if it
// differs by `apart` from another one.
export function figure(value, unit = "", apart = NaN) {
  if (value === undefined || value === null || Number.isNaN(value)) return "–";
  if (!isFinite(value)) return value > 0 ? "∞" : "−∞";
  const size = Math.abs(value);
  const digits = apart > 0 && size > apart ? Math.min(Math.max(Math.ceil(Math.log10(size / apart)) + 2, 5), 15) : 5;
  const text = size !== 0 && (size >= 1e12 || size < 1e-4) ? exponential(value, digits - 1)
    : grouped(String(Number(value.toPrecision(size >= 1e4 ? Math.max(digits, Math.floor(Math.log10(size)) + 1) : digits))).replace("-", "−"));
  return text + (unit ? " " + unit : "");
}

// A number of seconds or hertz, with a prefix.
export function scaled(value, unit) {
  if (value === undefined || value === null || !isFinite(value)) return "–";
  if (value === 0) return `0 ${unit}`;
  const [size, prefix] = PREFIXES.find(([each]) => Math.abs(value) >= each * 0.9999) ?? PREFIXES.at(-1);
  return `${Number((value / size).toPrecision(4))} ${prefix}${unit}`.replaceAll("-", "−");
}
