// Values in a ring, with minimum and maximum of each 16, 256 and 4096 of them: a second of 2000
// cycles is drawn as fast as an hour, and no spike is lost.
const STEP = 16, LEVELS = 3;
export const BLOCK = STEP ** LEVELS;

export class Column {
  constructor(capacity) { // a multiple of BLOCK
    this.values = new Float64Array(capacity).fill(NaN);
    this.levels = [];
    for (let size = STEP; size <= BLOCK; size *= STEP)
      this.levels.push({
        size, low: new Float64Array(capacity / size).fill(Infinity),
        high: new Float64Array(capacity / size).fill(-Infinity),
      });
  }

  // `at` is the number of the value since the beginning, of which the ring keeps the last ones.
  set(at, value) {
    this.values[at % this.values.length] = value;
    for (const { size, low, high } of this.levels) {
      const place = Math.floor(at / size) % low.length;
      if (at % size === 0) { low[place] = Infinity; high[place] = -Infinity; }
      if (value < low[place]) low[place] = value;
      if (value > high[place]) high[place] = value;
    }
  }

  get(at) { return this.values[at % this.values.length]; }

  // Minimum and maximum from `begin` to before `end`: [Infinity, -Infinity] where no number is.
  range(begin, end) {
    let least = Infinity, most = -Infinity, at = begin;
    while (at < end) {
      let level = null;
      for (const each of this.levels) {
        if (at % each.size !== 0 || at + each.size > end) break;
        level = each;
      }
      if (level === null) {
        const value = this.get(at++);
        if (value < least) least = value;
        if (value > most) most = value;
      } else {
        const place = Math.floor(at / level.size) % level.low.length;
        if (level.low[place] < least) least = level.low[place];
        if (level.high[place] > most) most = level.high[place];
        at += level.size;
      }
    }
    return [least, most];
  }
}
