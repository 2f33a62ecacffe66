// Measurements of a part of a trace.
const MOST = 400_000; // values

// The values of a column between two times, without those that are not numbers. The next call reuses
// the arrays.
let times = new Float64Array(0), numbers = new Float64Array(0);

export function values(store, column, begin, end) {
  const first = store.find(begin), last = Math.min(store.find(end), store.end);
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

export function measured(store, column, begin, end) {
  const { times, values: found } = values(store, column, begin, end);
  if (!found.length) return null;
  // The extremes of all values, even if there are more than MOST.
  const [min, max] = column.range(store.find(begin), Math.min(store.find(end), store.end));
  let sum = 0, squares = 0;
  for (let i = 0; i < found.length; i++) { sum += found[i]; squares += found[i] * found[i]; }
  return { min, max, mean: sum / found.length, rms: Math.sqrt(squares / found.length), span: max - min,
    frequency: frequency(times, found, min, max), ...step(times, found) };
}

// Frequency of upward crossings of the middle of the range. The hysteresis band rejects noise.
export function frequency(times, found, min, max) {
  const middle = (min + max) / 2, band = (max - min) * 0.1;
  if (!(band > 0)) return NaN;
  let armed = false, first = NaN, last = NaN, count = 0;
  for (let i = 1; i < found.length; i++) {
    if (found[i] < middle - band) armed = true;
    if (armed && found[i] >= middle) {
      // Interpolate the crossing between two cycles.
      const part = (middle - found[i - 1]) / (found[i] - found[i - 1]);
      const at = times[i - 1] + (times[i] - times[i - 1]) * (isFinite(part) ? Math.min(Math.max(part, 0), 1) : 1);
      if (count === 0) first = at;
      last = at;
      count++;
      armed = false;
    }
  }
  return count > 1 ? (count - 1) / (last - first) : NaN;
}

// Rise time from 10 to 90 %, overshoot in % and settling time to 2 % of a step from its first to its
// last level. A signal that does not settle, or returns to its first level, is not a step. The settling
// time needs a last stay within 2 % of at least a tenth of the signal, and twice as long as each earlier one.
export function step(times, found) {
  const none = { rise: NaN, overshoot: NaN, settling: NaN };
  const count = found.length, edge = Math.max(1, Math.floor(count / 20)), tail = count - 2 * edge;
  if (count < 10) return none;
  const from = mean(found, 0, edge), to = mean(found, tail, count), size = to - from;
  if (size === 0) return none;
  // A piece of a ramp is not a step, because its end is not constant.
  if (Math.abs(mean(found, tail, tail + edge) - mean(found, tail + edge, count)) > Math.abs(size) * 0.015) return none;
  for (let i = tail; i < count; i++) if (Math.abs(found[i] - to) > Math.abs(size) * 0.05) return none;
  for (let i = 0; i < edge; i++) if (Math.abs(found[i] - from) > Math.abs(size) * 0.05) return none;
  let low = -1, high = -1, most = -Infinity, settled = 0, longest = 0;
  for (let i = 0; i < count; i++) {
    const part = (found[i] - from) / size;
    if (low < 0 && part >= 0.1) low = i;
    if (high < 0 && part >= 0.9) high = i;
    if (high >= 0 && part <= 0.1) return none;
    if (part > most) most = part;
    if (Math.abs(part - 1) > 0.02) {
      if (i > settled) longest = Math.max(longest, times[i] - times[settled]);
      settled = i + 1;
    }
  }
  const stay = settled < count ? times[count - 1] - times[settled] : 0;
  const settles = stay > 0 && stay >= Math.max((times[count - 1] - times[0]) / 10, 2 * longest);
  return { rise: times[high] - times[low], overshoot: Math.max(0, most - 1) * 100,
    settling: settles ? times[settled] - times[low] : NaN };
}

function mean(found, begin, end) {
  let sum = 0;
  for (let i = begin; i < end; i++) sum += found[i];
  return sum / (end - begin);
}
