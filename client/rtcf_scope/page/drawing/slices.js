// The cycles of a store in each column of a part of a plot, and their positions.
export class Slices {
  // Columns are counted from `base`. Finds the cycles of the columns [from, to), and of `reach` more on
  // both sides.
  constructor(store, seconds, base, from, to, reach) {
    this.store = store;
    this.seconds = seconds;
    this.base = base;
    this.from = from;
    this.to = to;
    this.reach = reach;
    this.starts = new Float64Array(to - from + 2 * reach + 1);
    let at = store.find((base + from - reach) * seconds);
    for (let i = 0; i < this.starts.length; i++) {
      if (i) at = store.findAfter((base + from - reach + i) * seconds, at);
      this.starts[i] = at;
    }
  }

  // The first cycle at or after the left end of a column.
  start(x) { return this.starts[x - this.from + this.reach]; }
  // The left end of a column, as time.
  time(x) { return (this.base + x) * this.seconds; }
  // The position of a cycle, in columns.
  place(at) { return this.store.time(at) / this.seconds - this.base; }
}
