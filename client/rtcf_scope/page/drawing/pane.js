// One pane: a canvas with axes, its traces, marks and cursors, and a legend.
import { figure, scaled, tickText, ticks } from "./axes.js";
import { drawMark, drawTrace } from "./draw.js";
import { colour, dash, ink } from "./palette.js";

const LEFT = 64, RIGHT = 12, TOP = 8, BOTTOM = 22;
const FONT = "11px system-ui, sans-serif";

export class Pane {
  constructor(scope) {
    this.scope = scope;
    this.traces = []; // {name, number}: the number gives the colour
    this.scale = null; // {low, high}, or null: as the values need
    this.shown = { low: -1, high: 1 };
    this.box = document.createElement("div");
    this.box.className = "pane";
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("role", "img");
    this.legend = document.createElement("div");
    this.legend.className = "legend";
    this.box.append(this.canvas, this.legend);
    this.g = this.canvas.getContext("2d");
  }

  add(name) {
    const used = new Set(this.scope.traces().map((each) => each.number));
    let number = 0;
    while (used.has(number)) number++;
    this.traces.push({ name, number });
    this.describe();
  }

  remove(name) {
    this.traces = this.traces.filter((each) => each.name !== name);
    if (!this.traces.length) this.scale = null;
    this.describe();
  }

  has(name) { return this.traces.some((each) => each.name === name); }

  // The legend: made anew when traces change, its values by `tell`.
  describe() {
    this.legend.replaceChildren(...this.traces.map((trace) => {
      const chip = document.createElement("span");
      chip.className = "chip";
      const line = document.createElement("i");
      line.style.borderTop = `3px ${trace.number < 8 ? "solid" : trace.number < 16 ? "dashed" : "dotted"} ${colour(trace.number)}`;
      const name = document.createElement("span");
      name.textContent = trace.name;
      name.title = trace.name;
      trace.value = document.createElement("b");
      const close = document.createElement("button");
      close.textContent = "×";
      close.title = `take ${trace.name} away`;
      close.onclick = () => this.scope.toggle(trace.name, this);
      chip.append(line, name, trace.value, close);
      return chip;
    }));
    if (!this.traces.length) {
      const hint = document.createElement("span");
      hint.className = "hint";
      hint.textContent = "empty pane: choose signals at the left (they go to the pane with the bar)";
      this.legend.append(hint);
    }
    this.canvas.setAttribute("aria-label", `traces ${this.traces.map((each) => each.name).join(", ")}`);
  }

  tell() {
    const store = this.scope.sources()[0];
    const at = this.scope.cursors.a === null ? store.end - 1 : store.nearest(this.scope.cursors.a);
    for (const trace of this.traces) {
      const column = store.column(trace.name);
      const value = column && at >= store.begin ? column.get(at) : NaN;
      trace.value.textContent = figure(value, this.scope.unit(trace.name));
    }
  }

  get area() {
    const { clientWidth, clientHeight } = this.canvas;
    return { left: LEFT, top: TOP, width: Math.max(clientWidth - LEFT - RIGHT, 10),
      height: Math.max(clientHeight - TOP - BOTTOM, 10) };
  }

  timeAt(x) {
    const { view } = this.scope;
    return view.begin + (x - LEFT) / this.area.width * view.span;
  }

  valueAt(y) {
    const { top, height } = this.area;
    return this.shown.high - (y - top) / height * (this.shown.high - this.shown.low);
  }

  // What the values in sight need, rounded to ticks so that it stands still.
  #fit() {
    if (this.scale) return this.scale;
    const { view } = this.scope;
    let low = Infinity, high = -Infinity;
    for (const store of this.scope.sources())
      for (const { name } of this.traces) {
        const column = store.column(name);
        if (!column || store.empty) continue;
        const [least, most] = column.range(store.find(view.begin), Math.min(store.find(view.end) + 1, store.end));
        // Infinity is no scale.
        if (isFinite(least)) low = Math.min(low, least);
        if (isFinite(most)) high = Math.max(high, most);
      }
    if (low > high) return this.shown;
    if (high - low < 1e-12 * Math.max(1, Math.abs(high))) { low -= 0.5 || 1; high += 0.5; }
    const { step } = ticks(low, high, 4);
    const pad = (high - low) * 0.04;
    return { low: Math.floor((low - pad) / step * 2) * step / 2, high: Math.ceil((high + pad) / step * 2) * step / 2 };
  }

  draw() {
    const { canvas, g } = this;
    const ratio = window.devicePixelRatio || 1;
    const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
    if (!width || !height) return;
    if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.paint(g, canvas.clientWidth, canvas.clientHeight);
  }

  paint(g, width, height) {
    const { view, cursors } = this.scope;
    const area = { left: LEFT, top: TOP, width: width - LEFT - RIGHT, height: height - TOP - BOTTOM };
    this.shown = this.#fit();
    const { low, high } = this.shown;
    const y = (value) => area.top + (high - Math.min(Math.max(value, low - 1e3 * (high - low)), high + 1e3 * (high - low))) / (high - low) * area.height;
    const x = (time) => area.left + (time - view.begin) / view.span * area.width;
    g.fillStyle = ink("paper");
    g.fillRect(0, 0, width, height);
    g.font = FONT;
    this.#axes(g, area, x, y);
    g.save();
    g.beginPath();
    g.rect(area.left, area.top, area.width, area.height);
    g.clip();
    for (const mark of this.scope.marks()) drawMark(g, area, x(mark.time), ink(mark.ink), "", true);
    this.scope.sources().forEach((store, second) => {
      if (store.empty) return;
      for (const { name, number } of this.traces) {
        const column = store.column(name);
        if (column)
          drawTrace(g, store, column, view, area, y, { colour: colour(number), alpha: second ? 0.55 : 1,
            width: second ? 1 : 1.5, dash: second ? [5, 4] : dash(number) });
      }
    });
    this.#trigger(g, area, x, y);
    for (const [name, time] of [["A", cursors.a], ["B", cursors.b]])
      if (time !== null) drawMark(g, area, x(time), ink("cursor"), name, false);
    g.restore();
  }

  #axes(g, area, x, y) {
    const { view } = this.scope;
    const { low, high } = this.shown;
    const rows = ticks(low, high, Math.max(2, area.height / 45));
    const columns = ticks(view.begin, view.end, Math.max(2, area.width / 110));
    g.lineWidth = 1;
    g.strokeStyle = ink("grid");
    g.beginPath();
    for (const value of rows.at) {
      const place = Math.round(y(value)) + 0.5;
      g.moveTo(area.left, place); g.lineTo(area.left + area.width, place);
    }
    for (const time of columns.at) {
      const place = Math.round(x(time)) + 0.5;
      g.moveTo(place, area.top); g.lineTo(place, area.top + area.height);
    }
    g.stroke();
    g.strokeStyle = ink("axis");
    g.strokeRect(area.left + 0.5, area.top + 0.5, area.width, area.height);
    g.fillStyle = ink("soft");
    g.textAlign = "right";
    for (const value of rows.at) g.fillText(tickText(value, rows.step), area.left - 6, Math.min(Math.max(y(value) + 4, area.top + 8), area.top + area.height));
    g.textAlign = "center";
    for (const time of columns.at) {
      const place = x(time);
      if (place > area.left + 14 && place < area.left + area.width - 40) g.fillText(tickText(time, columns.step), place, area.top + area.height + 15);
    }
    g.textAlign = "right";
    g.fillText("s", area.left + area.width, area.top + area.height + 15);
    const units = [...new Set(this.traces.map(({ name }) => this.scope.unit(name)).filter(Boolean))].join(", ");
    g.save();
    g.translate(13, area.top + area.height / 2);
    g.rotate(-Math.PI / 2);
    g.textAlign = "center";
    g.fillText(units, 0, 0);
    g.restore();
    g.textAlign = "left";
  }

  // The levels of the trigger, where its signal is, and the place of its hit.
  #trigger(g, area, x, y) {
    const { trigger } = this.scope;
    if (this.scope.mode !== "trigger") return;
    if (this.scope.shot) drawMark(g, area, x(0), ink("hit"), this.traces.length ? "trigger" : "", true);
    if (!this.has(trigger.told.signal) || !["edge", "level", "window"].includes(trigger.told.kind)) return;
    g.strokeStyle = ink("hit");
    g.setLineDash([8, 4]);
    for (const level of trigger.told.kind === "window" ? [trigger.told.low, trigger.told.high] : [trigger.told.low]) {
      g.beginPath();
      g.moveTo(area.left, y(level)); g.lineTo(area.left + area.width, y(level));
      g.stroke();
    }
    g.setLineDash([]);
  }
}

export const span = (seconds) => scaled(seconds, "s");
