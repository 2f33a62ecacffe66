// A range of values: as the values in sight need, or as it was set.
import { ticks } from "./axes.js";

const SHRINKS = 0.6; // a scale of which the values need less is fitted again

export class Scale {
  constructor() {
    this.set = null; // {low, high}, or null: as the values need
    this.reset();
  }

  reset() {
    this.shown = { low: -1, high: 1 };
    this.refit();
  }

  // It is fitted anew, closely.
  refit() {
    this.set = null;
    this.content = null;
  }

  // Fits it to values, rounded to ticks; it stays as it is while it is about right. `content` is
  // another one when the traces are.
  fit(low, high, content) {
    if (this.set) { this.shown = this.set; return; }
    if (low > high) return;
    if (high - low < 1e-12 * Math.max(1, Math.abs(high))) { low -= 0.5; high += 0.5; }
    const { step } = ticks(low, high, 4), pad = (high - low) * 0.04, { shown } = this;
    const fitted = { low: Math.floor((low - pad) / step * 2) * step / 2, high: Math.ceil((high + pad) / step * 2) * step / 2 };
    const isRoomy = low >= shown.low && high <= shown.high && fitted.high - fitted.low >= SHRINKS * (shown.high - shown.low);
    if (isRoomy && this.content === content) return;
    this.content = content;
    this.shown = fitted;
  }
}
