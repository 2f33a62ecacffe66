// The mouse on a pane: wheel zooms, dragging pans, a click sets a cursor.
const DRAG = 4; // pixels that make a click a drag

export function minded(pane, scope) {
  const { canvas } = pane;
  let held = null;
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const factor = Math.exp(Math.sign(event.deltaY) * Math.min(Math.abs(event.deltaY), 200) / 400);
    if (event.shiftKey || event.offsetX < pane.area.left) {
      const at = pane.valueAt(event.offsetY), { low, high } = pane.shown;
      pane.scale = { low: at - (at - low) * factor, high: at + (high - at) * factor };
    } else scope.view.zoom(factor, pane.timeAt(event.offsetX));
    scope.changed();
  }, { passive: false });
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    canvas.setPointerCapture(event.pointerId);
    scope.activate(pane);
    const near = (time) => time !== null && Math.abs(pane.timeAt(event.offsetX) - time) < scope.view.span / pane.area.width * 6;
    const { a, b } = scope.cursors;
    held = { x: event.clientX, y: event.clientY, end: scope.view.end, shown: { ...pane.shown },
      scale: pane.scale, cursor: near(a) ? "a" : near(b) ? "b" : "", moved: false };
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!held) return;
    const dx = event.clientX - held.x, dy = event.clientY - held.y;
    held.moved ||= Math.hypot(dx, dy) > DRAG;
    if (!held.moved) return;
    if (held.cursor) scope.cursors[held.cursor] = pane.timeAt(event.offsetX);
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
  canvas.addEventListener("pointerup", (event) => {
    if (held && !held.moved) {
      scope.setCursor(event.shiftKey ? "b" : "a", pane.timeAt(event.offsetX));
    }
    held = null;
  });
  canvas.addEventListener("pointercancel", () => { held = null; });
  canvas.addEventListener("dblclick", () => { pane.scale = null; scope.clearCursors(); });
}
