// The layout of the page as a small object: in the address, and saved on the server.
import { errorOf, isDerived } from "./data/derived.js";
import { isAxis } from "./drawing/pane.js";
import { ask } from "./server.js";

const AFTER_MS = 300;

export function taken(scope, runner, drawer, xy, robot) {
  const { trigger, panes, view, mode, ruler } = scope;
  return {
    runner, mode: mode === "recording" ? "roll" : mode, drawer, span: Number((mode === "roll" ? view.span : scope.rollSpan ?? 10).toPrecision(4)),
    ruler, panes: panes.map(paneTaken), trigger: trigger.settings, xy: { ...xy.chosen, equal: xy.isEqual }, ...(robot.isOpen && { robot: true }),
  };
}

// Only the settings that differ from the default.
function paneTaken(pane) {
  const traces = pane.traces.map(({ name, axis, own }) => (axis || own.set ? { name, ...(axis && { axis }), ...(own.set && { scale: own.set }) } : name));
  const weight = Number(pane.weight.toPrecision(3));
  return { traces, ...(pane.scale && { scale: pane.scale }), ...(pane.right.set && { right: pane.right.set }), ...(weight !== 1 && { height: weight }) };
}

// The trigger settings of a layout, and their types.
const TRIGGER = { signal: "string", kind: "string", slope: "string", condition: "string", low: "number", high: "number",
  hysteresis: "number", window: "number", position: "number", holdoff: "number", single: "boolean", auto: "boolean" };

// The panes of a layout, without invalid derived signals; `wrong` gets their errors.
function panesOf(layout, wrong) {
  return layout.panes.slice(0, 12).map((pane) => {
    const { traces, scale, right, height } = pane ?? {};
    const found = new Map(); // by name, because a pane shows a signal once
    for (const each of Array.isArray(traces) ? traces : []) {
      const trace = typeof each === "string" ? { name: each } : each ?? {};
      if (typeof trace.name !== "string") continue;
      const error = isDerived(trace.name) ? errorOf(trace.name) : "";
      if (error) wrong.push(error); else if (!found.has(trace.name)) found.set(trace.name, trace);
    }
    return { traces: [...found.values()], scale: rangeOf(scale), right: rangeOf(right), height: height > 0.05 && height < 20 ? height : 1 };
  });
}

function rangeOf(range) {
  const { low, high } = range ?? {};
  return Number.isFinite(low) && Number.isFinite(high) && low < high ? { low, high } : null;
}

// Shows a layout; returns one line with the omitted parts, or an empty text.
export function given(scope, layout) {
  const wrong = [];
  if (Array.isArray(layout.panes) && layout.panes.length) {
    while (scope.panes.length > 1) scope.removePane(scope.panes.at(-1));
    const [first] = scope.panes;
    for (const { name } of [...first.traces]) first.remove(name);
    panesOf(layout, wrong).forEach(({ traces, scale, right, height }, i) => {
      const pane = i ? scope.addPane() : first;
      for (const { name, axis, scale: own } of traces) pane.add(name, isAxis(axis) ? axis : undefined).own.set = rangeOf(own);
      pane.left.set = scale;
      pane.right.set = right;
      pane.weigh(height);
    });
    scope.activate(scope.panes[0]);
  }
  if (layout.span > 0 && Number.isFinite(layout.span)) scope.view.span = scope.rollSpan = layout.span;
  for (const [name, type] of Object.entries(TRIGGER)) {
    const value = layout.trigger?.[name];
    if (typeof value === type && (type !== "number" || Number.isFinite(value))) scope.trigger.settings[name] = value;
  }
  scope.setRuler(layout.ruler);
  scope.onTraces();
  scope.changed();
  return wrong.length ? `left out: ${wrong.join("; ")}` : "";
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
