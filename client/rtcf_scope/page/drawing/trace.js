// Draws one trace: the line through its values. A column of pixels with more than a few cycles is
// filled from their minimum to their maximum; other columns show the line, with soft edges.
import { isInSymbol } from "./palette.js";

const FEW = 3; // maximum cycles in a column that shows the line
const WIDTH = 1.5, THIN = 1.1; // CSS pixels
const DOT = 2.2, APART = 6; // radius of a cycle's dot, and minimum distance of cycles with dots
const SYMBOL = 4, SYMBOLS_APART = 170; // half the size of a symbol
const DASH = 7, DASHES_APART = 12, FAINT = 0.4;
const GROUND = 0.2; // opacity of the area below the line of a track
const BAND = 4; // height of the mark of values that are not numbers

// How far a dot or a symbol reaches into other columns, columns.
export const reach = (ratio, hasSymbols) => Math.ceil((hasSymbols ? SYMBOL + 1 : DOT) * ratio) + 2;

let lows = new Float64Array(0), highs = new Float64Array(0), odds = new Uint8Array(0);

// `style`: {colour, paper (pixels), symbol, shift, order, second, isTrack}; `sight` has the rows. The
// line of a track holds each value until the next cycle, and has a faint area below it.
export function drawTrace(raster, slices, column, sight, style) {
  new Stroke(raster, slices, column, sight, style).draw();
}

class Stroke {
  constructor(raster, slices, column, sight, style) {
    this.raster = raster;
    this.slices = slices;
    this.column = column;
    this.sight = sight;
    this.style = style;
    this.width = (style.second ? THIN : WIDTH) * sight.ratio;
    this.offset = slices.reach - slices.from; // of `lows` and `highs`
  }

  draw() {
    const { slices, raster, style } = this;
    this.#measure();
    const spread = Math.round((this.width - 1) / 2);
    for (let x = slices.from; x < slices.to; x++) {
      const count = slices.start(x + 1) - slices.start(x);
      if (count > FEW || style.isTrack) {
        let low = lows[x + this.offset], high = highs[x + this.offset];
        for (let by = 1; by <= spread; by++) {
          low = Math.min(low, lows[x + this.offset - by], lows[x + this.offset + by]);
          high = Math.max(high, highs[x + this.offset - by], highs[x + this.offset + by]);
        }
        if (low <= high && style.isTrack) raster.bar(x, this.sight.row(high), this.sight.bottom, style.colour, GROUND * this.#alpha(x));
        if (low <= high)
          raster.bar(x, this.sight.row(high) - this.width / 2, this.sight.row(low) + this.width / 2, style.colour, this.#alpha(x));
      } else {
        this.#lines(x);
        raster.settle(x, style.colour, this.#alpha(x));
      }
      if (odds[x + this.offset]) this.#strange(x);
      if (style.symbol) this.#symbol(x);
    }
  }

  // The second of two recordings is dashed; the gaps between the dashes are faint, not hidden.
  #alpha(x) {
    if (!this.style.second) return 1;
    const { ratio } = this.sight;
    return modulo(this.slices.base + x, Math.round(DASHES_APART * ratio)) < DASH * ratio ? 0.8 : FAINT;
  }

  // Finds the minimum and maximum of the line in each column, including its crossings of the column's
  // ends, and whether a value there is not a number. A value counts until the next cycle.
  #measure() {
    const { slices, column } = this, { store } = slices;
    const begin = slices.from - slices.reach, end = slices.to + slices.reach;
    if (lows.length < end - begin) {
      lows = new Float64Array(end - begin);
      highs = new Float64Array(end - begin);
      odds = new Uint8Array(end - begin);
    }
    let enters = this.#crossing(begin);
    for (let x = begin; x < end; x++) {
      const first = slices.start(x), last = slices.start(x + 1);
      const leaves = this.#crossing(x + 1);
      let low = Infinity, high = -Infinity;
      odds[x - begin] = first > store.begin && first < store.end && column.isOdd(first - 1) ? 1 : 0;
      if (last > first) {
        column.scan(first, last);
        ({ low, high } = column);
        odds[x - begin] |= column.strange;
      }
      if (enters < low) low = enters;
      if (enters > high) high = enters;
      if (leaves < low) low = leaves;
      if (leaves > high) high = leaves;
      lows[x - begin] = low;
      highs[x - begin] = high;
      enters = leaves;
    }
  }

  // The value of the line at the left end of a column, NaN where it is broken.
  #crossing(x) {
    const { slices, column } = this, { store } = slices;
    const after = slices.start(x), before = after - 1;
    if (before < store.begin || after >= store.end) return NaN;
    const from = column.get(before), to = column.get(after);
    if (this.style.isTrack) return from - from === 0 ? from : NaN;
    if (from - from !== 0 || to - to !== 0) return NaN;
    const begin = store.time(before), time = slices.time(x);
    return from + (to - from) * ((time - begin) / (store.time(after) - begin));
  }

  #isThere(at) {
    if (at < this.slices.store.begin || at >= this.slices.store.end) return false;
    const value = this.column.get(at);
    return value - value === 0;
  }

  // The lines and dots that reach into a column.
  #lines(x) {
    const { slices, sight } = this, { store } = slices, near = this.width / 2, dot = DOT * sight.ratio, apart = APART * sight.ratio;
    let at = slices.start(x) - 1;
    while (at > store.begin && slices.place(at) > x - Math.max(near, dot)) at--;
    const until = x + 1 + Math.max(near, dot);
    let place = at >= store.begin ? slices.place(at) : -Infinity;
    for (; at < store.end; at++) {
      // From this cycle to the next one.
      const isThere = this.#isThere(at);
      if (isThere) {
        if (place - (at > store.begin ? slices.place(at - 1) : -Infinity) >= apart) this.#disc(x, place, sight.row(this.column.get(at)), dot);
        else if (!this.#isThere(at - 1) && !this.#isThere(at + 1)) this.#disc(x, place, sight.row(this.column.get(at)), near);
      }
      const next = at + 1 < store.end ? slices.place(at + 1) : Infinity;
      if (isThere && this.#isThere(at + 1)) this.#segment(x, place, at, next);
      if (next > until) break;
      place = next;
    }
  }

  // Covers the part of a column that the line from one cycle to the next covers, to a fraction of a pixel.
  #segment(x, place, at, next) {
    const { raster, sight, column, width } = this;
    const from = sight.row(column.get(at)), to = sight.row(column.get(at + 1));
    const begin = place - x, end = Math.max(next - x, begin + 1e-9);
    const slope = (to - from) / (end - begin), length = Math.sqrt(1 + slope * slope);
    const high = width * length, wide = width / 2 * Math.abs(slope) / length;
    const left = Math.max(0, begin - wide), right = Math.min(1, end + wide);
    if (right <= left) return;
    // It ends at its last value, unless the line continues in the same direction.
    let top = Math.min(from, to), bottom = Math.max(from, to);
    for (const other of [at - 1, at + 2])
      if (this.#isThere(other)) {
        const row = sight.row(column.get(other));
        top = Math.min(top, row);
        bottom = Math.max(bottom, row);
      }
    top -= width / 2;
    bottom += width / 2;
    const upper = from + slope * (left - begin) - high / 2, lower = from + slope * (right - begin) - high / 2;
    const first = Math.max(raster.begin, Math.floor(Math.max(top, Math.min(upper, lower))));
    const last = Math.min(raster.end, Math.ceil(Math.min(bottom, Math.max(upper, lower) + high)));
    let above = area(first, upper, lower, high);
    for (let y = first; y < last; y++) {
      const below = area(y + 1, upper, lower, high);
      const cut = Math.min(bottom, y + 1) - Math.max(top, y);
      raster.add(y, (below - above) * (right - left) * Math.min(Math.max(cut, 0), 1));
      above = below;
    }
  }

  #disc(x, place, row, radius) {
    const dx = x + 0.5 - place;
    if (Math.abs(dx) > radius + 1) return;
    const last = Math.min(this.raster.end, Math.ceil(row + radius + 1));
    for (let y = Math.max(this.raster.begin, Math.floor(row - radius - 1)); y < last; y++) {
      const share = radius + 0.5 - Math.hypot(dx, y + 0.5 - row);
      if (share > 0) this.raster.add(y, Math.min(share, 1));
    }
  }

  // Draws values that are not numbers as a hatched band at the bottom, in the colour of the trace.
  #strange(x) {
    const { slices, sight, raster, style } = this;
    const high = Math.round(BAND * sight.ratio), hatch = 2 * Math.round(sight.ratio);
    const bottom = raster.end - 1 - style.order % 6 * (high + 1);
    for (let y = Math.max(bottom - high, raster.begin); y < bottom; y++)
      if (modulo(slices.base + x + y, 2 * hatch) < hatch) raster.mix(y * raster.width + x, style.colour, 1);
  }

  // Draws symbols at intervals, with a rim in the background colour.
  #symbol(x) {
    const { slices, sight, raster, style } = this, { ratio } = sight;
    const apart = Math.round(SYMBOLS_APART * ratio), half = SYMBOL * ratio;
    const away = modulo(slices.base + x - style.shift + Math.floor(apart / 2), apart) - Math.floor(apart / 2);
    if (Math.abs(away) > half + ratio) return;
    const low = lows[x - away + this.offset], high = highs[x - away + this.offset];
    if (low > high) return;
    const middle = (sight.row(low) + sight.row(high)) / 2;
    const last = Math.min(raster.end, Math.ceil(middle + half + ratio));
    for (let y = Math.max(raster.begin, Math.floor(middle - half - ratio)); y < last; y++) {
      const dy = y + 0.5 - middle;
      if (isInSymbol(style.symbol, away / half, dy / half)) raster.mix(y * raster.width + x, style.colour, 1);
      else if (isInSymbol(style.symbol, away / (half + ratio), dy / (half + ratio))) raster.mix(y * raster.width + x, style.paper, 1);
    }
  }
}

// Returns the area above a row of a band of height `high` whose upper edge goes from `upper` to
// `lower` within a column of width 1.
function area(y, upper, lower, high) {
  if (Math.abs(lower - upper) < 1e-6) return Math.min(Math.max(y - upper, 0), high);
  return (ramp(y - upper) - ramp(y - lower) - ramp(y - upper - high) + ramp(y - lower - high)) / (lower - upper);
}

function ramp(x) { return x > 0 ? x * x / 2 : 0; }

function modulo(number, by) { return number - Math.floor(number / by) * by; }
