// The visible interval of time: the newest one while the view follows, else the one that was set.
export const SPANS = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 240];
const LEAST = 1e-4, MOST = 24 * 3600;

export class View {
  constructor() { this.span = 10; this.end = 0; this.follows = true; }
  get begin() { return this.end - this.span; }

  freeze() { this.follows = false; }
  follow() { this.follows = true; }

  zoom(factor, at) {
    const span = Math.min(MOST, Math.max(LEAST, this.span * factor));
    // A view that follows stays at the newest cycle.
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

const OFTEN_S = 1, LONGEST_LAG_S = 0.3;
const PAUSE_MS = 250; // without a frame: the page was hidden

// Moves the end of the view evenly, although cycles arrive in batches: it stays behind the newest cycle
// by about the length of a batch.
export class Pace {
  constructor() { this.end = NaN; }

  // The end of the view now, ms of the page, while `newest` is the time of the newest cycle.
  step(now, newest) {
    const looked = newest >= this.newest ? now - this.now : 0;
    const passed = Math.min(Math.max(looked, 0), PAUSE_MS) / 1000;
    this.now = now;
    if (!(newest >= this.newest)) // the first cycles, or the clock was set back
      this.#begin(now, newest);
    if (newest > this.newest) {
      // The longest recent batch; this maximum decays slowly.
      this.jump = Math.max(looked < PAUSE_MS ? newest - this.newest : 0, this.jump * 0.98);
      this.newest = newest;
    }
    if (now - this.since.now >= OFTEN_S * 1000) {
      // A stopped loop keeps its rate.
      if (newest > this.since.newest) this.rate = (newest - this.since.newest) / (now - this.since.now) * 1000;
      this.since = { now, newest };
    }
    const wanted = Math.min(1.5 * this.jump, LONGEST_LAG_S), lag = newest - this.end;
    if (lag > 3 * wanted + LONGEST_LAG_S) this.end = newest - wanted;
    else {
      const hurry = Math.min(Math.max((lag - wanted) / (wanted + 0.02) * 0.2, -0.5), 1);
      this.end = Math.min(this.end + passed * this.rate * (1 + hurry), newest);
    }
    return this.end;
  }

  #begin(now, newest) {
    this.newest = this.end = newest;
    this.jump = 0;
    this.rate = 1;
    this.since = { now, newest };
  }
}
