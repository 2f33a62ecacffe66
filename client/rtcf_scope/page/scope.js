// The state of the page: panes, view, and the stores to draw. Panels change it by its methods;
// `changed` redraws everything in the next frame.
import { Pane } from "./drawing/pane.js";
import { Pace, View } from "./drawing/view.js";
import { bindPointer } from "./drawing/pointer.js";
import { RULERS, rulerOf, secondOfDay } from "./drawing/ruler.js";
import { DURATION, LATENCY, Store } from "./data/store.js";
import { sizesPanes } from "./resize.js";

const SHOTS = 32;

export class Scope {
  constructor(box) {
    this.box = box;
    this.live = new Store();
    this.view = new View();
    this.pace = new Pace();
    this.mode = "roll"; // or "trigger", or "recording"
    this.panes = [];
    this.active = null;
    this.cursors = { a: null, b: null };
    this.units = new Map([[LATENCY, "µs"], [DURATION, "µs"]]);
    this.kinds = new Map(); // of signals by name: "number", "integer" or "bool"
    this.catalog = [];
    this.ruler = RULERS[0]; // the numbers of the time axis
    this.isPointing = true; // values under the pointer are shown
    this.shots = []; // {store, cycle, hitTime, baseNs}, newest last
    this.shotNumber = -1;
    this.recordings = []; // {name, store, shift, beginNs}: one, or two over each other
    this.events = []; // newest last
    // `settings`; `armed`: the signals that the server watches; `missing`: those of them that
    // the graph does not have.
    this.trigger = { settings: { kind: "edge", signal: "", slope: "rising", low: 0, high: 1 }, state: "off", armed: [], missing: [] };
    this.baseNs = 0n;
    this.onTraces = () => {}; // the watched signals have changed
    this.onActive = () => {}; // another pane became active
    this.onShift = () => {}; // the second recording has moved
    this.onLayout = () => {}; // a part of the layout has changed
    this.onLevel = () => {}; // a level of the trigger was dragged: ("low" or "high", value)
    this.hitAt = 0; // time of the newest shot, ms
    this.dirty = true;
    this.drawn = { end: NaN, time: NaN }; // the live cycles in the previous frame
    this.found = null; // the marks, until something changes
    this.marksNumber = 0; // changes with them
    this.addPane();
  }

  // The shown shot, or the newest cycles in its place.
  get shot() { return this.newest ?? this.shots[this.shotNumber]; }
  get store() { return this.sources()[0]; }

  // The stores that are drawn over each other, the main one first.
  sources() {
    if (this.mode === "recording") return this.recordings.map((each) => each.store);
    if (this.mode === "trigger") return this.shot ? [this.shot.store] : [EMPTY];
    return [this.live];
  }

  // The place of the legend's values without a cursor: the hit, or the newest cycle.
  get readAt() { return this.mode === "trigger" ? this.store.nearest(0) : this.store.end - 1; }

  // Stores unit and kind of signals: {name, unit, kind}.
  know(signals) {
    for (const { name, unit, kind } of signals) {
      this.units.set(name, unit);
      this.kinds.set(name, kind);
    }
    this.dirty = true;
  }

  unit(name) { return this.units.get(name) ?? ""; }

  // All traces; a signal in several panes counts once.
  traces() {
    const found = new Map();
    for (const pane of this.panes) for (const trace of pane.traces) if (!found.has(trace.name)) found.set(trace.name, trace);
    return [...found.values()];
  }

  get hasRight() { return this.panes.some((pane) => pane.traces.some((each) => pane.axisOf(each) === "right")); }

  // All panes have the same width, with or without an axis at the right.
  arrange() { this.box.classList.toggle("both", this.hasRight); }

  // Time 0 of the axis, ns since 1970; null if unknown.
  get origin() {
    if (this.mode === "recording") return this.recordings[0]?.beginNs ?? null;
    const { shot } = this, base = BigInt((this.mode === "trigger" ? shot?.baseNs : this.baseNs) ?? 0);
    return base ? base + BigInt(Math.round((this.mode === "trigger" ? shot.hitTime : 0) * 1e9)) : null;
  }

  // The time of day at time 0 of the axis, s.
  secondOfDay() {
    const { origin } = this;
    if (origin !== this.day?.origin) this.day = { origin, second: origin === null ? null : secondOfDay(origin) };
    return this.day.second;
  }

  // The ruler of the time axis of a plot of `width` CSS pixels.
  rulerOf(width) {
    const { store, view } = this;
    // For live cycles, the ruler must not change from frame to frame.
    const own = this.mode === "roll" ? NaN : (store.cycle(store.end - 1) - store.cycle(store.begin)) / (store.lastTime - store.firstTime);
    const rate = own > 0 && isFinite(own) ? own : this.rate || 1000;
    return rulerOf(this.ruler, { span: view.span, width, zero: this.ruler === "clock" ? this.secondOfDay() : null, store, rate });
  }

  setRuler(name) {
    this.ruler = RULERS.includes(name) ? name : RULERS[0];
    this.changed();
  }

  nextRuler() { this.setRuler(RULERS[(RULERS.indexOf(this.ruler) + 1) % RULERS.length]); }

  // Sets the position of the pointer in a plot, CSS pixels; null = outside of all plots.
  pointAt(pane, x, y) {
    for (const each of this.panes) {
      if (pane && this.isPointing) each.readout.point(x, each === pane ? y : null);
      else each.readout.leave();
    }
    pane?.readout.show();
  }

  // Moves the second recording to `seconds` after its original times.
  shiftSecond(seconds) {
    const [, second] = this.recordings;
    if (!second || !Number.isFinite(seconds)) return;
    second.shift = seconds;
    this.onShift(seconds);
    this.changed();
  }

  changed() {
    this.dirty = true;
    if (this.found) this.found.baseNs = null;
    this.onLayout();
  }

  addPane() {
    const pane = new Pane(this);
    bindPointer(pane, this);
    sizesPanes(pane.bar, pane, this);
    this.panes.push(pane);
    this.box.append(pane.box);
    pane.describe();
    this.activate(pane);
    return pane;
  }

  removePane(pane) {
    if (this.panes.length === 1) return;
    this.panes = this.panes.filter((each) => each !== pane);
    pane.box.remove();
    this.arrange();
    if (this.active === pane) this.activate(this.panes[0]);
    this.onTraces();
    this.changed();
  }

  activate(pane) {
    const isOther = pane !== this.active;
    this.active = pane;
    for (const each of this.panes) each.box.classList.toggle("active", each === pane);
    if (isOther) this.onActive();
    this.changed();
  }

  // Shows a signal in a pane, or removes it from there.
  toggle(name, pane = this.active) {
    if (pane.has(name)) {
      pane.remove(name);
      if (!pane.traces.length && this.panes.length > 1) this.removePane(pane);
    } else pane.add(name);
    this.onTraces();
    this.changed();
  }

  freeze() { if (this.mode === "roll") { this.view.freeze(); this.changed(); } }

  run() {
    if (this.mode === "roll") this.view.follow();
    this.changed();
  }

  setCursor(which, time) {
    const at = this.store.nearest(time);
    this.cursors[which] = at < 0 ? time : this.store.time(at); // on a cycle
    if (which === "a") this.freeze();
    this.changed();
  }

  clearCursors() { this.cursors = { a: null, b: null }; this.changed(); }

  setMode(mode) {
    if (mode === this.mode) return;
    this.mode = mode;
    this.clearCursors();
    if (mode === "roll") { this.view.span = this.rollSpan ?? 10; this.view.follow(); }
    else this.rollSpan ??= this.view.span;
    if (mode === "trigger" && this.shot) this.showShot(this.shots.length - 1);
    for (const pane of this.panes) pane.forget();
    this.onTraces();
    this.changed();
  }

  // The time of a shot is 0 at its hit.
  addShot(message, names) {
    const hitTime = message.times[message.hit], cycle = message.cycles[message.hit];
    const times = Float64Array.from(message.times, (time) => time - hitTime);
    const store = Store.of({ ...message, times, lost: 0 }, names);
    this.newest = null;
    this.hitAt = performance.now();
    this.shots.push({ store, cycle, hitTime, baseNs: String(this.baseNs) });
    if (this.shots.length > SHOTS) this.shots.shift();
    if (this.mode === "trigger") this.showShot(this.shots.length - 1);
  }

  clearShots() { this.shots = []; this.shotNumber = -1; this.newest = null; this.changed(); }

  // Shows the newest `seconds` of the live cycles in place of a shot, with time 0 after this share.
  showPreview(seconds, share) {
    const { live } = this;
    if (live.empty) return;
    const begin = live.find(live.lastTime - seconds), hitTime = live.time(begin) + share * seconds;
    const store = live.part(begin, live.end, hitTime), fresh = !this.shot;
    this.newest = { store, cycle: live.cycle(live.end - 1), hitTime, baseNs: String(this.baseNs), isPreview: true };
    if (fresh || this.view.span < 0.5 * seconds || this.view.span > 2 * seconds) this.view.show(-share * seconds, (1 - share) * seconds);
    this.changed();
  }

  showShot(number) {
    if (number < 0 || number >= this.shots.length) return;
    const fresh = this.shotNumber < 0 || !this.shot;
    const before = this.shot?.store;
    this.newest = null;
    this.shotNumber = number;
    const { store } = this.shot;
    // A zoom is kept for shots of the same length.
    if (fresh || Math.abs((before.lastTime - before.firstTime) - (store.lastTime - store.firstTime)) > 0.01 * this.view.span)
      this.view.show(store.firstTime, store.lastTime);
    this.changed();
  }

  showRecordings(recordings) {
    this.recordings = recordings;
    if (!recordings.length) { this.setMode("roll"); return; }
    const fresh = this.mode !== "recording";
    this.setMode("recording");
    const begin = Math.min(...recordings.map((each) => each.store.firstTime));
    const end = Math.max(...recordings.map((each) => each.store.lastTime));
    const [{ incident, beginNs }] = recordings;
    if (fresh && incident) {
      const at = Number(BigInt(incident.time_ns) - beginNs) / 1e9; // the last second before a fault
      this.view.show(Math.max(at - 1, begin), Math.min(at + 0.05, Math.max(end, at)));
    } else if (fresh) this.view.show(begin, end);
    this.changed();
  }

  // The events of the loop, or those in the first recording; newest last.
  get heard() { return this.mode === "recording" ? this.recordings[0]?.events ?? [] : this.events; }

  // The time of an event on the axis of the stream or of the recording, s.
  timeOf(event) {
    const base = this.mode === "recording" ? this.recordings[0].beginNs : this.baseNs;
    return Number(BigInt(event.time_ns) - base) / 1e9;
  }

  // Events, warnings, errors and the hit of a trigger, with their times on the shown axis.
  marks() {
    if (this.found && this.found.baseNs === this.baseNs) return this.found.marks;
    const marks = this.#marks();
    const state = `${this.mode} ${marks.length} ${marks[0]?.time} ${marks.at(-1)?.time}`;
    if (state !== this.found?.state) this.marksNumber++;
    this.found = { marks, state, baseNs: this.baseNs };
    return marks;
  }

  #marks() {
    const shift = this.mode === "trigger" ? this.shot?.hitTime ?? 0 : 0;
    const found = this.heard.filter((event) => !isForInformation(event)).map((event) => ({
      time: this.timeOf(event) - shift,
      ink: isOverrun(event) ? "late" : isBad(event) ? "bad" : "change", label: labelOf(event), title: titleOf(event), event,
    }));
    if (this.mode === "trigger" && this.shot) found.push({ time: 0, ink: "hit", label: "trigger" });
    return found.sort((one, other) => one.time - other.time);
  }

  // Draws the changes. Called for each frame with its time, ms.
  frame(now = performance.now()) {
    const { live, view } = this;
    if (this.mode === "roll" && !live.empty) {
      const end = view.follows ? this.pace.step(now, live.lastTime) : view.end;
      // Cycles after the visible part change nothing.
      if (end !== view.end || (live.end !== this.drawn.end && !(end < this.drawn.time))) this.dirty = true;
      view.end = end;
    }
    if (!this.dirty) return false;
    this.drawn = { end: live.end, time: live.empty ? NaN : live.lastTime };
    this.dirty = false;
    for (const pane of this.panes) pane.draw();
    return true;
  }
}

export function isBad(event) {
  return /fault|overruns|degraded|error|fatal/.test(event.what);
}

export function isOverrun(event) {
  return event.what.includes("overruns");
}

export function isForInformation(event) {
  return event.what === "info";
}

function labelOf({ what, component }) {
  return what.replaceAll("_", " ") + (component ? ` ${component}` : "");
}

function titleOf(event) {
  return [labelOf(event), event.message, event.user && `by ${event.user}`, `cycle ${event.iteration}`].filter(Boolean).join(", ");
}

const EMPTY = new Store(1);
