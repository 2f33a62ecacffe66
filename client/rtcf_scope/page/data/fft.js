// The amplitude spectrum of evenly spaced values, with Hann's window.
const MOST = 1 << 16; // values, the newest ones
const FINER = 2; // minimum factor of zero padding

// `amplitudes[i]` is the amplitude at the frequency `i * step`; sines closer than `resolution` form one peak.
export function spectrum(values, rate) {
  const count = Math.min(values.length, MOST), first = values.length - count;
  if (count < 16) return null;
  let size = 32;
  while (size < count * FINER) size *= 2;
  const real = new Float64Array(size), imaginary = new Float64Array(size);
  let mean = 0;
  for (let i = 0; i < count; i++) mean += values[first + i] / count;
  for (let i = 0; i < count; i++) real[i] = (values[first + i] - mean) * (0.5 - 0.5 * Math.cos(2 * Math.PI * i / count));
  transform(real, imaginary);
  const amplitudes = new Float64Array(size / 2);
  // The window halves the amplitude.
  for (let i = 0; i < size / 2; i++) amplitudes[i] = Math.sqrt(real[i] * real[i] + imaginary[i] * imaginary[i]) * 4 / count;
  return { amplitudes, step: rate / size, resolution: rate / count };
}

// Returns the peak whose highest point is `at`: the vertex of the parabola through the logarithms of
// this point and its neighbours, which approximates a peak of Hann's window.
export function peak({ amplitudes, step }, at) {
  const [before, top, after] = [at - 1, at, at + 1].map((each) => Math.log(Math.max(amplitudes[each] ?? 0, 1e-300)));
  const bend = before - 2 * top + after;
  const by = bend < 0 ? Math.min(Math.max((before - after) / bend / 2, -0.5), 0.5) : 0;
  return { frequency: (at + by) * step, amplitude: Math.exp(top - (before - after) * by / 4) };
}

// Returns the highest point, without those near 0 Hz, which remain of the mean.
export function highest({ amplitudes, step, resolution }) {
  let found = Math.min(Math.ceil(resolution / step), amplitudes.length - 1);
  for (let i = found + 1; i < amplitudes.length; i++) if (amplitudes[i] > amplitudes[found]) found = i;
  return found;
}

// Cooley and Tukey, in place; the length is a power of two.
export function transform(real, imaginary) {
  const size = real.length, half = size / 2;
  for (let i = 1, j = 0; i < size; i++) {
    let bit = size >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) {
      const r = real[i], m = imaginary[i];
      real[i] = real[j]; imaginary[i] = imaginary[j];
      real[j] = r; imaginary[j] = m;
    }
  }
  const { cos, sin } = turns(size);
  for (let length = 2; length <= size; length *= 2) {
    const wide = length / 2, stride = half / wide;
    for (let begin = 0; begin < size; begin += length)
      for (let i = 0; i < wide; i++) {
        const at = begin + i, to = at + wide, c = cos[i * stride], s = sin[i * stride];
        const r = real[to] * c - imaginary[to] * s, m = real[to] * s + imaginary[to] * c;
        real[to] = real[at] - r; imaginary[to] = imaginary[at] - m;
        real[at] += r; imaginary[at] += m;
      }
  }
}

let known = { size: 0 };

function turns(size) {
  if (known.size === size) return known;
  const cos = new Float64Array(size / 2), sin = new Float64Array(size / 2);
  for (let i = 0; i < size / 2; i++) {
    cos[i] = Math.cos(-2 * Math.PI * i / size);
    sin[i] = Math.sin(-2 * Math.PI * i / size);
  }
  return known = { size, cos, sin };
}
