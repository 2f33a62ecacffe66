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

// Cycles of sine waves: the trace `i` has the amplitude AMPLITUDES[i] and an offset.
const AMPLITUDES = [2, 9, 0.5, 30];
export class Waves {
  constructor(names, rate) { Object.assign(this, { names, rate, cycle: 0 }); }
  get time() { return this.cycle / this.rate; }

  next(count) {
    const times = Float64Array.from({ length: count }, (_, i) => (this.cycle + i) / this.rate);
    const cycles = Float64Array.from({ length: count }, (_, i) => this.cycle + i);
    const traces = this.names.map((_, k) => times.map((time) => k + AMPLITUDES[k] * Math.sin((1 + 0.7 * k) * time)));
    this.cycle += count;
    const zeros = new Float64Array(count);
    return { count, lost: 0, times, cycles, latencies: zeros, durations: zeros, traces };
  }
}

// Does something that an engineer does with the scope, chosen by `random`; returns its name.
export function act(scope, source, random) {
  const { view } = scope, [pane] = scope.panes, one = (...of) => of[Math.floor(random() * of.length)];
  const does = {
    roll: () => { scope.run(); roll(scope, source, 0.2 + random()); },
    freeze: () => scope.freeze(),
    pan: () => { scope.freeze(); view.pan((random() - 0.7) * view.span); },
    zoom: () => view.zoom(one(0.3, 0.6, 1.7, 3), view.end - random() * view.span),
    step: () => view.step(one(-1, 1)),
    values: () => { const { low, high } = pane.shown, by = one(0.2, 0.5, 2, 5), at = low + random() * (high - low); pane.scale = { low: at + (low - at) * by, high: at + (high - at) * by }; },
    autoscale: () => pane.refit(),
    theme: () => { const { dataset } = document.documentElement; dataset.theme = dataset.theme === "dark" ? "light" : "dark"; },
    resize: () => Object.assign(scope.box.style, { right: `${Math.floor(random() * 500)}px`, bottom: `${Math.floor(random() * 400)}px` }),
    trace: () => scope.toggle(one(...source.names), pane),
    pane: () => { if (scope.panes.length === 1) scope.addPane(); else scope.removePane(scope.panes[1]); },
  };
  const name = one(...Object.keys(does), "roll", "freeze", "zoom", "values", "values");
  does[name]();
  scope.changed();
  return name;
}

// Pushes cycles of some seconds, and draws about 60 frames a second.
export function roll(scope, source, seconds) {
  const end = source.time + seconds;
  while (source.time < end) {
    scope.live.push(source.next(Math.round(source.rate / 60)), source.names);
    scope.frame(source.time * 1000);
  }
}

// Draws, and waits until the browser shows it.
export async function shown(scope, source) {
  for (let i = 0; i < 3; i++) {
    await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
    scope.frame(source.time * 1000);
  }
  await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
}

// Compares a screenshot (PNG, base64) with the values of the cycles: pixels far from all values must show
// the ground, and the uppermost trace must be seen at its values. Returns the first pixels that do not.
export async function misplaced(scope, png) {
  const { colour, ink, pixel } = await import("/page/drawing/palette.js");
  const image = await createImageBitmap(new Blob([Uint8Array.from(atob(png), (each) => each.charCodeAt(0))]), { colorSpaceConversion: "none" });
  const g = new OffscreenCanvas(image.width, image.height).getContext("2d", { willReadFrequently: true });
  g.drawImage(image, 0, 0);
  const data = new Uint32Array(g.getImageData(0, 0, image.width, image.height).data.buffer);
  const apart = (one, other) => [0, 8, 16].reduce((sum, bits) => sum + Math.abs(((one >> bits) & 255) - ((other >> bits) & 255)), 0);
  const paper = pixel(ink("paper")), ground = new Set([paper, pixel(ink("grid"))]), store = scope.live, found = [];
  const NEAR = 4; // rows
  scope.panes.forEach((pane, index) => {
    const { sight } = pane, { left, top } = pane.plot.getBoundingClientRect(), { seconds } = sight;
    for (let x = 1; x < sight.width - 1; x++) {
      const begin = (sight.first + x) * seconds;
      // The cycles of this column and of those beside it, and one more at each side.
      const from = Math.max(store.find(begin - seconds) - 1, store.begin), to = Math.min(store.find(begin + 2 * seconds) + 1, store.end);
      const bands = pane.traces.map(({ name, number }) => {
        let low = Infinity, high = -Infinity;
        for (let at = from; at < to; at++) {
          const row = sight.row(store.column(name).get(at));
          low = Math.min(low, row);
          high = Math.max(high, row);
        }
        return { low: low - NEAR, high: high + NEAR, ink: pixel(colour(number)) };
      });
      let isSeen = false;
      const last = bands.at(-1);
      for (let y = 0; y < sight.height; y++) {
        const value = data[(Math.round(top) + y) * image.width + Math.round(left) + x];
        const is = bands.some(({ low, high }) => y >= low && y <= high);
        if (!is && !ground.has(value)) found.push({ pane: index, x, y, pixel: value.toString(16), why: "ink far from all values" });
        if (last && y >= last.low && y <= last.high && apart(value, last.ink) < apart(paper, last.ink) / 2) isSeen = true;
      }
      const isInside = last && last.low > 0 && last.high < sight.height && begin - seconds > store.firstTime && begin + 2 * seconds < store.lastTime;
      if (isInside && !isSeen) found.push({ pane: index, x, why: "the trace is not seen at its values", low: last.low, high: last.high });
    }
  });
  return found;
}
