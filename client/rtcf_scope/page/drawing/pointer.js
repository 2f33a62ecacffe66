// The mouse on a pane: the wheel zooms, dragging pans, a click sets a cursor, and the values at the
// pointer are shown. Two fingers zoom.
import { LEFT, TOP } from "./values.js";

const DRAG = 4; // pixels; a longer movement is a drag, not a click

export function bindPointer(pane, scope) {
  const { face } = pane;
  let held = null;
  const fingers = new Map(); // by id: place, CSS pixels
  const apart = () => { const [one, other] = [...fingers.values()]; return Math.max(Math.abs(one - other), 1); };
  const pinch = (event) => {
    const before = apart();
    fingers.set(event.pointerId, place(event).x);
    const [one, other] = [...fingers.values()];
    scope.view.zoom(before / apart(), pane.timeAt((one + other) / 2));
    scope.changed();
  };
  const place = ({ clientX, clientY }) => {
    const { left, top } = face.getBoundingClientRect();
    return { x: clientX - left, y: clientY - top };
  };
  const isBeside = (x) => x < pane.area.left || x > pane.area.left + pane.area.width;
  face.addEventListener("wheel", (event) => {
    event.preventDefault();
    const { x, y } = place(event);
    const factor = Math.exp(Math.sign(event.deltaY) * Math.min(Math.abs(event.deltaY), 200) / 400);
    if (event.shiftKey || isBeside(x)) {
      for (const { scale, sight } of pane.scalesAt(x)) {
        const at = sight.value(y - TOP), { low, high } = scale.shown;
        scale.set = { low: at - (at - low) * factor, high: at + (high - at) * factor };
      }
    } else scope.view.zoom(factor, pane.timeAt(x));
    scope.changed();
  }, { passive: false });
  face.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || event.target.closest("button")) return;
    face.setPointerCapture(event.pointerId);
    if (event.pointerType === "touch") fingers.set(event.pointerId, place(event).x);
    if (fingers.size > 1) { held = null; return; }
    scope.activate(pane);
    const { x, y } = place(event);
    const near = (time) => time !== null && Math.abs(pane.timeAt(x) - time) < scope.view.span / pane.area.width * 6;
    const { a, b } = scope.cursors;
    held = { x, y, end: scope.view.end, cursor: near(a) ? "a" : near(b) ? "b" : "", moved: false,
      second: event.altKey ? scope.recordings[1] : undefined, shift: scope.recordings[1]?.shift ?? 0,
      scales: pane.scalesAt(x).filter(({ scale }) => scale.set).map((each) => ({ ...each, set: each.scale.set })) };
  });
  face.addEventListener("pointermove", (event) => {
    if (fingers.size === 2 && fingers.has(event.pointerId)) { pinch(event); return; }
    const { x, y } = place(event);
    if (event.pointerType === "mouse") {
      if (isBeside(x)) scope.pointAt(null); else scope.pointAt(pane, x - LEFT, y - TOP);
    }
    if (!held) return;
    const dx = x - held.x, dy = y - held.y, seconds = dx / pane.area.width * scope.view.span;
    held.moved ||= Math.hypot(dx, dy) > DRAG;
    if (!held.moved) return;
    if (held.second) scope.shiftSecond(held.shift + seconds);
    else if (held.cursor) scope.cursors[held.cursor] = pane.timeAt(x);
    else {
      scope.freeze();
      scope.view.end = held.end - seconds;
      for (const { scale, sight, set } of held.scales) {
        const by = dy * sight.ratio / (sight.bottom - sight.top) * (set.high - set.low);
        scale.set = { low: set.low + by, high: set.high + by };
      }
    }
    scope.changed();
  });
  face.addEventListener("pointerup", (event) => {
    if (held && !held.moved) scope.setCursor(event.shiftKey ? "b" : "a", pane.timeAt(place(event).x));
    held = null;
  });
  face.addEventListener("pointercancel", () => { held = null; });
  for (const end of ["pointerup", "pointercancel"]) face.addEventListener(end, ({ pointerId }) => fingers.delete(pointerId));
  face.addEventListener("pointerleave", () => scope.pointAt(null));
  face.addEventListener("dblclick", (event) => {
    if (event.target.closest("button")) return;
    pane.refit();
    scope.clearCursors();
  });
}
