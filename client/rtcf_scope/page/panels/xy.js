// One trace over another, for the visible cycles: a phase portrait, a hysteresis, a path.
import { tickTexts, ticks } from "../drawing/axes.js";
import { blank } from "../drawing/canvas.js";
import { colour, ink } from "../drawing/palette.js";
import { Throttle } from "./throttle.js";

const AREA = { left: 64, top: 8, right: 12, bottom: 22 };
const MOST = 40_000; // points of a curve
const BREAK = Symbol("break");

export class XY {
  constructor(scope, box) {
    this.scope = scope;
    this.chosen = { x: "", y: "" };
    this.isEqual = false; // one scale for both axes
    this.throttle = new Throttle();
    this.canvas = box.querySelector("canvas");
    this.says = box.querySelector("output");
    this.selects = Object.fromEntries(["x", "y"].map((axis) => {
      const select = box.querySelector(`[name=${axis}]`);
      select.onchange = () => { this.chosen[axis] = select.value; this.#again(); };
      return [axis, select];
    }));
    box.querySelector("[name=swap]").onclick = () => { this.chosen = { x: this.chosen.y, y: this.chosen.x }; this.#again(); };
    this.equal = box.querySelector("[name=equal]");
    this.equal.onchange = () => { this.isEqual = this.equal.checked; this.#again(); };
  }

  // Applies the settings of a layout.
  take({ x, y, equal } = {}) {
    this.chosen = { x: typeof x === "string" ? x : "", y: typeof y === "string" ? y : "" };
    this.isEqual = equal === true;
  }

  #again() {
    this.throttle = new Throttle();
    this.show();
    this.scope.onLayout();
  }

  show() { this.throttle.run(() => this.#show()); }

  #show() {
    const { scope, chosen, says } = this, traces = scope.traces(), names = traces.map((each) => each.name);
    for (const [i, axis] of ["x", "y"].entries()) {
      if (!names.includes(chosen[axis])) chosen[axis] = names[Math.min(i, names.length - 1)] ?? "";
      const select = this.selects[axis];
      if ([...select.options].map((each) => each.value).join("\n") !== names.join("\n")) select.replaceChildren(...names.map((name) => new Option(name)));
      select.value = chosen[axis];
    }
    this.equal.checked = this.isEqual;
    const { g, width, height } = blank(this.canvas);
    const curves = scope.sources().map((store) => pointsOf(store, chosen, scope.view)).filter(({ points }) => points.some((each) => each !== BREAK));
    const every = Math.max(...curves.map((each) => each.every), 1);
    says.textContent = every > 1 ? `one of ${every} cycles is drawn` : "";
    if (!curves.length) {
      g.fillStyle = ink("soft");
      g.fillText("nothing to draw: show two signals, and choose them here", AREA.left, 30);
      return;
    }
    const area = { left: AREA.left, top: AREA.top, width: Math.max(width - AREA.left - AREA.right, 10), height: Math.max(height - AREA.top - AREA.bottom, 10) };
    const x = rangeOf(curves, 0), y = rangeOf(curves, 1);
    if (this.isEqual) equalise(x, y, area);
    const places = { x: (value) => area.left + (value - x.low) / (x.high - x.low) * area.width,
      y: (value) => area.top + (y.high - value) / (y.high - y.low) * area.height };
    this.#axes(g, area, x, y, places);
    const number = traces.find((each) => each.name === chosen.y)?.number ?? 0;
    curves.forEach(({ points }, second) => this.#curve(g, points, places, colour(number), second > 0));
  }

  #curve(g, points, { x, y }, tone, isSecond) {
    g.strokeStyle = g.fillStyle = tone;
    g.globalAlpha = isSecond ? 0.45 : 1;
    g.lineWidth = 1.3;
    g.lineJoin = "round";
    g.beginPath();
    let isDown = false, newest = null;
    for (const point of points) {
      if (point === BREAK) { isDown = false; continue; }
      if (isDown) g.lineTo(x(point[0]), y(point[1])); else g.moveTo(x(point[0]), y(point[1]));
      isDown = true;
      newest = point;
    }
    g.stroke();
    g.beginPath();
    g.arc(x(newest[0]), y(newest[1]), 4, 0, 7);
    g.fill();
    g.globalAlpha = 1;
  }

  #axes(g, area, x, y, places) {
    const { scope, chosen } = this;
    const rows = ticks(y.low, y.high, Math.max(2, area.height / 40)), columns = ticks(x.low, x.high, Math.max(2, area.width / 110));
    g.strokeStyle = ink("grid");
    g.fillStyle = ink("soft");
    g.beginPath();
    const sides = [tickTexts(rows.at, rows.step), tickTexts(columns.at, columns.step)];
    const below = [sides[1].note, scope.unit(chosen.x)].filter(Boolean).join(" "), room = below ? g.measureText(below).width + 30 : 0;
    g.textAlign = "right";
    rows.at.forEach((value, i) => {
      const place = Math.round(places.y(value)) + 0.5;
      g.moveTo(area.left, place);
      g.lineTo(area.left + area.width, place);
      g.fillText(sides[0].texts[i], area.left - 6, place + 4);
    });
    g.textAlign = "center";
    columns.at.forEach((value, i) => {
      const place = Math.round(places.x(value)) + 0.5;
      g.moveTo(place, area.top);
      g.lineTo(place, area.top + area.height);
      if (place < area.left + area.width - room) g.fillText(sides[1].texts[i], place, area.top + area.height + 15);
    });
    g.stroke();
    g.textAlign = "right";
    g.fillText(below, area.left + area.width, area.top + area.height + 15);
    g.textAlign = "left";
    g.fillText([sides[0].note, scope.unit(chosen.y)].filter(Boolean).join(" "), area.left + 4, area.top + 12);
    g.strokeStyle = ink("axis");
    g.strokeRect(area.left + 0.5, area.top + 0.5, area.width, area.height);
  }
}

// Returns the pairs of values of the visible cycles; BREAK if one of them is not a number.
function pointsOf(store, { x, y }, view) {
  const points = [], one = store.column(x), other = store.column(y);
  if (store.empty || !one || !other) return { points, every: 1 };
  const first = store.find(view.begin), last = Math.min(store.find(view.end) + 1, store.end);
  const every = Math.max(1, Math.ceil((last - first) / MOST));
  for (let at = first; at < last; at += every) {
    const a = one.get(at), b = other.get(at);
    points.push(a - a === 0 && b - b === 0 ? [a, b] : BREAK);
  }
  return { points, every };
}

// From the smallest to the largest value, with some room.
function rangeOf(curves, which) {
  let low = Infinity, high = -Infinity;
  for (const { points } of curves)
    for (const point of points) {
      if (point === BREAK) continue;
      if (point[which] < low) low = point[which];
      if (point[which] > high) high = point[which];
    }
  const room = (high - low || Math.abs(high) || 1) * 0.05;
  return { low: low - room, high: high + room };
}

// Widens one of two ranges so that a unit is as long in both directions.
function equalise(x, y, { width, height }) {
  const unit = Math.max((x.high - x.low) / width, (y.high - y.low) / height);
  for (const [range, length] of [[x, width], [y, height]]) {
    const more = (unit * length - (range.high - range.low)) / 2;
    range.low -= more;
    range.high += more;
  }
}
