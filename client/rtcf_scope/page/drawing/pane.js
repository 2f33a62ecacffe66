// One pane: traces and their scales, a plot with axes, marks and cursors, and a legend.
import { figure } from "./axes.js";
import { drawMark, Marks } from "./marks.js";
import { colour, ink, isInSymbol, symbol } from "./palette.js";
import { drawColumns, changesOf } from "./columns.js";
import { Raster } from "./raster.js";
import { Readout } from "./readout.js";
import { Scale } from "./scale.js";
import { Sight } from "./sight.js";
import { Tiles } from "./tiles.js";
import { labelled, Times } from "./times.js";
import { drawValues, FONT, LEFT, TOP, Values } from "./values.js";
import { isDerived } from "../data/derived.js";

const RIGHT = 12, BOTTOM = 22, MARGIN = 6; // CSS pixels; the right one without an axis, the last one without times
const TRACK = 34, TRACK_ALONE = 72; // maximum height of a track, CSS pixels: below lines, and in a plot without lines
const NAMED = 14; // minimum height of a track with a name, CSS pixels
const TRACKS = 0.5; // maximum share of the tracks in the height of a plot with lines
const AXES = [["left", "left axis"], ["right", "right axis"], ["own", "own scale"], ["track", "track"]];
export const SIGNAL = "application/x-rtcf-signal"; // a name that is dragged
export const isAxis = (name) => AXES.some(([each]) => each === name);

export class Pane {
  constructor(scope) {
    this.scope = scope;
    // {name, number, axis, own}: `number` selects the colour. `axis` is one of AXES; undefined = a track
    // for booleans, the left axis for others. `own` is the scale of a separate axis.
    this.traces = [];
    this.left = new Scale();
    this.right = new Scale();
    this.weight = 1; // share of the height
    this.drawn = []; // {name, number, sight, track} of each trace when it was last drawn
    this.content = ""; // differs for different traces
    this.size = { width: 0, height: 0 }; // of the plot
    this.box = element("div", "pane");
    this.face = element("div", "face"); // receives the mouse events
    this.face.setAttribute("role", "img");
    this.plot = element("div", "plot");
    this.values = new Values("left");
    this.rightValues = new Values("right");
    this.tiles = new Tiles(this.plot);
    this.marks = new Marks(this.tiles.strip);
    this.cursors = new Marks(this.tiles.strip);
    this.levels = element("div", "levels");
    this.names = element("div", "names"); // of the tracks
    this.plot.append(this.levels, this.names);
    const below = element("div", "times");
    this.times = new Times(below, () => scope.nextRuler());
    this.face.append(this.values.canvas, this.plot, this.rightValues.canvas, below);
    this.readout = new Readout(this, scope);
    this.legend = element("div", "legend");
    this.#receive();
    this.bar = element("div", "bar y"); // resizes this pane and the one above
    this.box.append(this.bar, this.face, this.legend);
    new ResizeObserver(([{ contentRect: { width, height } }]) => {
      this.size = { width, height };
      scope.dirty = true;
    }).observe(this.plot);
  }

  // The set range of the left scale; null = fitted.
  get scale() { return this.left.set; }
  set scale(range) { this.left.set = range; }
  get shown() { return this.left.shown; }

  // Shows a signal that is dragged here from the list.
  #receive() {
    const isSignal = ({ dataTransfer }) => dataTransfer.types.includes(SIGNAL);
    this.box.addEventListener("dragover", (event) => {
      if (!isSignal(event)) return;
      event.preventDefault();
      this.box.classList.add("target");
    });
    this.box.addEventListener("dragleave", ({ relatedTarget }) => {
      if (!this.box.contains(relatedTarget)) this.box.classList.remove("target");
    });
    this.box.addEventListener("drop", (event) => {
      this.box.classList.remove("target");
      if (!isSignal(event)) return;
      event.preventDefault();
      this.scope.activate(this);
      const name = event.dataTransfer.getData(SIGNAL);
      if (!this.has(name)) this.scope.toggle(name, this);
    });
  }

  // Sets this pane's share of the height, relative to other panes.
  weigh(weight) {
    this.weight = weight;
    this.box.style.flexGrow = weight;
  }

  add(name, axis) {
    const numbers = this.scope.traces().map((each) => [each.name, each.number]);
    // A signal has one colour in all panes.
    let number = new Map(numbers).get(name);
    if (number === undefined) {
      const used = new Set(numbers.map(([, each]) => each));
      for (number = 0; used.has(number);) number++;
    }
    this.traces.push({ name, number, axis, own: new Scale() });
    this.describe();
    return this.traces.at(-1);
  }

  remove(name) {
    this.traces = this.traces.filter((each) => each.name !== name);
    if (!this.traces.length) { this.left.set = null; this.right.set = null; }
    this.describe();
  }

  has(name) { return this.traces.some((each) => each.name === name); }

  axisOf({ name, axis }) { return axis ?? (this.scope.kinds.get(name) === "bool" ? "track" : "left"); }
  #on(axis) { return this.traces.filter((each) => this.axisOf(each) === axis); }
  #scaleOf(trace) { return { left: this.left, right: this.right }[this.axisOf(trace)] ?? trace.own; }

  // Rebuilds the legend after a change of traces. `update` updates its values.
  describe() {
    this.content = this.#contents();
    this.legend.replaceChildren(...this.traces.map((trace) => this.#chip(trace)));
    if (!this.traces.length) {
      const hint = element("span", "hint");
      hint.textContent = "empty pane: choose signals at the left (they go to the pane with the bar)";
      this.legend.append(hint);
    }
    this.face.setAttribute("aria-label", `traces ${this.traces.map((each) => each.name).join(", ")}`);
    this.scope.arrange();
    this.update();
  }

  #contents() { return this.traces.map((each) => `${each.name} ${each.number} ${this.axisOf(each)}`).join("\n"); }

  #chip(trace) {
    const chip = element("span", "chip");
    const name = element("span", "");
    name.textContent = trace.name;
    name.title = trace.name;
    trace.value = element("b", "");
    trace.room = 0; // characters
    trace.badge = element("small", "badge");
    const close = element("button", "");
    close.textContent = "×";
    close.title = `take ${trace.name} away`;
    close.onclick = () => this.scope.toggle(trace.name, this);
    chip.append(this.#look(trace), name, trace.badge, trace.value, close);
    return chip;
  }

  // A sample of a trace's line; a click on it opens the choice of axes.
  #look(trace) {
    const look = element("span", "look"), select = element("select", "");
    select.setAttribute("aria-label", `axis of ${trace.name}`);
    select.title = `${trace.name}: left or right axis, own scale, or track`;
    select.append(...AXES.map(([axis, text]) => new Option(text, axis)));
    select.value = this.axisOf(trace);
    select.onchange = () => {
      trace.axis = select.value;
      this.describe();
      this.scope.changed();
    };
    look.append(sample(trace.number), select);
    return look;
  }

  // Updates the values (at cursor A, at the hit of a trigger, or the newest), and the scales without an axis.
  update() {
    const { scope } = this, { a } = scope.cursors;
    const store = scope.sources()[0];
    const at = a === null ? scope.readAt : store.nearest(a);
    for (const trace of this.traces) {
      const axis = this.axisOf(trace), { low, high } = trace.own.shown;
      say(trace.badge, axis === "right" ? "right" : axis === "own" ? `${figure(low)} … ${figure(high)}` : "");
      const column = store.column(trace.name), isThere = column && at >= store.begin;
      const text = isThere && column.isOdd(at) && Number.isNaN(column.get(at)) ? "NaN"
        : !store.hasAll && isDerived(trace.name) ? "zoom in" // derived signals need each cycle
          : figure(isThere ? column.get(at) : NaN, scope.unit(trace.name));
      if (trace.value.textContent === text) continue;
      trace.value.textContent = text;
      // The width never shrinks: new line breaks in the legend would move the plot.
      if (text.length > trace.room) { trace.room = text.length; trace.value.style.minWidth = `${text.length}ch`; }
    }
  }

  // The area of the plot in the face, CSS pixels.
  get area() { return { left: LEFT, top: TOP, width: Math.max(this.size.width, 10), height: Math.max(this.size.height, 10) }; }

  timeAt(x) {
    const { view } = this.scope;
    return view.begin + (x - LEFT) / this.area.width * view.span;
  }

  // Fits the scales to the values in sight.
  #fit() {
    const { view } = this.scope;
    const needs = new Map([[this.left, [Infinity, -Infinity]], [this.right, [Infinity, -Infinity]]]);
    for (const store of this.scope.sources()) {
      if (store.empty) continue;
      const begin = store.find(view.begin), end = Math.min(store.find(view.end) + 1, store.end);
      for (const trace of this.traces) {
        const column = store.column(trace.name), scale = this.#scaleOf(trace);
        if (!column || scale.set) continue;
        column.scan(begin, end);
        const [low, high] = needs.get(scale) ?? [Infinity, -Infinity];
        needs.set(scale, [Math.min(low, column.low), Math.max(high, column.high)]);
      }
    }
    for (const [scale, [low, high]] of needs) scale.fit(low, high, this.content);
  }

  // Fits all scales closely to the values in sight.
  refit() { for (const scale of this.#scales()) scale.refit(); }

  #scales() { return [this.left, this.right, ...this.traces.map((each) => each.own)]; }

  // Discards the fitted scales, because other values are shown.
  forget() { for (const scale of this.#scales()) { const { set } = scale; scale.reset(); scale.set = set; } }

  // Returns the scales at a position of the face, each with its sight.
  scalesAt(x) {
    const isOn = (axis) => (trace) => this.axisOf(trace) === axis;
    const side = x < LEFT ? "left" : x > LEFT + this.area.width ? "right" : "";
    const found = new Map();
    const wanted = this.traces.filter((each) => !isOn("track")(each));
    const those = wanted.filter((each) => !side || isOn(side)(each));
    // Beside the plot, where no axis is: all scales.
    for (const trace of those.length ? those : wanted) found.set(this.#scaleOf(trace), this.drawn.find(({ name }) => name === trace.name)?.sight);
    if (!this.traces.length) found.set(this.left, this.sight);
    return [...found].filter(([, sight]) => sight).map(([scale, sight]) => ({ scale, sight }));
  }

  // The arrangement of a plot of this size: the sights of the left axis, the right axis and the traces.
  #arrange(width, height, ratio) {
    const { scope } = this;
    const tracks = this.#on("track"), hasLines = tracks.length < this.traces.length;
    const each = tracks.length && (hasLines ? Math.min(TRACK, height * TRACKS / tracks.length) : Math.min(TRACK_ALONE, height / tracks.length));
    const tall = !tracks.length ? height : hasLines ? height - each * tracks.length : 0;
    const sight = new Sight(scope.view, this.left.shown, width, height, ratio, { ruler: scope.rulerOf(width), tall });
    const right = this.#on("right").length ? sight.within(this.right.shown) : null;
    const hasLeft = !this.traces.length || this.#on("left").length > 0;
    if (!hasLeft) sight.rowsOfGrid = right ? [...right.grid] : [];
    let number = 0;
    const drawn = this.traces.map((trace) => {
      const { name, number: colours } = trace, axis = this.axisOf(trace);
      if (axis !== "track") return { name, number: colours, track: null, sight: axis === "left" ? sight : axis === "right" ? right : sight.within(trace.own.shown) };
      const [first, last] = [number, ++number].map((count) => Math.round((tall + count * each) * ratio));
      const inset = Math.min(5 * ratio, (last - first) * 0.15);
      const scale = scope.kinds.get(name) === "bool" ? { low: 0, high: 1 } : trace.own.shown;
      if (first > 0) sight.grid.push(first);
      return { name, number: colours, track: { first, last }, sight: sight.within(scale, first + inset, last - inset) };
    });
    return { sight, right, drawn, left: hasLeft && tall > 0 ? sight : null };
  }

  draw() {
    const { scope } = this, { width, height } = this.size;
    if (!(width > 0 && height > 0)) return;
    if (this.#contents() !== this.content) this.describe(); // kinds of signals are known
    const sources = scope.sources();
    this.#fit();
    const { sight, right, left, drawn } = this.#arrange(width, height, window.devicePixelRatio || 1);
    this.sight = sight;
    this.drawn = drawn;
    const key = [sight.seconds, sight.height, sight.ratio, sight.low, sight.high, sight.ruler.state, document.documentElement.dataset.theme,
      ...sources.map((each) => each.serial), this.content,
      ...drawn.map((each) => `${each.sight.low} ${each.sight.high} ${each.sight.top} ${each.sight.bottom}`)].join(" ");
    this.tiles.show(sight, key, changesOf(sight, sources, drawn), (raster, base, from, to) => drawColumns(raster, sight, base, from, to, sources, drawn));
    this.times.show(sight);
    this.values.show(left, sight, this.#units("left"));
    this.rightValues.show(right, sight, this.#units("right"), this.#rightInk());
    const { a, b } = scope.cursors;
    this.marks.show(sight, scope.marks(), scope.marksNumber, scope.panes[0] === this);
    this.cursors.show(sight, cursorMarks(a, b), `${a} ${b}`, true);
    this.#levels();
    this.#names(sight);
    this.readout.show();
  }

  #units(axis) { return [...new Set(this.#on(axis).map(({ name }) => this.scope.unit(name)).filter(Boolean))].join(", "); }

  // The right axis has the colour of its trace if there is only one.
  #rightInk() {
    const traces = this.#on("right");
    return traces.length === 1 ? colour(traces[0].number) : ink("soft");
  }

  // Returns the thresholds of the trigger and their positions, if this pane shows its signal.
  #thresholds(drawn) {
    const { trigger: { settings }, mode } = this.scope;
    const sight = drawn.find(({ name }) => name === settings.signal)?.sight;
    if (mode !== "trigger" || !sight || !["edge", "level", "window"].includes(settings.kind)) return [];
    return (settings.kind === "window" ? ["low", "high"] : ["low"]).map((name) => ({ name, level: settings[name] }))
      .filter(({ level }) => level >= sight.low && level <= sight.high).map((each) => ({ ...each, y: Math.round(sight.y(each.level)) }));
  }

  #levels() {
    const thresholds = this.#thresholds(this.drawn);
    if (!thresholds.length && !this.levels.firstChild) return;
    const state = JSON.stringify(thresholds);
    if (state === this.levelsState) return;
    this.levelsState = state;
    if (this.levels.querySelector(".held")) return; // it is dragged
    this.levels.replaceChildren(...thresholds.map(({ name, level, y }) => {
      const line = element("div", "level");
      line.style.top = `${y}px`;
      const text = element("span", "");
      text.textContent = `level ${figure(level)}`;
      line.append(text, this.#handle(line, name));
      return line;
    }));
  }

  // A part of a threshold's line that can be dragged.
  #handle(line, name) {
    const handle = element("i", "handle"), { scope } = this;
    handle.title = "drag the level";
    let value = NaN;
    handle.addEventListener("pointerdown", (event) => {
      handle.setPointerCapture(event.pointerId);
      line.classList.add("held");
      event.stopPropagation();
    });
    handle.addEventListener("pointermove", (event) => {
      if (!line.classList.contains("held")) return;
      const sight = this.drawn.find((each) => each.name === scope.trigger.settings.signal)?.sight;
      if (!sight) return;
      const y = event.clientY - this.plot.getBoundingClientRect().top;
      value = Number(Math.min(Math.max(sight.value(y), sight.low), sight.high).toPrecision(4));
      line.style.top = `${y}px`;
      line.firstChild.textContent = `level ${figure(value)}`;
    });
    for (const end of ["pointerup", "pointercancel"]) handle.addEventListener(end, (event) => {
      if (!line.classList.contains("held")) return;
      line.classList.remove("held");
      this.levelsState = "";
      event.stopPropagation();
      if (end === "pointerup" && Number.isFinite(value)) scope.onLevel(name, value);
      else scope.changed();
    });
    return handle;
  }

  // Shows the names of the tracks, with the range of tracks of numbers.
  #names({ ratio }) {
    const tracks = this.#tracks(this.drawn, ratio);
    if (!tracks.length && !this.names.firstChild) return;
    const state = JSON.stringify([tracks, document.documentElement.dataset.theme]);
    if (state === this.namesState) return;
    this.namesState = state;
    this.names.replaceChildren(...tracks.map(({ text, y, number }) => {
      const name = element("span", "");
      name.textContent = text;
      name.style.top = `${y}px`;
      name.style.color = colour(number);
      return name;
    }));
  }

  #tracks(drawn, ratio) {
    return drawn.filter(({ track }) => track && (track.last - track.first) / ratio >= NAMED).map(({ name, number, track, sight: { low, high } }) => ({
      number, y: Math.round(track.first / ratio) + 2,
      text: this.scope.kinds.get(name) === "bool" ? name : `${name}  ${figure(low)} … ${figure(high)}`,
    }));
  }

  // Draws the pane on the canvas of an export, with `ratio` pixels per CSS pixel.
  paint(g, width, height, ratio) {
    const { scope } = this, besides = scope.hasRight ? LEFT : RIGHT;
    const isLast = scope.panes.at(-1) === this; // the time axis is below the last pane
    const area = { left: LEFT, top: TOP, width: width - LEFT - besides, height: height - TOP - (isLast ? BOTTOM : MARGIN) };
    const { sight, right, left, drawn } = this.#arrange(area.width, area.height, ratio);
    const raster = new Raster(sight.width, sight.height), canvas = element("canvas", "");
    canvas.width = sight.width;
    canvas.height = sight.height;
    drawColumns(raster, sight, sight.first, 0, sight.width, scope.sources(), drawn);
    canvas.getContext("2d").putImageData(raster.image, 0, 0);
    g.fillStyle = ink("paper");
    g.fillRect(0, 0, width, height);
    if (left) drawValues(g, left, this.#units("left"));
    if (right) {
      g.save();
      g.translate(area.left + area.width, 0);
      drawValues(g, right, this.#units("right"), "right", this.#rightInk());
      g.restore();
    }
    g.drawImage(canvas, area.left, area.top, area.width, area.height);
    g.strokeStyle = ink("axis");
    g.lineWidth = 1;
    g.strokeRect(area.left - 0.5, area.top - 0.5, area.width + 1, area.height + 1);
    g.font = FONT;
    g.fillStyle = ink("soft");
    g.textAlign = "center";
    for (const tick of isLast ? labelled(sight) : []) g.fillText(sight.ruler.text(tick), area.left + sight.x(tick.time), area.top + area.height + 15);
    g.textAlign = "right";
    if (isLast) g.fillText(sight.ruler.unit, area.left + area.width, area.top + area.height + 15);
    g.textAlign = "left";
    for (const { text, y, number } of this.#tracks(drawn, ratio)) {
      g.fillStyle = colour(number);
      g.fillText(text, area.left + 4, area.top + y + 10);
    }
    const { a, b } = scope.cursors, paper = ink("paper");
    for (const mark of scope.marks()) drawMark(g, area, sight.x(mark.time), ink(mark.ink), paper, scope.panes[0] === this ? mark.label : "");
    for (const mark of cursorMarks(a, b)) drawMark(g, area, sight.x(mark.time), ink(mark.ink), paper, mark.label);
    g.fillStyle = ink("hit");
    for (const { level, y } of this.#thresholds(drawn)) {
      g.fillRect(area.left, area.top + y, area.width, 1);
      g.fillText(`level ${figure(level)}`, area.left + 4, area.top + y - 3);
    }
  }
}

function say(element, text) { if (element.textContent !== text) element.textContent = text; }

function cursorMarks(a, b) {
  return [{ time: a, label: "A" }, { time: b, label: "B" }].filter(({ time }) => time !== null)
    .map((each) => ({ ...each, ink: "cursor" })).sort((one, other) => one.time - other.time);
}

// A short piece of a trace's line, for the legend.
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
