// Spectrum of evenly spaced values: Hann's window, amplitudes of the sines it is made of.
const MOST = 1 << 15;

export function spectrum(values, rate) {
  let size = 1;
  while (size * 2 <= Math.min(values.length, MOST)) size *= 2;
  if (size < 16) return null;
  const real = new Float64Array(size), imaginary = new Float64Array(size);
  const newest = values.slice(-size);
  const mean = newest.reduce((a, b) => a + b, 0) / size;
  for (let i = 0; i < size; i++) real[i] = (newest[i] - mean) * (0.5 - 0.5 * Math.cos(2 * Math.PI * i / size));
  transform(real, imaginary);
  const amplitudes = new Float64Array(size / 2);
  // The window takes half of the amplitude.
  for (let i = 0; i < size / 2; i++) amplitudes[i] = Math.hypot(real[i], imaginary[i]) * 4 / size;
  return { amplitudes, step: rate / size };
}

// Cooley and Tukey, in place; the length is a power of two.
export function transform(real, imaginary) {
  const size = real.length;
  for (let i = 1, j = 0; i < size; i++) {
    let bit = size >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) {
      [real[i], real[j]] = [real[j], real[i]];
      [imaginary[i], imaginary[j]] = [imaginary[j], imaginary[i]];
    }
  }
  for (let length = 2; length <= size; length *= 2) {
    const angle = -2 * Math.PI / length, half = length / 2;
    for (let i = 0; i < half; i++) {
      const c = Math.cos(angle * i), s = Math.sin(angle * i);
      for (let at = i; at < size; at += length) {
        const to = at + half;
        const r = real[to] * c - imaginary[to] * s, m = real[to] * s + imaginary[to] * c;
        real[to] = real[at] - r; imaginary[to] = imaginary[at] - m;
        real[at] += r; imaginary[at] += m;
      }
    }
  }
}
