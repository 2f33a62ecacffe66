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

// What a layout may say of a trigger.
const TRIGGER = { signal: "string", kind: "string", slope: "string", condition: "string", low: "number", high: "number",
  window: "number", position: "number", holdoff: "number", single: "boolean" };

// The panes' traces by name; a signal is in the first pane that has it.
function panesOf(layout) {
  const seen = new Set();
  return layout.panes.slice(0, 12).map((pane) => {
    const { traces, scale } = pane ?? {};
    const names = (Array.isArray(traces) ? traces : []).filter((name) => typeof name === "string");
    const own = names.filter((name) => !seen.has(name) && seen.add(name));
    return { traces: own, scale, asked: names.length };
  }).filter(({ traces, asked }) => traces.length || !asked);
}

export function given(scope, layout) {
  if (Array.isArray(layout.panes) && layout.panes.length) {
    while (scope.panes.length > 1) scope.removePane(scope.panes.at(-1));
    const [first] = scope.panes;
    for (const { name } of [...first.traces]) first.remove(name);
    panesOf(layout).forEach(({ traces, scale }, i) => {
      const pane = i ? scope.addPane() : first;
      for (const name of traces) pane.add(name);
      pane.scale = Number.isFinite(scale?.low) && Number.isFinite(scale.high) && scale.low < scale.high ? { low: scale.low, high: scale.high } : null;
    });
    scope.activate(scope.panes[0]);
  }
  if (layout.span > 0 && Number.isFinite(layout.span)) scope.view.span = scope.rollSpan = layout.span;
  for (const [name, type] of Object.entries(TRIGGER)) {
    const value = layout.trigger?.[name];
    if (typeof value === type && (type !== "number" || Number.isFinite(value))) scope.trigger.told[name] = value;
  }
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
