// The timeline of cycles: wake-up latency and calculation duration of each cycle against the period,
// and the durations of the components.
import { DURATION, LATENCY } from "../data/store.js";
import { scaled, tickText, ticks } from "../drawing/axes.js";
import { blank } from "../drawing/canvas.js";
import { colour, ink } from "../drawing/palette.js";

const AREA = { left: 64, top: 8, right: 12, bottom: 22 };
const STACK = 26; // pixels of the bar of components

export class Cycles {
  constructor(scope, canvas) { this.scope = scope; this.canvas = canvas; this.statistics = null; }

  show() {
    const { canvas, scope } = this;
    const { g, width, height } = blank(canvas);
    const w = width - AREA.left - AREA.right, h = height - AREA.top - AREA.bottom - STACK;
    const { store, view } = scope;
    const period = scope.rate ? 1e6 / scope.rate : NaN;
    const bars = store.empty ? [] : this.#bars(store, view, w);
    let most = 1.15 * (period || 0);
    for (const bar of bars) most = Math.max(most, (bar.latency + bar.duration) * 1.05);
    if (!bars.length) {
      g.fillStyle = ink("soft");
      g.fillText("no cycles in sight: choose a signal, and start the loop", AREA.left, 30);
    }
    const y = (micro) => AREA.top + (1 - micro / most) * h;
    g.textAlign = "right";
    g.strokeStyle = ink("grid");
    g.fillStyle = ink("soft");
    const rows = ticks(0, most, h / 35);
    for (const micro of rows.at) {
      g.fillText(tickText(micro, rows.step), AREA.left - 6, y(micro) + 4);
      g.strokeRect(AREA.left, Math.round(y(micro)) + 0.5, w, 0);
    }
    g.textAlign = "left";
    g.fillText("µs", 8, AREA.top + 10);
    for (const { left, wide, latency, duration } of bars) {
      const late = latency + duration > period;
      g.fillStyle = late ? ink("bad") : colour(0);
      g.globalAlpha = late ? 1 : 0.45;
      g.fillRect(AREA.left + left, y(latency), Math.max(wide, 1), y(0) - y(latency));
      g.globalAlpha = 1;
      g.fillStyle = late ? ink("bad") : colour(2);
      g.fillRect(AREA.left + left, y(latency + duration), Math.max(wide, 1), Math.max(y(latency) - y(latency + duration), 1));
    }
    if (isFinite(period)) {
      g.strokeStyle = ink("cursor");
      g.setLineDash([6, 4]);
      g.strokeRect(AREA.left, Math.round(y(period)) + 0.5, w, 0);
      g.setLineDash([]);
      g.fillStyle = ink("soft");
      g.fillText("period", AREA.left + 4, y(period) - 3);
    }
    g.fillStyle = ink("soft");
    g.fillText(`wake-up latency below, calculation above it${this.many ? "; each column: the worst of its cycles" : ""}`, AREA.left + 60, AREA.top + 10);
    this.#components(g, AREA.top + h + 8, w);
  }

  // Draws one bar per cycle, or one per pixel for several cycles.
  #bars(store, view, w) {
    const latency = store.column(LATENCY), duration = store.column(DURATION);
    const first = store.find(view.begin), last = Math.min(store.find(view.end) + 1, store.end);
    const bars = [];
    this.many = last - first > w / 3;
    if (!this.many) {
      const wide = w / Math.max(last - first, 1);
      for (let at = first; at < last; at++) {
        if (Number.isNaN(latency.get(at))) continue;
        bars.push({ left: (at - first) * wide, wide: wide > 4 ? wide - 1 : wide, latency: Math.max(latency.get(at), 0), duration: duration.get(at) });
      }
      return bars;
    }
    for (let pixel = 0; pixel < w; pixel += 2) {
      const begin = store.find(view.begin + pixel / w * view.span), end = store.find(view.begin + (pixel + 2) / w * view.span);
      const [, late] = latency.range(begin, end), [, long] = duration.range(begin, end);
      if (isFinite(late)) bars.push({ left: pixel, wide: 2, latency: Math.max(late, 0), duration: long });
    }
    return bars;
  }

  // Draws the mean duration of each component in a cycle, in schedule order: a component that runs in each
  // fourth cycle counts with a quarter of its duration.
  #components(g, top, w) {
    if (!this.statistics) return;
    const all = Object.entries(this.statistics.components);
    const share = ({ mean, every }) => mean / every, sum = all.reduce((total, [, each]) => total + share(each), 0);
    if (!(sum > 0)) return;
    let left = AREA.left;
    all.forEach(([name, each], i) => {
      const wide = share(each) / sum * w;
      g.fillStyle = colour(i % 8);
      g.fillRect(left, top, Math.max(wide - 1, 0.5), STACK - 10);
      const text = `${name} ${scaled(each.mean / 1e6, "s")}${each.every > 1 ? ` in 1 of ${each.every} cycles` : ""}`;
      g.fillStyle = ink("paper");
      if (g.measureText(text).width < wide - 8) g.fillText(text, left + 4, top + 12);
      left += wide;
    });
    g.fillStyle = ink("soft");
    g.fillText(`mean of update(), component by component: ${scaled(sum / 1e6, "s")} of a cycle's ${scaled(this.statistics.duration.mean / 1e6, "s")}`, AREA.left, top + STACK + 4);
  }
}
