// What a stretch of a trace is, in figures.
const MOST = 400_000; // values

// The values of a column between two times, those that are no numbers left out.
export function values(store, column, begin, end) {
  const first = store.find(begin), last = Math.min(store.find(end), store.end);
  const every = Math.max(1, Math.ceil((last - first) / MOST));
  const found = { times: [], values: [], every };
  for (let at = first; at < last; at += every) {
    const value = column.get(at);
    if (isFinite(value)) { found.times.push(store.time(at)); found.values.push(value); }
  }
  return found;
}

export function measured(store, column, begin, end) {
  const { times, values: found } = values(store, column, begin, end);
  if (!found.length) return null;
  let sum = 0, squares = 0, min = Infinity, max = -Infinity;
  for (const value of found) {
    sum += value; squares += value * value;
    if (value < min) min = value;
    if (value > max) max = value;
  }
  const mean = sum / found.length;
  return { min, max, mean, rms: Math.sqrt(squares / found.length), span: max - min,
    frequency: frequency(times, found, min, max), ...step(times, found) };
}

// Of what crosses the middle of its range upwards, with a band that noise does not cross twice.
export function frequency(times, found, min, max) {
  const middle = (min + max) / 2, band = (max - min) * 0.1;
  if (!(band > 0)) return NaN;
  let armed = false, first = NaN, last = NaN, count = 0;
  for (let i = 1; i < found.length; i++) {
    if (found[i] < middle - band) armed = true;
    if (armed && found[i] >= middle) {
      // Between two cycles, where the line crosses.
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

// Rise from 10 to 90 %, overshoot in %, settling into 2 %: of a step from where it begins to where
// it ends.  Of what does not end where it stays there is none.
export function step(times, found) {
  const none = { rise: NaN, overshoot: NaN, settling: NaN };
  const edge = Math.max(1, Math.floor(found.length / 20));
  const mean = (part) => part.reduce((a, b) => a + b, 0) / part.length;
  const from = mean(found.slice(0, edge)), tail = found.slice(-2 * edge), to = mean(tail);
  const size = to - from;
  if (found.length < 10 || size === 0 || tail.some((value) => Math.abs(value - to) > Math.abs(size) * 0.05)) return none;
  const part = found.map((value) => (value - from) / size);
  if (part.slice(0, edge).some((value) => Math.abs(value) > 0.05)) return none;
  const low = part.findIndex((value) => value >= 0.1), high = part.findIndex((value) => value >= 0.9);
  let settled = part.length - 1;
  while (settled > 0 && Math.abs(part[settled - 1] - 1) <= 0.02) settled--;
  return { rise: times[high] - times[low], overshoot: Math.max(0, Math.max(...sparse(part)) - 1) * 100,
    settling: times[settled] - times[low] };
}

// Not more than can be handed to Math.max.
function sparse(part) {
  const found = [];
  for (let i = 0; i < part.length; i += 1000) {
    let most = -Infinity;
    for (let j = i; j < Math.min(i + 1000, part.length); j++) most = Math.max(most, part[j]);
    found.push(most);
  }
  return found;
}
