// The mouse on a pane: wheel zooms, dragging pans, a click sets a cursor.
const DRAG = 4; // pixels that make a click a drag

export function minded(pane, scope) {
  const { face } = pane;
  let held = null;
  const place = ({ clientX, clientY }) => {
    const { left, top } = face.getBoundingClientRect();
    return { x: clientX - left, y: clientY - top };
  };
  face.addEventListener("wheel", (event) => {
    event.preventDefault();
    const { x, y } = place(event);
    const factor = Math.exp(Math.sign(event.deltaY) * Math.min(Math.abs(event.deltaY), 200) / 400);
    if (event.shiftKey || x < pane.area.left) {
      const at = pane.valueAt(y), { low, high } = pane.shown;
      pane.scale = { low: at - (at - low) * factor, high: at + (high - at) * factor };
    } else scope.view.zoom(factor, pane.timeAt(x));
    scope.changed();
  }, { passive: false });
  face.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    face.setPointerCapture(event.pointerId);
    scope.activate(pane);
    const { x, y } = place(event);
    const near = (time) => time !== null && Math.abs(pane.timeAt(x) - time) < scope.view.span / pane.area.width * 6;
    const { a, b } = scope.cursors;
    held = { x, y, end: scope.view.end, shown: { ...pane.shown },
      scale: pane.scale, cursor: near(a) ? "a" : near(b) ? "b" : "", moved: false };
  });
  face.addEventListener("pointermove", (event) => {
    if (!held) return;
    const { x, y } = place(event), dx = x - held.x, dy = y - held.y;
    held.moved ||= Math.hypot(dx, dy) > DRAG;
    if (!held.moved) return;
    if (held.cursor) scope.cursors[held.cursor] = pane.timeAt(x);
    else {
      scope.freeze();
      scope.view.end = held.end - dx / pane.area.width * scope.view.span;
      if (held.scale) {
        const by = dy / pane.area.height * (held.shown.high - held.shown.low);
        pane.scale = { low: held.shown.low + by, high: held.shown.high + by };
      }
    }
    scope.changed();
  });
  face.addEventListener("pointerup", (event) => {
    if (held && !held.moved) scope.setCursor(event.shiftKey ? "b" : "a", pane.timeAt(place(event).x));
    held = null;
  });
  face.addEventListener("pointercancel", () => { held = null; });
  face.addEventListener("dblclick", () => { pane.refit(); scope.clearCursors(); });
}
