// The map from times and values to the pixels of a plot. Columns are pixels of the screen, numbered
// from time 0, so that a value stays in its column while the view moves.
import { ticks } from "./axes.js";
import { rulerOf } from "./ruler.js";

const EVERY_Y = [45, 30, 18, 12]; // approximate distance of ticks, CSS pixels; the first with two ticks

export class Sight {
  // The size is in CSS pixels; `ratio` is the number of screen pixels in one. The scale uses `tall` of the height.
  constructor(view, scale, width, height, ratio, { ruler, tall = height } = {}) {
    this.ratio = ratio;
    this.width = Math.max(1, Math.round(width * ratio));
    this.height = Math.max(1, Math.round(height * ratio));
    this.seconds = view.span / this.width; // of a column
    this.first = Math.round(view.begin / this.seconds); // column at the left
    this.ruler = ruler ?? rulerOf("seconds", { span: view.span, width });
    this.top = 0; // rows of the scale
    this.bottom = tall === height ? this.height : Math.round(tall * ratio);
    this.low = scale.low;
    this.high = scale.high;
    this.ticksOfRows = this.rowsOfGrid = null;
  }

  // Returns a copy with another scale, between two rows.
  within(scale, top = this.top, bottom = this.bottom) {
    return Object.assign(Object.create(Sight.prototype), this, { low: scale.low, high: scale.high, top, bottom, ticksOfRows: null, rowsOfGrid: null });
  }

  get rows() {
    if (this.ticksOfRows) return this.ticksOfRows;
    this.ticksOfRows = { step: 1, at: [] };
    const height = (this.bottom - this.top) / this.ratio;
    for (const every of EVERY_Y)
      if (height > 0 && this.ticksOfRows.at.length < 2) this.ticksOfRows = ticks(this.low, this.high, Math.max(2, height / every));
    return this.ticksOfRows;
  }

  // Rows of pixels that have a line of the grid.
  get grid() {
    this.rowsOfGrid ??= this.rows.at.map((value) => Math.round(this.row(value)));
    return this.rowsOfGrid;
  }

  // The ticks of time between two columns.
  ticks(from, to) { return this.ruler.ticks(from * this.seconds, to * this.seconds); }

  column(time) { return time / this.seconds; }
  // The row of a value, in pixels from the top, not rounded; limited far outside the plot.
  row(value) {
    const row = this.top + (this.high - value) / (this.high - this.low) * (this.bottom - this.top);
    return Math.min(Math.max(row, -1e9), 1e9);
  }

  // In CSS pixels from the top left corner of the plot.
  x(time) { return (time / this.seconds - this.first) / this.ratio; }
  y(value) { return this.row(value) / this.ratio; }
  time(x) { return (x * this.ratio + this.first) * this.seconds; }
  value(y) { return this.high - (y * this.ratio - this.top) / (this.bottom - this.top) * (this.high - this.low); }
}
