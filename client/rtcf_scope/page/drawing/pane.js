// One pane: its traces and their scale, a plot of them with axes, marks and cursors, and a legend.
import { figure, tickText, ticks } from "./axes.js";
import { drawMark, Marks } from "./marks.js";
import { colour, ink, isInSymbol, symbol } from "./palette.js";
import { drawColumns, newsOf } from "./picture.js";
import { Raster } from "./raster.js";
import { Sight } from "./sight.js";
import { Tiles } from "./tiles.js";
import { labelled, Times } from "./times.js";
import { drawValues, FONT, LEFT, TOP, Values } from "./values.js";

const RIGHT = 12, BOTTOM = 22;
const SHRINKS = 0.6; // a scale of which the values need less is fitted again

export class Pane {
  constructor(scope) {
    this.scope = scope;
    this.traces = []; // {name, number}: the number gives the colour
    this.scale = null; // {low, high}, or null: as the values need
    this.shown = { low: -1, high: 1 };
    this.content = ""; // another one when the traces are
    this.size = { width: 0, height: 0 }; // of the plot
    this.box = element("div", "pane");
    this.face = element("div", "face"); // where the mouse is heard
    this.face.setAttribute("role", "img");
    this.plot = element("div", "plot");
    this.values = new Values();
    this.tiles = new Tiles(this.plot);
    this.marks = new Marks(this.tiles.strip);
    this.cursors = new Marks(this.tiles.strip);
    this.levels = element("div", "levels");
    this.plot.append(this.levels);
    const below = element("div", "times");
    this.times = new Times(below);
    this.face.append(this.values.canvas, this.plot, below);
    this.legend = element("div", "legend");
    this.box.append(this.face, this.legend);
    new ResizeObserver(([{ contentRect: { width, height } }]) => {
      this.size = { width, height };
      scope.dirty = true;
    }).observe(this.plot);
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
    this.content = this.traces.map((each) => `${each.name} ${each.number}`).join("\n");
    this.legend.replaceChildren(...this.traces.map((trace) => {
      const chip = element("span", "chip");
      const name = element("span", "");
      name.textContent = trace.name;
      name.title = trace.name;
      trace.value = element("b", "");
      trace.room = 0; // characters
      const close = element("button", "");
      close.textContent = "×";
      close.title = `take ${trace.name} away`;
      close.onclick = () => this.scope.toggle(trace.name, this);
      chip.append(sample(trace.number), name, trace.value, close);
      return chip;
    }));
    if (!this.traces.length) {
      const hint = element("span", "hint");
      hint.textContent = "empty pane: choose signals at the left (they go to the pane with the bar)";
      this.legend.append(hint);
    }
    this.face.setAttribute("aria-label", `traces ${this.traces.map((each) => each.name).join(", ")}`);
  }

  // The values at cursor A, at the hit of a trigger, or the newest ones.
  tell() {
    const { scope } = this, { a } = scope.cursors;
    const store = scope.sources()[0];
    const at = a === null ? scope.readAt : store.nearest(a);
    for (const trace of this.traces) {
      const column = store.column(trace.name), isThere = column && at >= store.begin;
      const text = isThere && column.isOdd(at) && Number.isNaN(column.get(at)) ? "NaN"
        : figure(isThere ? column.get(at) : NaN, scope.unit(trace.name));
      if (trace.value.textContent === text) continue;
      trace.value.textContent = text;
      // Room that is taken once is kept: a legend whose lines break anew moves the plot.
      if (text.length > trace.room) { trace.room = text.length; trace.value.style.minWidth = `${text.length}ch`; }
    }
  }

  // Of the plot in the face, in CSS pixels.
  get area() { return { left: LEFT, top: TOP, width: Math.max(this.size.width, 10), height: Math.max(this.size.height, 10) }; }

  timeAt(x) {
    const { view } = this.scope;
    return view.begin + (x - LEFT) / this.area.width * view.span;
  }

  valueAt(y) { return this.shown.high - (y - TOP) / this.area.height * (this.shown.high - this.shown.low); }

  // What the values in sight need, rounded to ticks; it stays as it is while it is about right.
  #fit() {
    if (this.scale) return this.scale;
    const { view } = this.scope;
    let low = Infinity, high = -Infinity;
    for (const store of this.scope.sources()) {
      if (store.empty) continue;
      const begin = store.find(view.begin), end = Math.min(store.find(view.end) + 1, store.end);
      for (const { name } of this.traces) {
        const column = store.column(name);
        if (!column) continue;
        column.scan(begin, end);
        low = Math.min(low, column.low);
        high = Math.max(high, column.high);
      }
    }
    if (low > high) return this.shown;
    if (high - low < 1e-12 * Math.max(1, Math.abs(high))) { low -= 0.5 || 1; high += 0.5; }
    const { step } = ticks(low, high, 4), pad = (high - low) * 0.04, { shown } = this;
    const fitted = { low: Math.floor((low - pad) / step * 2) * step / 2, high: Math.ceil((high + pad) / step * 2) * step / 2 };
    const isRoomy = low >= shown.low && high <= shown.high && fitted.high - fitted.low >= SHRINKS * (shown.high - shown.low);
    return isRoomy && this.fittedTo === this.content ? shown : (this.fittedTo = this.content, fitted);
  }

  // The scale is fitted anew, closely.
  refit() { this.scale = null; this.fittedTo = null; }

  draw() {
    const { scope, traces } = this, { width, height } = this.size;
    if (!(width > 0 && height > 0)) return;
    const sources = scope.sources();
    this.shown = this.#fit();
    const sight = this.sight = new Sight(scope.view, this.shown, width, height, window.devicePixelRatio || 1);
    const key = [sight.seconds, sight.height, sight.ratio, sight.low, sight.high, document.documentElement.dataset.theme,
      ...sources.map((each) => each.serial), this.content].join(" ");
    this.tiles.show(sight, key, newsOf(sight, sources, traces), (raster, base, from, to) => drawColumns(raster, sight, base, from, to, sources, traces));
    this.times.show(sight);
    this.values.show(sight, this.#units());
    const { a, b } = scope.cursors;
    this.marks.show(sight, scope.marks(), scope.marksNumber, scope.panes[0] === this);
    this.cursors.show(sight, cursorMarks(a, b), `${a} ${b}`, true);
    this.#levels(sight);
  }

  #units() { return [...new Set(this.traces.map(({ name }) => this.scope.unit(name)).filter(Boolean))].join(", "); }

  // The values that the trigger compares with, where its signal is.
  #thresholds() {
    const { trigger: { told }, mode } = this.scope;
    if (mode !== "trigger" || !this.has(told.signal) || !["edge", "level", "window"].includes(told.kind)) return [];
    return told.kind === "window" ? [told.low, told.high] : [told.low];
  }

  #levels(sight) {
    const thresholds = this.#thresholds();
    if (!thresholds.length && !this.levels.firstChild) return;
    const lines = thresholds.map((level) => ({ level, y: Math.round(sight.y(level)) })).filter(({ y }) => y >= 0 && y <= this.size.height);
    const state = JSON.stringify(lines);
    if (state === this.levelsState) return;
    this.levelsState = state;
    this.levels.replaceChildren(...lines.map(({ level, y }) => {
      const line = element("div", "level");
      line.style.top = `${y}px`;
      const text = element("span", "");
      text.textContent = `level ${figure(level)}`;
      line.append(text);
      return line;
    }));
  }

  // The same as a picture to keep, `ratio` pixels in one of CSS.
  paint(g, width, height, ratio) {
    const { scope } = this, area = { left: LEFT, top: TOP, width: width - LEFT - RIGHT, height: height - TOP - BOTTOM };
    const sight = new Sight(scope.view, this.shown, area.width, area.height, ratio);
    const raster = new Raster(sight.width, sight.height), canvas = element("canvas", "");
    canvas.width = sight.width;
    canvas.height = sight.height;
    drawColumns(raster, sight, sight.first, 0, sight.width, scope.sources(), this.traces);
    canvas.getContext("2d").putImageData(raster.image, 0, 0);
    g.fillStyle = ink("paper");
    g.fillRect(0, 0, width, height);
    drawValues(g, sight, this.#units());
    g.drawImage(canvas, area.left, area.top, area.width, area.height);
    g.strokeStyle = ink("axis");
    g.lineWidth = 1;
    g.strokeRect(area.left - 0.5, area.top - 0.5, area.width + 1, area.height + 1);
    g.font = FONT;
    g.fillStyle = ink("soft");
    g.textAlign = "center";
    for (const n of labelled(sight)) g.fillText(tickText(n * sight.step, sight.step), area.left + sight.x(n * sight.step), area.top + area.height + 15);
    g.textAlign = "right";
    g.fillText("s", area.left + area.width, area.top + area.height + 15);
    g.textAlign = "left";
    const { a, b } = scope.cursors, paper = ink("paper");
    for (const mark of scope.marks()) drawMark(g, area, sight.x(mark.time), ink(mark.ink), paper, scope.panes[0] === this ? mark.label : "");
    for (const mark of cursorMarks(a, b)) drawMark(g, area, sight.x(mark.time), ink(mark.ink), paper, mark.label);
    g.fillStyle = ink("hit");
    for (const level of this.#thresholds()) {
      if (level < sight.low || level > sight.high) continue;
      g.fillRect(area.left, area.top + Math.round(sight.y(level)), area.width, 1);
      g.fillText(`level ${figure(level)}`, area.left + 4, area.top + Math.round(sight.y(level)) - 3);
    }
  }
}

function cursorMarks(a, b) {
  return [{ time: a, label: "A" }, { time: b, label: "B" }].filter(({ time }) => time !== null)
    .map((each) => ({ ...each, ink: "cursor" })).sort((one, other) => one.time - other.time);
}

// A piece of a line as the plot has it.
function sample(number) {
  const wide = 20, high = 10, ratio = 2, canvas = element("canvas", "sample");
  canvas.width = wide * ratio;
  canvas.height = high * ratio;
  const g = canvas.getContext("2d"), name = symbol(number);
  g.fillStyle = colour(number);
  g.fillRect(0, high - 3, wide * ratio, 6);
  const half = 8;
  if (name)
    for (let y = 0; y < high * ratio; y++)
      for (let x = 0; x < wide * ratio; x++) {
        const dx = x + 0.5 - wide, dy = y + 0.5 - high;
        if (isInSymbol(name, dx / half, dy / half)) g.fillRect(x, y, 1, 1);
        else if (isInSymbol(name, dx / (half + 2), dy / (half + 2))) g.clearRect(x, y, 1, 1);
      }
  return canvas;
}

function element(name, kind) {
  const made = document.createElement(name);
  if (kind) made.className = kind;
  return made;
}
