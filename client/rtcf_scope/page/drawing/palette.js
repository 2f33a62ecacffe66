// The colour-blind safe colours of Okabe and Ito, adapted to a dark and a light background. From the
// ninth trace on, symbols on the line distinguish traces of one colour.
const DARK = ["#56b4e9", "#e69f00", "#2fd0a0", "#f0e442", "#e58cc0", "#ff7f45", "#8fa8ff", "#d9d9d9"];
const LIGHT = ["#0072b2", "#c05000", "#00805c", "#8a7400", "#b0478a", "#9c2f00", "#3d4fc4", "#404040"];
const SYMBOLS = ["", "square", "diamond", "triangle"];

export const isDark = () => document.documentElement.dataset.theme === "dark";

export function colour(number) { return (isDark() ? DARK : LIGHT)[number % 8]; }
export function symbol(number) { return SYMBOLS[Math.floor(number / 8) % SYMBOLS.length]; }

// Returns whether a point is in a symbol; x and y are relative to its centre, in units of half its size.
export function isInSymbol(name, x, y) {
  if (name === "diamond") return Math.abs(x) + Math.abs(y) <= 1.2;
  if (name === "triangle") return y <= 0.8 && y >= -1 + 2 * Math.abs(x) - 0.2;
  return Math.abs(x) <= 0.9 && Math.abs(y) <= 0.9;
}

// A colour of the style sheet, for canvases.
const known = new Map();
export function ink(name) {
  const key = document.documentElement.dataset.theme + name;
  if (!known.has(key))
    known.set(key, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
  return known.get(key);
}

// A colour as a pixel of an image, opaque.
const pixels = new Map();
export function pixel(text) {
  if (!pixels.has(text)) {
    const digits = text.slice(1);
    const [red, green, blue] = (digits.length === 3 ? [...digits].map((each) => each + each) : digits.match(/../g)).map((each) => parseInt(each, 16));
    pixels.set(text, (0xff000000 | (blue << 16) | (green << 8) | red) >>> 0);
  }
  return pixels.get(text);
}
