// One trace over another, of the time in sight: a phase portrait, a hysteresis, a path.
import { tickText, ticks } from "../drawing/axes.js";
import { blank } from "../drawing/canvas.js";
import { colour, ink } from "../drawing/palette.js";

const AREA = { left: 64, top: 8, right: 12, bottom: 22 };
const MOST = 20_000; // points

export class XY {
  constructor(scope, box) {
    this.scope = scope;
    this.box = box;
    this.chosen = { x: "", y: "" };
    const head = document.createElement("p");
    head.className = "says";
    this.selects = ["x", "y"].map((axis) => {
      const select = document.createElement("select");
      select.setAttribute("aria-label", `${axis} axis`);
      select.onchange = () => { this.chosen[axis] = select.value; this.show(); };
      head.append(axis === "x" ? "x " : " y ", select);
      return select;
    });
    this.canvas = document.createElement("canvas");
    box.append(head, this.canvas);
  }

  show() {
    const { scope, chosen } = this;
    const traces = scope.traces();
    ["x", "y"].forEach((axis, i) => {
      const names = traces.map((each) => each.name);
      if (!names.includes(chosen[axis])) chosen[axis] = names[Math.min(i, names.length - 1)] ?? "";
      const select = this.selects[i];
      if ([...select.options].map((each) => each.value).join("\n") !== names.join("\n"))
        select.replaceChildren(...names.map((name) => new Option(name)));
      select.value = chosen[axis];
    });
    const { g, width, height } = blank(this.canvas);
    const area = { left: AREA.left, top: AREA.top, width: width - AREA.left - AREA.right, height: height - AREA.top - AREA.bottom };
    const curves = scope.sources().map((store) => points(store, chosen, scope.view)).filter((each) => each.length);
    if (!curves.length) {
      g.fillStyle = ink("soft");
      g.fillText("nothing to draw: choose two signals", area.left, 30);
      return;
    }
    const x = axis(curves, 0, area.left, area.width), y = axis(curves, 1, area.top + area.height, -area.height);
    this.#axes(g, area, x, y);
    const trace = traces.find((each) => each.name === chosen.y);
    curves.forEach((curve, second) => {
      g.strokeStyle = colour(trace.number);
      g.globalAlpha = second ? 0.45 : 1;
      g.lineWidth = 1.3;
      g.beginPath();
      let pen = false;
      for (const [a, b] of curve) {
        if (!isFinite(a) || !isFinite(b)) { pen = false; continue; }
        if (pen) g.lineTo(x.at(a), y.at(b)); else g.moveTo(x.at(a), y.at(b));
        pen = true;
      }
      g.stroke();
      // The newest.
      const [a, b] = curve.at(-1);
      g.globalAlpha = 1;
      g.fillStyle = colour(trace.number);
      g.beginPath();
      g.arc(x.at(a), y.at(b), 3.5, 0, 7);
      g.fill();
    });
  }

  #axes(g, area, x, y) {
    g.strokeStyle = ink("grid");
    g.fillStyle = ink("soft");
    g.beginPath();
    g.textAlign = "right";
    const rows = ticks(y.low, y.high, Math.max(2, area.height / 35)), columns = ticks(x.low, x.high, Math.max(2, area.width / 110));
    for (const value of rows.at) {
      const place = Math.round(y.at(value)) + 0.5;
      g.moveTo(area.left, place); g.lineTo(area.left + area.width, place);
      g.fillText(tickText(value, rows.step), area.left - 6, place + 4);
    }
    g.textAlign = "center";
    for (const value of columns.at) {
      const place = Math.round(x.at(value)) + 0.5;
      g.moveTo(place, area.top); g.lineTo(place, area.top + area.height);
      g.fillText(tickText(value, columns.step), place, area.top + area.height + 15);
    }
    g.stroke();
    g.textAlign = "left";
    g.strokeStyle = ink("axis");
    g.strokeRect(area.left + 0.5, area.top + 0.5, area.width, area.height);
  }
}

function points(store, { x, y }, view) {
  const a = store.column(x), b = store.column(y);
  if (store.empty || !a || !b) return [];
  const first = store.find(view.begin), last = Math.min(store.find(view.end) + 1, store.end);
  const every = Math.max(1, Math.ceil((last - first) / MOST));
  const found = [];
  for (let at = first; at < last; at += every) found.push([a.get(at), b.get(at)]);
  return found;
}

// The scale of one axis: from the smallest to the largest value, with some room.
function axis(curves, which, begin, length) {
  let low = Infinity, high = -Infinity;
  for (const curve of curves)
    for (const point of curve) {
      if (point[which] < low) low = point[which];
      if (point[which] > high) high = point[which];
    }
  if (!(low <= high)) { low = -1; high = 1; }
  const room = (high - low || Math.abs(high) || 1) * 0.05;
  low -= room; high += room;
  return { low, high, at: (value) => begin + (value - low) / (high - low) * length };
}
