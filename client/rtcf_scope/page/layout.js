// What is shown and how, as a small object: in the address, and saved on the server.
import { ask } from "./server.js";

const AFTER_MS = 300;

export function taken(scope, runner, drawer) {
  const { trigger, panes, view, mode } = scope;
  return {
    runner, mode: mode === "recording" ? "roll" : mode, drawer, span: Number((mode === "roll" ? view.span : scope.rollSpan ?? 10).toPrecision(4)),
    panes: panes.map((pane) => ({ traces: pane.traces.map((each) => each.name), ...(pane.scale ? { scale: pane.scale } : {}) })),
    trigger: trigger.told,
  };
}

export function given(scope, layout) {
  if (Array.isArray(layout.panes) && layout.panes.length) {
    while (scope.panes.length > 1) scope.removePane(scope.panes.at(-1));
    const [first] = scope.panes;
    for (const { name } of [...first.traces]) first.remove(name);
    layout.panes.slice(0, 12).forEach(({ traces = [], scale }, i) => {
      const pane = i ? scope.addPane() : first;
      for (const name of traces) if (typeof name === "string" && !scope.traces().some((each) => each.name === name)) pane.add(name);
      pane.scale = scale && scale.low < scale.high ? { low: scale.low, high: scale.high } : null;
    });
    scope.activate(scope.panes[0]);
  }
  if (layout.span > 0) scope.view.span = scope.rollSpan = layout.span;
  if (layout.trigger && typeof layout.trigger === "object") Object.assign(scope.trigger.told, layout.trigger);
  scope.onTraces();
  scope.changed();
}

export function ofAddress() {
  try { return JSON.parse(decodeURIComponent(location.hash.slice(1))); } catch { return null; }
}

let timer = null;
export function toAddress(take) {
  timer ??= setTimeout(() => {
    timer = null;
    // Quotes and braces stay readable in most browsers' address bars.
    history.replaceState(null, "", `#${encodeURIComponent(JSON.stringify(take()))}`);
  }, AFTER_MS);
}

export const names = () => ask("/api/layouts");
export const read = (name) => ask(`/api/layouts/${encodeURIComponent(name)}`);
export const save = (name, layout) => ask(`/api/layouts/${encodeURIComponent(name)}`, { method: "PUT", body: JSON.stringify(layout) });
export const remove = (name) => ask(`/api/layouts/${encodeURIComponent(name)}`, { method: "DELETE" });
