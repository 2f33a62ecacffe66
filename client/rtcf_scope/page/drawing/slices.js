// Which cycles of a store fall into which columns of a stretch, and where they are in it.
export class Slices {
  // Columns are counted from `base` on; of those from `from` to before `to`, and of `reach` more on
  // either side, the cycles are known.
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

  // The first cycle that is not before a column.
  start(x) { return this.starts[x - this.from + this.reach]; }
  // The left end of a column, as time.
  time(x) { return (this.base + x) * this.seconds; }
  // Where a cycle is, in columns.
  place(at) { return this.store.time(at) / this.seconds - this.base; }
}
