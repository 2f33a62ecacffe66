// The stored cycles: times, numbers, and a column for each trace.
import { BLOCK, Column } from "./column.js";
import { Derivation } from "./derivation.js";
import { derived, isDerived, sources } from "./derived.js";
import { RECORDED } from "./wire.js";

export const LATENCY = "~latency", DURATION = "~duration";
const KEPT = 128 * BLOCK; // cycles: 4 minutes at 2 kHz, 5 MB per trace

let serial = 0;

export class Store {
  constructor(capacity = KEPT) {
    this.capacity = Math.ceil(capacity / BLOCK) * BLOCK;
    this.clear();
  }

  // Returns a store with the cycles of one message: a shot, or a recording.
  static of(message, names) {
    const store = new Store(message.count + 1);
    store.hasAll = message.kind !== RECORDED || !(message.hit > 1);
    store.push(message, names);
    return store;
  }

  clear() {
    this.times = new Float64Array(this.capacity);
    this.cycles = new Float64Array(this.capacity);
    this.columns = new Map([[LATENCY, new Column(this.capacity)], [DURATION, new Column(this.capacity)]]);
    this.derivations = new Map(); // by name; their values are in a column of that name
    this.hasAll = true; // the store has each cycle, not only minima and maxima
    this.shift = 0; // seconds added to all times
    this.end = 0; // number of places so far
    this.lost = 0;
    // {from, to, cycles}: times, without `shift`, between which this number of cycles is missing, or for 0 the
    // loop was stopped; oldest first
    this.gaps = [];
    this.serial = ++serial; // unique for each content
  }

  get begin() { return Math.max(0, this.end - this.capacity); }
  get empty() { return this.end === 0; }
  get firstTime() { return this.time(this.begin); }
  get lastTime() { return this.time(this.end - 1); }
  time(at) { return this.times[at % this.capacity] + this.shift; }
  cycle(at) { return this.cycles[at % this.capacity]; }
  column(name) { return this.columns.get(name) ?? (isDerived(name) ? this.#derive(name) : undefined); }

  // Moves all cycles in time to `seconds` after their original times.
  move(seconds) {
    this.shift = seconds;
    this.serial = ++serial;
  }

  // A derived signal has a column as soon as its signals have one.
  #derive(name) {
    if (!this.hasAll || !derived(name).signals.every((each) => this.columns.has(each))) return undefined;
    const column = new Column(this.capacity), derivation = new Derivation(name, this, column);
    derivation.run(this.begin, this.end);
    this.columns.set(name, column);
    this.derivations.set(name, derivation);
    return column;
  }

  push(message, names) {
    if (!message.count) return;
    if (!this.empty && message.times[0] + this.shift < this.lastTime) this.clear(); // the clock was set back
    this.lost += message.lost;
    const columns = new Map([[LATENCY, message.latencies], [DURATION, message.durations]]);
    names.forEach((name, i) => columns.set(name, message.traces[i]));
    for (const name of columns.keys())
      if (!this.columns.has(name)) this.columns.set(name, new Column(this.capacity));
    // Lines are broken at missing cycles, and at a restart of the loop.
    const missing = this.empty ? 0 : message.lost || message.cycles[0] - this.cycle(this.end - 1) - 1;
    if (missing !== 0) this.#gap(message.times[0], Math.max(missing, 0));
    for (let i = 0; i < message.count; i++) {
      this.times[(this.end + i) % this.capacity] = message.times[i];
      this.cycles[(this.end + i) % this.capacity] = message.cycles[i];
    }
    for (const [name, column] of this.columns) {
      const values = columns.get(name);
      if (values) column.write(this.end, values);
      else if (!this.derivations.has(name)) for (let i = 0; i < message.count; i++) column.blank(this.end + i);
    }
    for (const derivation of this.derivations.values()) derivation.run(this.end, this.end + message.count);
    this.end += message.count;
    while (this.gaps.length && this.gaps[0].to + this.shift <= this.firstTime) this.gaps.shift();
  }

  // Adds a place without a cycle, with the time of the last cycle.
  #gap(until, cycles) {
    const time = this.times[(this.end - 1) % this.capacity], at = this.end++;
    this.gaps.push({ from: time, to: until, cycles });
    this.times[at % this.capacity] = time;
    this.cycles[at % this.capacity] = NaN;
    for (const [name, column] of this.columns) if (!this.derivations.has(name)) column.blank(at);
    for (const derivation of this.derivations.values()) derivation.run(at, at + 1);
  }

  // Returns a store with the cycles of the places [begin, end), their times counted from `zero`.
  part(begin, end, zero) {
    const count = end - begin, column = (name) => Float64Array.from({ length: count }, (_, i) => this.columns.get(name).get(begin + i));
    const names = [...this.columns.keys()].filter((name) => name !== LATENCY && name !== DURATION && !this.derivations.has(name));
    const store = new Store(count + 1);
    store.push({
      count, lost: 0, times: Float64Array.from({ length: count }, (_, i) => this.time(begin + i) - zero),
      cycles: Float64Array.from({ length: count }, (_, i) => this.cycle(begin + i)),
      latencies: column(LATENCY), durations: column(DURATION), traces: names.map(column),
    }, names);
    return store;
  }

  // Removes the columns that no trace needs.
  keep(names) {
    const kept = new Set([LATENCY, DURATION, ...names, ...sources(names)]);
    for (const name of this.columns.keys())
      if (!kept.has(name)) {
        this.columns.delete(name);
        this.derivations.delete(name);
      }
  }

  // Returns the place of the first cycle at or after `time`.
  find(time) { return this.#between(time, this.begin, this.end); }

  // Like find(), for a time soon after that of the place `from`, where the search begins.
  findAfter(time, from) {
    let low = Math.max(from, this.begin), step = 1;
    while (low + step < this.end && this.time(low + step) < time) { low += step; step *= 2; }
    return this.#between(time, low, Math.min(low + step + 1, this.end));
  }

  #between(time, low, high) {
    while (low < high) {
      const middle = Math.floor((low + high) / 2);
      if (this.time(middle) < time) low = middle + 1; else high = middle;
    }
    return low;
  }

  // Returns the place of the cycle nearest to a time, or -1.
  nearest(time) {
    if (this.empty) return -1;
    const at = Math.min(this.find(time), this.end - 1);
    return at > this.begin && time - this.time(at - 1) < this.time(at) - time ? at - 1 : at;
  }
}
