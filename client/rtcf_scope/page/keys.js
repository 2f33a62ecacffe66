// The actions of keys; `help` lists them.
export const KEYS = [
  ["Space", "freeze, or go on"], ["+ −", "a shorter or a longer time"], ["← →", "back and forth in time"],
  ["End", "the newest again"], ["A", "fit the scales to the values"], ["C", "take the cursors away"],
  ["N", "a new pane"], ["O", "the robot in 3-D, or not"], ["Delete", "take the active pane away"], ["1 … 9", "make a pane the active one"],
  ["X", "seconds, time of day or cycle numbers below the panes"], ["V", "values under the pointer, or not"],
  ["/", "search the signals; Enter: the first one"], ["Drag a signal", "into a pane"], ["T", "roll or triggered"], ["D", "dark or light"], ["?", "this list"],
  ["Wheel", "zoom time; with Shift, or at a scale, values"], ["Drag", "pan; a cursor: move it; with Alt: shift the second recording"],
  ["Two fingers", "zoom time"], ["Drag a bar", "resize panes, list and drawer; double click: as before"],
  ["Click", "cursor A; with Shift B"], ["Double click", "fit the scale, no cursors"],
];

export function bindKeys(scope, does) {
  const keys = {
    " ": () => does.freeze(), "+": () => scope.view.step(-1), "=": () => scope.view.step(-1), "-": () => scope.view.step(1),
    ArrowLeft: () => { scope.freeze(); scope.view.pan(-scope.view.span / 10); },
    ArrowRight: () => { scope.freeze(); scope.view.pan(scope.view.span / 10); },
    End: () => scope.run(), a: () => scope.panes.forEach((pane) => pane.refit()),
    c: () => scope.clearCursors(), n: () => scope.addPane(), o: () => does.robot(), Delete: () => scope.removePane(scope.active),
    x: () => scope.nextRuler(), v: () => does.pointing(), "/": () => does.search(), t: () => does.mode(), d: () => does.theme(), "?": () => does.help(),
  };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.target.closest("input:not([type=range]), select, textarea, dialog")) {
      if (event.key === "Escape") event.target.blur();
      return;
    }
    // Space presses the button that has the focus.
    if (event.key === " " && event.target.closest("button, summary")) return;
    const does_ = /^[1-9]$/.test(event.key) ? () => { const pane = scope.panes[event.key - 1]; if (pane) scope.activate(pane); } : keys[event.key];
    if (!does_) return;
    event.preventDefault();
    does_();
    scope.changed();
  });
}
