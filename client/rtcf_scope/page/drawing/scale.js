// A range of values: fitted to the values in sight, or set by the user.
import { ticks } from "./axes.js";

const SHRINKS = 0.6; // a scale is fitted again if the values need a smaller share of it

export class Scale {
  constructor() {
    this.set = null; // {low, high}; null = fitted
    this.reset();
  }

  reset() {
    this.shown = { low: -1, high: 1 };
    this.refit();
  }

  // Discards a set range, and makes the next fit() a close one.
  refit() {
    this.set = null;
    this.content = null;
  }

  // Fits the scale to values, rounded to ticks; keeps it if it is nearly right. `content` differs for
  // different traces.
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
