// Okabe and Ito's colours, which colour-blind people tell apart, made to stand out from either
// ground. Beyond eight, dashes tell what colours cannot.
const DARK = ["#56b4e9", "#e69f00", "#2fd0a0", "#f0e442", "#e58cc0", "#ff7f45", "#8fa8ff", "#d9d9d9"];
const LIGHT = ["#0072b2", "#c05000", "#00805c", "#8a7400", "#b0478a", "#9c2f00", "#3d4fc4", "#404040"];
const DASHES = [[], [7, 3], [2, 3], [9, 3, 2, 3]];

export const isDark = () => document.documentElement.dataset.theme === "dark";

export function colour(number) { return (isDark() ? DARK : LIGHT)[number % 8]; }
export function dash(number) { return DASHES[Math.floor(number / 8) % DASHES.length]; }

// A colour of the style sheet, for canvases.
const known = new Map();
export function ink(name) {
  const key = document.documentElement.dataset.theme + name;
  if (!known.has(key))
    known.set(key, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
  return known.get(key);
}
