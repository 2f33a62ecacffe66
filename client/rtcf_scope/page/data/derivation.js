// The values of a derived signal of one store, cycle by cycle.
import { derived } from "./derived.js";

export class Derivation {
  constructor(name, store, column) {
    const { signals, start } = derived(name);
    this.start = start;
    this.store = store;
    this.column = column;
    this.sources = signals.map((each) => store.columns.get(each));
    const of = new Map(signals.map((each, i) => [each, this.sources[i]]));
    this.get = (signal) => of.get(signal).get(this.at);
    this.value = new Float64Array(1);
    this.#begin();
  }

  #begin() {
    this.step = this.start();
    this.last = NaN; // time of the last cycle
    this.isWarm = false;
  }

  // Computes the values of the cycles in order; a place without a cycle has no value.
  run(begin, end) {
    const { store, column, sources, value } = this;
    for (let at = begin; at < end; at++) {
      this.at = at;
      if (Number.isNaN(store.cycle(at)) || sources.some((each) => each.isBlank(at))) {
        column.blank(at);
        this.#begin();
        continue;
      }
      const time = store.time(at);
      value[0] = this.step(this.get, time - this.last);
      this.last = time;
      // A derivative has no value in its first cycle; this is not an error.
      this.isWarm ||= !Number.isNaN(value[0]) || sources.some((each) => each.isOdd(at));
      if (this.isWarm) column.write(at, value); else column.blank(at);
    }
  }
}
