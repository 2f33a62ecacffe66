// Exports the visible part as a PNG file, a table, or a recording.
import { colour, ink } from "./drawing/palette.js";
import { query, request } from "./server.js";

function download(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

// Prints the panes and the measurements below a line that says what they show.
export function toReport(scope, runner) {
  const { origin, view, mode } = scope, box = document.getElementById("report");
  const what = mode === "recording" ? scope.recordings.map((each) => each.name).join(" and ") : runner;
  const begin = origin === null ? "" : new Date(Number(origin / 1_000_000n) + view.begin * 1e3).toLocaleString();
  const title = Object.assign(document.createElement("b"), { textContent: `rtcf scope: ${what}` });
  box.replaceChildren(title, document.createElement("br"), `${begin}, ${Number(view.span.toPrecision(4))} s`);
  scope.freeze();
  requestAnimationFrame(() => requestAnimationFrame(() => window.print()));
}

export function toPng(scope) {
  const ratio = 2, head = 22;
  const sizes = scope.panes.map((pane) => [pane.face.clientWidth, pane.face.clientHeight]);
  const width = Math.max(...sizes.map(([each]) => each)), height = sizes.reduce((sum, [, each]) => sum + each + head, 0);
  const canvas = document.createElement("canvas");
  canvas.width = width * ratio; canvas.height = height * ratio;
  const g = canvas.getContext("2d");
  g.scale(ratio, ratio);
  g.fillStyle = ink("paper");
  g.fillRect(0, 0, width, height);
  let top = 0;
  scope.panes.forEach((pane, i) => {
    g.save();
    g.translate(0, top + head);
    pane.paint(g, ...sizes[i], ratio);
    g.restore();
    let left = 64;
    for (const { name, number } of pane.traces) {
      g.fillStyle = colour(number);
      g.fillText(`— ${name}`, left, top + 15);
      left += g.measureText(`— ${name}`).width + 16;
    }
    top += sizes[i][1] + head;
  });
  canvas.toBlob((blob) => download(blob, "scope.png"));
}

export function csv(scope) {
  const { a, b } = scope.cursors, { store, view } = scope;
  const both = a !== null && b !== null;
  const first = store.find(both ? Math.min(a, b) : view.begin), last = Math.min(store.find(both ? Math.max(a, b) : view.end) + 1, store.end);
  const names = scope.traces().map((each) => each.name);
  const quoted = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  const lines = [["cycle", "time [s]", ...names.map((name) => quoted(name + (scope.unit(name) ? ` [${scope.unit(name)}]` : "")))].join(",")];
  const columns = names.map((name) => store.column(name));
  for (let at = first; at < last; at++) {
    if (Number.isNaN(store.cycle(at))) continue;
    lines.push([store.cycle(at), store.time(at), ...columns.map((each) => (each ? each.get(at) : NaN))].join(","));
  }
  return lines.join("\n") + "\n";
}

export function toCsv(scope) { download(new Blob([csv(scope)], { type: "text/csv" }), "scope.csv"); }

export async function toMcap(scope, runner) {
  const { store, view } = scope;
  if (scope.mode === "recording") throw new Error("this is a recording already");
  const first = store.cycle(Math.min(store.find(view.begin), store.end - 1)), last = store.cycle(Math.min(store.find(view.end), store.end - 1));
  const response = await request(`/api/mcap?${query({ runner, first, last })}`);
  download(await response.blob(), `${runner}.mcap`);
}
