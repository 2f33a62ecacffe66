// Which stretch of time is looked at: the newest while it follows, else where it was left.
export const SPANS = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 240];
const LEAST = 1e-4, MOST = 24 * 3600;

export class View {
  constructor() { this.span = 10; this.end = 0; this.follows = true; }
  get begin() { return this.end - this.span; }

  freeze() { this.follows = false; }
  follow() { this.follows = true; }

  zoom(factor, at) {
    const span = Math.min(MOST, Math.max(LEAST, this.span * factor));
    // What is followed stays at its end.
    if (!this.follows) this.end = at + (this.end - at) * (span / this.span);
    this.span = span;
  }

  step(by) {
    const next = by > 0 ? SPANS.find((each) => each > this.span * 1.001)
      : SPANS.findLast((each) => each < this.span * 0.999);
    if (next !== undefined) this.zoom(next / this.span, (this.begin + this.end) / 2);
  }

  pan(by) { this.follows = false; this.end += by; }

  show(begin, end) { this.follows = false; this.end = end; this.span = Math.max(end - begin, LEAST); }
}
