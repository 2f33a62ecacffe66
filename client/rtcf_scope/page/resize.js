// Bars between parts of the page that can be dragged, or moved by the arrow keys: the list at the
// left, the drawer below, and panes among each other. Double click: as it was.
const STEP = 16; // pixels of a key

// A bar that gives `box` a size; `axis` is "x" or "y", `sign` 1 if dragging right or down makes it larger.
export function sizes(bar, { axis, sign, size, set, reset }) {
  bar.tabIndex = 0;
  bar.setAttribute("role", "separator");
  bar.setAttribute("aria-orientation", axis === "x" ? "vertical" : "horizontal");
  let held = null;
  bar.addEventListener("pointerdown", (event) => {
    bar.setPointerCapture(event.pointerId);
    held = { from: axis === "x" ? event.clientX : event.clientY, size: size() };
    event.preventDefault();
  });
  bar.addEventListener("pointermove", (event) => {
    if (held) set(held.size + sign * ((axis === "x" ? event.clientX : event.clientY) - held.from));
  });
  for (const end of ["pointerup", "pointercancel"]) bar.addEventListener(end, () => { held = null; });
  bar.addEventListener("dblclick", reset);
  bar.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -1, ArrowDown: 1 }[event.key];
    if (!by || (axis === "x") !== /Left|Right/.test(event.key)) return;
    set(size() + sign * by * STEP);
    event.preventDefault();
    event.stopPropagation();
  });
}

// A size of the page that is remembered in this browser, as a property of its style.
export function remembered(property, least, most) {
  const root = document.documentElement;
  const set = (pixels) => {
    const text = `${Math.round(Math.min(Math.max(pixels, least), most()))}px`;
    root.style.setProperty(property, text);
    localStorage.setItem(property, text);
  };
  const there = parseFloat(localStorage.getItem(property));
  if (isFinite(there)) set(there);
  return { set, reset: () => { root.style.removeProperty(property); localStorage.removeItem(property); } };
}
