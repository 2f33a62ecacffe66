// Numbers for people, and where an axis has its ticks.
const PREFIXES = [[1e9, "G"], [1e6, "M"], [1e3, "k"], [1, ""], [1e-3, "m"], [1e-6, "µ"], [1e-9, "n"]];

// The steps of 1, 2 and 5 that divide a range into about `wanted`.
export function ticks(low, high, wanted) {
  const raw = (high - low) / Math.max(wanted, 1);
  if (!(raw > 0) || !isFinite(raw)) return { step: 1, at: [] };
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = power * [1, 2, 5, 10].find((each) => each * power >= raw * 0.999);
  const at = [];
  for (let n = Math.ceil(low / step - 1e-9); n * step <= high + step * 1e-9; n++) at.push(n * step);
  return { step, at };
}

// A tick, with as many digits as its step has.
export function tickText(value, step) {
  const digits = Math.min(Math.max(-Math.floor(Math.log10(step) + 1e-9), 0), 9);
  if (Math.abs(value) >= 1e6 || step < 1e-6) return value.toExponential(2);
  return (Math.abs(value) < step * 1e-6 ? 0 : value).toFixed(digits);
}

// A measured value: four digits that matter.
export function figure(value, unit = "") {
  if (value === undefined || value === null || Number.isNaN(value)) return "–";
  if (!isFinite(value)) return value > 0 ? "∞" : "−∞";
  const size = Math.abs(value);
  const text = size !== 0 && (size >= 1e6 || size < 1e-4) ? value.toExponential(3)
    : String(Number(value.toPrecision(5)));
  return text.replace("-", "−") + (unit ? " " + unit : "");
}

// A number of seconds or hertz, with a prefix.
export function scaled(value, unit) {
  if (value === undefined || value === null || !isFinite(value)) return "–";
  if (value === 0) return `0 ${unit}`;
  const [size, prefix] = PREFIXES.find(([each]) => Math.abs(value) >= each * 0.9999) ?? PREFIXES.at(-1);
  return `${Number((value / size).toPrecision(4))} ${prefix}${unit}`.replace("-", "−");
}
