// Measurements of a part of a trace.
import { highest, peak, spectrum, transform } from "./fft.js";

const MOST = 400_000; // values

// The place behind the last cycle that is not after a time.
function behind(store, time) {
  let at = Math.min(store.find(time), store.end);
  while (at < store.end && store.time(at) === time) at++;
  return at;
}

// The values of a column between two times, both included, without those that are not numbers. The next call reuses
// the arrays.
let times = new Float64Array(0), numbers = new Float64Array(0);

export function values(store, column, begin, end) {
  const first = store.find(begin), last = behind(store, end);
  const every = Math.max(1, Math.ceil((last - first) / MOST));
  const most = Math.ceil((last - first) / every);
  if (times.length < most) { times = new Float64Array(most + 1000); numbers = new Float64Array(most + 1000); }
  let count = 0;
  for (let at = first; at < last; at += every) {
    const value = column.get(at);
    if (value - value !== 0) continue;
    times[count] = store.time(at);
    numbers[count++] = value;
  }
  return { times: times.subarray(0, count), values: numbers.subarray(0, count), every };
}

// `given`: see step().
export function measured(store, column, begin, end, given) {
  const { times, values: found } = values(store, column, begin, end);
  if (!found.length) return null;
  // The extremes of all values, even if there are more than MOST.
  const [min, max] = column.range(store.find(begin), behind(store, end));
  let sum = 0, squares = 0;
  for (let i = 0; i < found.length; i++) { sum += found[i]; squares += found[i] * found[i]; }
  return { min, max, mean: sum / found.length, rms: Math.sqrt(squares / found.length), span: max - min,
    frequency: frequency(times, found, min, max), ...step(times, found, given) };
}

// Frequency of a periodic signal; NaN for others, such as noise and constants. The autocorrelation gives
// the period, and without much noise, the first and the last upward crossing of the middle of the range give
// the exact value. `found` has values at even times.
export function frequency(times, found, min, max) {
  if (!(max - min > 1e-9 * Math.max(Math.abs(min), Math.abs(max)))) return NaN;
  const last = found.length - 1, seconds = (times[last] - times[0]) / last;
  // All values, averaged, for slow signals; else the newest ones, for fast signals.
  const every = Math.ceil(found.length / PERIODIC), coarse = averaged(found, every);
  let { length, alike } = every === 1 || power(coarse) > power(found) / 2 ? period(coarse) : { length: NaN };
  if (length > 0) length *= every;
  else if (every > 1) ({ length, alike } = period(found.slice(-PERIODIC)));
  if (!(length > 0)) return NaN;
  const about = 1 / (length * seconds);
  if (alike < CLEAN) return about;
  const [first, end] = crossings(times, found, (min + max) / 2, (max - min) * 0.1);
  const exact = Math.round((end - first) * about) / (end - first);
  return Math.abs(exact / about - 1) < 0.05 ? exact : about;
}

const PERIODIC = 1 << 14; // values
const SHORT = 10; // values of a period of few points, which the spectrum gives more exactly
const CLEAN = 0.9, ALIKE = 0.5; // least correlation of a signal with itself, one period later: without much noise, of any signal

function averaged(found, every) {
  if (every === 1) return found;
  return Float64Array.from({ length: Math.floor(found.length / every) }, (_, i) => mean(found, i * every, (i + 1) * every));
}

// The period of even values, `length` in values: the first of the highest peaks of the autocorrelation, which
// is `alike` there; NaN without such a peak within half of the values.
function period(found) {
  if (found.length < 16) return { length: NaN };
  const alike = autocorrelation(found), end = alike.length - 1;
  let begin = 1;
  while (begin < end && alike[begin] > 0) begin++;
  let most = ALIKE;
  for (let lag = begin; lag < end; lag++) most = Math.max(most, alike[lag]);
  for (let lag = begin; lag < end; lag++) {
    if (!(alike[lag] > ALIKE && alike[lag] >= 0.9 * most)) continue;
    const top = highestOf(alike, lag, 1.3 * lag);
    if (top === end || top === begin) continue;
    return { length: top < SHORT ? 1 / strongest(found) : refined(alike, top), alike: alike[top] };
  }
  return { length: NaN };
}

// A period more exactly, by the peaks 2, 4, 8 … periods later.
function refined(alike, lag) {
  let length = vertex(alike, lag, lag);
  for (let count = 2; (count + 0.5) * length < alike.length - 1; count *= 2)
    length = vertex(alike, highestOf(alike, (count - 0.25) * length, (count + 0.25) * length), length) / count;
  return length;
}

function highestOf(alike, from, to) {
  let top = Math.ceil(from);
  for (let at = top; at <= Math.min(to, alike.length - 1); at++) if (alike[at] > alike[top]) top = at;
  return top;
}

// The vertex of the parabola through a peak and two points beside it, a small part of a period away.
function vertex(alike, at, length) {
  const by = Math.max(1, Math.min(Math.round(length / 16), alike.length - 1 - at));
  const [before, top, after] = [alike[at - by], alike[at], alike[at + by]], bend = before - 2 * top + after;
  return at + (bend < 0 ? Math.min(Math.max((before - after) / bend / 2, -1), 1) * by : 0);
}

function power(found) {
  const middle = mean(found, 0, found.length);
  let sum = 0;
  for (let i = 0; i < found.length; i++) sum += (found[i] - middle) ** 2;
  return sum / found.length;
}

// The frequency of the highest peak of the spectrum, periods per value.
function strongest(found) {
  const of = spectrum(found, 1);
  return peak(of, highest(of)).frequency;
}

// The correlation of values with themselves `lag` values later, for each lag up to half of the values.
function autocorrelation(found) {
  const count = found.length, middle = mean(found, 0, count);
  let size = 32;
  while (size < 2 * count) size *= 2;
  const real = new Float64Array(size), imaginary = new Float64Array(size);
  for (let i = 0; i < count; i++) real[i] = found[i] - middle;
  transform(real, imaginary);
  for (let i = 0; i < size; i++) { real[i] = real[i] * real[i] + imaginary[i] * imaginary[i]; imaginary[i] = 0; }
  transform(real, imaginary);
  const whole = real[0] / count;
  return Float64Array.from({ length: Math.floor(count / 2) + 1 }, (_, lag) => real[lag] / (count - lag) / whole);
}

// Times of the first and the last upward crossing of a level. The hysteresis band rejects noise.
function crossings(times, found, middle, band) {
  let armed = false, first = NaN, last = NaN;
  for (let i = 1; i < found.length; i++) {
    if (found[i] < middle - band) armed = true;
    if (!armed || found[i] < middle) continue;
    // Interpolate the crossing between two cycles.
    const part = (middle - found[i - 1]) / (found[i] - found[i - 1]);
    last = times[i - 1] + (times[i] - times[i - 1]) * (isFinite(part) ? Math.min(Math.max(part, 0), 1) : 1);
    if (Number.isNaN(first)) first = last;
    armed = false;
  }
  return [first, last];
}

// Rise time from 10 to 90 %, s, overshoot, %, and settling time to 2 %, s: those of
// rtcf.testing.step_response. `given` has the level before the step, the target and the time of the step, NaN
// for those to be found: the first and the last level, and when the value leaves the first one. `why` says
// why there is no settling time.
export function step(times, found, given = {}) {
  const { initial = NaN, target = NaN, zero = NaN } = given, count = found.length;
  const none = { rise: NaN, overshoot: NaN, settling: NaN, why: "" };
  if (count < 10) return none;
  const edge = Math.max(1, Math.floor(count / 20));
  const from = isFinite(initial) ? initial : mean(found, 0, edge), to = isFinite(target) ? target : mean(found, count - edge, count);
  const size = to - from;
  if (size === 0 || (!isFinite(initial) && !isFinite(target) && !isStep(found, edge, from, size))) return none;
  const is = isFinite(zero) ? times.findIndex((time) => time >= zero) : left(found, from, size);
  if (is < 0 || count - is < 2) return none;
  return responded(times.slice(is), found.slice(is), isFinite(zero) ? zero : times[is], from, size);
}

// Tells whether a signal goes from its first to its last level: a piece of a ramp does not end at a level,
// and a periodic signal returns.
function isStep(found, edge, from, size) {
  const count = found.length, tail = count - 2 * edge, to = from + size;
  if (Math.abs(mean(found, tail, tail + edge) - mean(found, tail + edge, count)) > Math.abs(size) * 0.015) return false;
  for (let i = tail; i < count; i++) if (Math.abs(found[i] - to) > Math.abs(size) * 0.05) return false;
  for (let i = 0; i < edge; i++) if (Math.abs(found[i] - from) > Math.abs(size) * 0.05) return false;
  let isHigh = false;
  for (const value of found) {
    const share = (value - from) / size;
    isHigh ||= share >= 0.9;
    if (isHigh && share <= 0.1) return false;
  }
  return true;
}

// The last value before the signal leaves its first level for good.
function left(found, from, size) {
  let at = found.findIndex((value) => (value - from) / size >= 0.1);
  while (at > 0 && Math.abs(found[at - 1] - from) > Math.abs(size) * NEAR) at--;
  return Math.max(at - 1, 0);
}

const NEAR = 0.001, WITHIN = 0.02, SHORTEST = 0.1; // of the step, of the step, of the record

// The method of client/rtcf/testing/step.py.
function responded(times, found, zero, from, size) {
  const count = found.length, share = (i) => (found[i] - from) / size, last = times[count - 1] - zero;
  const first = (level) => {
    let i = 0;
    while (i < count && share(i) < level) i++;
    if (i === count) return NaN;
    return i === 0 ? times[0] : times[i - 1] + (level - share(i - 1)) / (share(i) - share(i - 1)) * (times[i] - times[i - 1]);
  };
  let most = -Infinity, begin = -1, earlier = 0;
  for (let i = 0; i < count; i++) {
    most = Math.max(most, share(i));
    const isInside = Math.abs(share(i) - 1) <= WITHIN;
    if (isInside && begin < 0) begin = i;
    if (!isInside && begin >= 0) { earlier = Math.max(earlier, times[i] - times[begin]); begin = -1; }
  }
  const stay = begin < 0 ? 0 : times[count - 1] - times[begin];
  const why = begin < 0 ? "the last value is outside of 2 %" : stay < SHORTEST * last ? `it is within 2 % for the last ${stay.toPrecision(3)} s only: measure for longer`
    : stay < 2 * earlier ? `it leaves the 2 % again: it stays for ${stay.toPrecision(3)} s at the end, and has stayed for ${earlier.toPrecision(3)} s before` : "";
  return { rise: first(0.9) - first(0.1), overshoot: Math.max(0, most - 1) * 100, settling: why ? NaN : times[begin] - zero, why };
}

function mean(found, begin, end) {
  let sum = 0;
  for (let i = begin; i < end; i++) sum += found[i];
  return sum / (end - begin);
}
