// Bars between parts of the page that can be dragged, or moved by the arrow keys: beside the list,
// above the drawer, and between panes. A double click restores the size.
const STEP = 16; // pixels per key press
const LEAST_PANE = 60; // pixels

// `axis` is "x" or "y"; `sign` is 1 if dragging right or down increases the size, else -1.
function dragged(bar, { axis, sign, size, set, reset }) {
  bar.tabIndex = 0;
  bar.setAttribute("role", "separator");
  bar.setAttribute("aria-orientation", axis === "x" ? "vertical" : "horizontal");
  bar.title = "drag to resize; a double click restores the size";
  const place = (event) => (axis === "x" ? event.clientX : event.clientY);
  let held = null;
  bar.addEventListener("pointerdown", (event) => {
    bar.setPointerCapture(event.pointerId);
    held = { from: place(event), size: size() };
    event.preventDefault();
  });
  bar.addEventListener("pointermove", (event) => { if (held) set(held.size + sign * (place(event) - held.from)); });
  for (const end of ["pointerup", "pointercancel"]) bar.addEventListener(end, () => { held = null; });
  bar.addEventListener("dblclick", reset);
  bar.addEventListener("keydown", (event) => {
    const by = { x: { ArrowLeft: -1, ArrowRight: 1 }, y: { ArrowUp: -1, ArrowDown: 1 } }[axis][event.key];
    if (!by) return;
    set(size() + sign * by * STEP);
    event.preventDefault();
    event.stopPropagation();
  });
}

// A bar that resizes a part of the page. The browser stores the size, a property of the page's style.
export function sizesPart(bar, property, { axis, sign, size, least, most }) {
  const root = document.documentElement;
  const set = (pixels) => {
    const text = `${Math.round(Math.min(Math.max(pixels, least), most()))}px`;
    root.style.setProperty(property, text);
    try { localStorage.setItem(property, text); } catch { /* only this page has the size */ }
  };
  const reset = () => {
    root.style.removeProperty(property);
    try { localStorage.removeItem(property); } catch { /* likewise */ }
  };
  let kept = NaN;
  try { kept = parseFloat(localStorage.getItem(property)); } catch { /* nothing is kept */ }
  if (isFinite(kept)) set(kept);
  dragged(bar, { axis, sign, size, set, reset });
}

// A bar between a pane and the one above. It changes their heights and keeps the sum.
export function sizesPanes(bar, pane, scope) {
  const above = () => scope.panes[scope.panes.indexOf(pane) - 1];
  const heights = () => scope.panes.map((each) => each.box.getBoundingClientRect().height);
  dragged(bar, {
    axis: "y", sign: 1,
    size: () => above()?.box.getBoundingClientRect().height ?? 0,
    set: (pixels) => {
      const found = heights(), number = scope.panes.indexOf(pane);
      if (number < 1) return;
      const both = found[number - 1] + found[number], least = Math.min(LEAST_PANE, both / 2);
      found[number - 1] = Math.min(Math.max(pixels, least), both - least);
      found[number] = both - found[number - 1];
      const mean = found.reduce((sum, each) => sum + each, 0) / found.length;
      scope.panes.forEach((each, i) => each.weigh(found[i] / mean));
      scope.changed();
    },
    reset: () => {
      for (const each of scope.panes) each.weigh(1);
      scope.changed();
    },
  });
}
