// Helpers of the drawing tests within the page: cycles, generated here or from the loop, drawn
// incrementally and at once.

// Pseudorandom numbers, identical for a seed.
export function randomOf(seed) {
  let state = seed >>> 0;
  return () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let mixed = Math.imul(state ^ (state >>> 15), state | 1);
    mixed ^= mixed + Math.imul(mixed ^ (mixed >>> 7), mixed | 61);
    return ((mixed ^ (mixed >>> 14)) >>> 0) / 4294967296;
  };
}

// A scope over the whole page; the test pushes its cycles.
export async function scopeOf(panes) {
  const { Scope } = await import("/page/scope.js");
  const box = document.createElement("div");
  Object.assign(box.style, { position: "fixed", inset: "0", zIndex: 9, display: "flex", flexDirection: "column" });
  document.body.append(box);
  const scope = new Scope(box);
  panes.forEach((names, i) => {
    const pane = i ? scope.addPane() : scope.panes[0];
    for (const name of names) pane.add(name);
  });
  while (!scope.panes.every((pane) => pane.size.height > 0)) await new Promise(requestAnimationFrame);
  return scope;
}

// All visible pixels of the traces, pane by pane, as columns by number.
export function pixels(scope) {
  return scope.panes.map((pane) => {
    const { first, width, height } = pane.sight, found = new Map();
    for (const { number, canvas, g } of pane.tiles.tiles) {
      const { data } = g.getImageData(0, 0, canvas.width, height);
      const values = new Uint32Array(data.buffer);
      for (let x = 0; x < canvas.width; x++) {
        const column = number * canvas.width + x;
        if (!(column >= first && column < first + width)) continue;
        found.set(column, Uint32Array.from({ length: height }, (_, y) => values[y * canvas.width + x]));
      }
    }
    return found;
  });
}

// Draws the visible part again at once; returns the columns that change.
export function differences(scope, now = performance.now()) {
  scope.frame(now);
  const { view } = scope, end = view.end, follows = view.follows;
  view.follows = false; // the view must not move between the two drawings
  const grown = pixels(scope);
  for (const pane of scope.panes) pane.tiles.forget();
  scope.dirty = true;
  scope.frame(now);
  const whole = pixels(scope);
  view.follows = follows;
  const found = [];
  whole.forEach((columns, pane) => {
    const { width } = scope.panes[pane].sight;
    if (columns.size !== width || grown[pane].size !== width) found.push({ pane, columns: [grown[pane].size, columns.size, width] });
    for (const [column, values] of columns) {
      const before = grown[pane].get(column);
      const at = values.findIndex((value, y) => value !== before?.[y]);
      if (at >= 0) found.push({ pane, column: column - scope.panes[pane].sight.first, row: at, end });
    }
  });
  return found;
}

// The visible cycles whose value is not drawn in the trace's colour at its position.
export async function unseen(scope, name, isWanted) {
  const { colour, ink: inkOf, pixel } = await import("/page/drawing/palette.js");
  const ground = pixel(inkOf("paper"));
  const apart = (one, other) => [0, 8, 16].reduce((sum, bits) => sum + Math.abs(((one >> bits) & 255) - ((other >> bits) & 255)), 0);
  const index = scope.panes.findIndex((pane) => pane.has(name)), pane = scope.panes[index], { sight } = pane;
  const columns = pixels(scope)[index], ink = pixel(colour(pane.traces.find((each) => each.name === name).number));
  const store = scope.store, values = store.column(name), found = [];
  let count = 0;
  for (let at = store.find(scope.view.begin + 2 * sight.seconds); at < store.end && store.time(at) < scope.view.end - 2 * sight.seconds; at++) {
    const value = values.get(at);
    if (!isWanted(value, at)) continue;
    count++;
    const column = columns.get(Math.floor(sight.column(store.time(at)))), y = Math.min(Math.floor(sight.row(value)), sight.height - 1);
    if (!column || ![y - 1, y, y + 1].some((row) => apart(column[row], ink) < apart(ground, ink) / 3)) found.push({ at, value, time: store.time(at) });
  }
  return { count, found };
}

// Cycles of some traces in pieces, with spikes, holes and missing cycles.
export class Source {
  constructor(names, rate, random) {
    Object.assign(this, { names, rate, random, cycle: 0, time: 0, hole: 0, level: 0 });
  }

  next(count) {
    const { random } = this;
    let lost = 0;
    if (random() < 0.004) { lost = 1 + Math.floor(random() * 300); this.cycle += lost; this.time += lost / this.rate; }
    const times = new Float64Array(count), cycles = new Float64Array(count);
    const traces = this.names.map(() => new Float64Array(count));
    for (let i = 0; i < count; i++) {
      times[i] = this.time + random() * 0.2 / this.rate;
      cycles[i] = this.cycle++;
      this.time += 1 / this.rate;
      this.level += random() - 0.5;
      if (random() < 0.001) this.hole = Math.floor(random() * 200);
      this.hole--;
      traces.forEach((values, number) => {
        values[i] = number === 0 ? (random() < 0.005 ? 3 : 0.5 * Math.sin(this.time * 7))
          : number === 1 ? (this.hole > 0 ? NaN : Math.cos(this.time * 3))
          : number === 2 ? this.level
          : number === 3 ? (random() < 0.001 ? Infinity : Math.sign(Math.sin(this.time * 20)))
          : Math.sin(this.time * number) + 0.2 * random();
      });
    }
    const zeros = new Float64Array(count);
    return { count, lost, times, cycles, latencies: zeros, durations: zeros, traces };
  }
}
