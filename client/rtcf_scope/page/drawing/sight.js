// What a plot shows in which pixels. Columns are pixels of the screen, numbered from time 0 on, so
// that a value stays in its column while the view moves.
import { tickStep, ticks } from "./axes.js";

const EVERY_X = 110, EVERY_Y = 45; // pixels from tick to tick, about

export class Sight {
  constructor(view, scale, width, height, ratio) { // size in CSS pixels; ratio: pixels in one
    this.ratio = ratio;
    this.width = Math.max(1, Math.round(width * ratio));
    this.height = Math.max(1, Math.round(height * ratio));
    this.seconds = view.span / this.width; // of a column
    this.first = Math.round(view.begin / this.seconds); // column at the left
    this.low = scale.low;
    this.high = scale.high;
    this.rows = ticks(scale.low, scale.high, Math.max(2, height / EVERY_Y));
    this.step = tickStep(view.span, Math.max(2, width / EVERY_X)); // seconds from tick to tick
  }

  // Numbers of the ticks of time between two columns; each stands at `step` times its number.
  ticks(from, to) {
    const found = [];
    for (let n = Math.ceil(from * this.seconds / this.step); n * this.step <= to * this.seconds; n++) found.push(n);
    return found;
  }

  column(time) { return time / this.seconds; }
  // A row of pixels from the top, not rounded; far away is as good as farther.
  row(value) {
    const row = (this.high - value) / (this.high - this.low) * this.height;
    return Math.min(Math.max(row, -1e9), 1e9);
  }

  // In CSS pixels from the top left corner of the plot.
  x(time) { return (time / this.seconds - this.first) / this.ratio; }
  y(value) { return this.row(value) / this.ratio; }
  time(x) { return (x * this.ratio + this.first) * this.seconds; }
  value(y) { return this.high - y * this.ratio / this.height * (this.high - this.low); }
}
