// A ring of values, with the minimum and maximum of each block of 16, 256 and 4096 values, so that
// drawing is as fast for an hour as for a second, and shows each spike.
const STEP = 16, LEVELS = 3;
export const BLOCK = STEP ** LEVELS;

export class Column {
  constructor(capacity) { // a multiple of BLOCK
    this.values = new Float64Array(capacity).fill(NaN);
    // 1 where a cycle wrote NaN or infinity; 0 elsewhere, also at places without a cycle.
    this.odd = new Uint8Array(capacity);
    this.levels = [];
    for (let size = STEP; size <= BLOCK; size *= STEP)
      this.levels.push({
        size, low: new Float64Array(capacity / size).fill(Infinity),
        high: new Float64Array(capacity / size).fill(-Infinity), odd: new Uint8Array(capacity / size),
      });
    // Results of `scan`.
    this.low = Infinity;
    this.high = -Infinity;
    this.strange = 0;
  }

  // `at` is the number of the first value, counted from the first write; the ring keeps the newest values.
  write(at, values) {
    const capacity = this.values.length;
    for (let i = 0; i < values.length; i++) {
      const value = values[i], place = (at + i) % capacity;
      this.values[place] = value;
      this.odd[place] = value - value === 0 ? 0 : 1;
    }
    for (const level of this.levels) fill(level, at, values);
  }

  // Marks a place that has no cycle, or a cycle without this value.
  blank(at) {
    const place = at % this.values.length;
    this.values[place] = NaN;
    this.odd[place] = 0;
    for (const level of this.levels) if (at % level.size === 0) reset(level, at / level.size % level.low.length);
  }

  get(at) { return this.values[at % this.values.length]; }
  isOdd(at) { return this.odd[at % this.odd.length] !== 0; }
  isBlank(at) { return !this.isOdd(at) && Number.isNaN(this.get(at)); }

  // Minimum and maximum of the places [begin, end); [Infinity, -Infinity] if they have no number.
  range(begin, end) {
    this.scan(begin, end);
    return [this.low, this.high];
  }

  // Sets `low` and `high` to the extremes of the numbers, and `strange` if a value is not a number.
  scan(begin, end) {
    const { values, odd, levels } = this, capacity = values.length;
    let low = Infinity, high = -Infinity, strange = 0, at = begin;
    while (at < end) {
      if (at % STEP !== 0 || at + STEP > end) {
        const place = at++ % capacity;
        if (odd[place]) { strange = 1; continue; }
        const value = values[place];
        if (value < low) low = value;
        if (value > high) high = value;
        continue;
      }
      let number = 0;
      while (number + 1 < LEVELS && at % levels[number + 1].size === 0 && at + levels[number + 1].size <= end) number++;
      const level = levels[number], place = at / level.size % level.low.length;
      if (level.low[place] < low) low = level.low[place];
      if (level.high[place] > high) high = level.high[place];
      strange |= level.odd[place];
      at += level.size;
    }
    this.low = low;
    this.high = high;
    this.strange = strange;
  }
}

function reset(level, place) {
  level.low[place] = Infinity;
  level.high[place] = -Infinity;
  level.odd[place] = 0;
}

function fill(level, at, values) {
  const { size } = level, count = values.length;
  for (let i = 0; i < count;) {
    const place = Math.floor((at + i) / size) % level.low.length;
    if ((at + i) % size === 0) reset(level, place);
    let low = level.low[place], high = level.high[place], odd = level.odd[place];
    for (const end = Math.min(count, i + size - (at + i) % size); i < end; i++) {
      const value = values[i];
      if (value - value !== 0) { odd = 1; continue; }
      if (value < low) low = value;
      if (value > high) high = value;
    }
    level.low[place] = low;
    level.high[place] = high;
    level.odd[place] = odd;
  }
}
