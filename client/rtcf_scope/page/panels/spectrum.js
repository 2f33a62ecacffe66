// The spectrum of each trace, of the visible values or those between the cursors.
import { figure, scaled, tickText, ticks } from "../drawing/axes.js";
import { blank } from "../drawing/canvas.js";
import { highest, peak, spectrum } from "../data/fft.js";
import { values } from "../data/measure.js";
import { colour, ink } from "../drawing/palette.js";
import { Throttle } from "./throttle.js";

const AREA = { left: 64, top: 8, right: 12, bottom: 22 };
const DECADES = 5;

export class Spectrum {
  constructor(scope, canvas) {
    this.scope = scope;
    this.canvas = canvas;
    this.pointer = null;
    this.isLog = true;
    this.found = [];
    this.throttle = new Throttle();
    canvas.onpointermove = (event) => { this.pointer = event.offsetX; this.#draw(); };
    canvas.onpointerleave = () => { this.pointer = null; this.#draw(); };
    this.button = document.createElement("button");
    this.button.className = "corner";
    this.button.onclick = () => { this.isLog = !this.isLog; this.#draw(); };
    canvas.parentElement.append(this.button);
  }

  show() {
    this.throttle.run(() => { this.found = this.#spectra(); });
    this.#draw();
  }

  #draw() {
    const { canvas, found } = this;
    this.button.textContent = this.isLog ? "log" : "linear";
    this.button.title = "frequencies: logarithmic or linear";
    const { g, width, height } = blank(canvas);
    if (!found.length) {
      g.fillStyle = ink("soft");
      g.fillText("no spectrum: choose a signal, and at least 16 cycles in sight", AREA.left, 30);
      return;
    }
    const most = Math.max(...found.map(({ of }) => of.amplitudes[highest(of)]), 1e-12);
    const top = Math.ceil(Math.log10(most) + 1e-9), bottom = top - DECADES;
    const from = Math.min(...found.map(({ of }) => of.resolution));
    const limit = Math.max(...found.map(({ of }) => of.step * of.amplitudes.length));
    const w = width - AREA.left - AREA.right, h = height - AREA.top - AREA.bottom;
    const decades = Math.log10(limit / from);
    const axis = { w, h, top, bottom, from, limit,
      x: this.isLog ? (hertz) => AREA.left + Math.log10(hertz / from) / decades * w : (hertz) => AREA.left + hertz / limit * w,
      hertz: this.isLog ? (x) => from * 10 ** ((x - AREA.left) / w * decades) : (x) => (x - AREA.left) / w * limit,
      y: (size) => AREA.top + (top - Math.max(Math.log10(size), bottom)) / (top - bottom) * h };
    this.#axes(g, axis);
    g.save();
    g.beginPath();
    g.rect(AREA.left, AREA.top, w, h);
    g.clip();
    for (const { number, of } of found) {
      g.strokeStyle = colour(number);
      g.lineWidth = 1.3;
      g.beginPath();
      for (const [x, y] of this.#line(of, axis)) g.lineTo(x, y);
      g.stroke();
    }
    g.restore();
    this.#point(g, axis);
  }

  #spectra() {
    const { scope } = this;
    const { a, b } = scope.cursors;
    const both = a !== null && b !== null;
    const begin = both ? Math.min(a, b) : scope.view.begin, end = both ? Math.max(a, b) : scope.view.end;
    const found = [];
    for (const { name, number } of scope.traces()) {
      const column = scope.store.column(name);
      if (!column || scope.store.empty) continue;
      const part = values(scope.store, column, begin, end);
      if (part.values.length < 16) continue;
      const rate = (part.values.length - 1) / (part.times.at(-1) - part.times[0]);
      const of = spectrum(part.values, rate);
      if (of) found.push({ name, number, of });
    }
    return found;
  }

  // The points of the line: the highest one in each pixel.
  #line({ amplitudes, step }, { x, y }) {
    const points = [];
    let pixel = -1, most = 0;
    for (let i = 1; i < amplitudes.length; i++) {
      const at = Math.round(x(i * step));
      if (at === pixel) {
        if (amplitudes[i] <= most) continue;
        points.pop();
      } else pixel = at;
      most = amplitudes[i];
      points.push([x(i * step), y(most)]);
    }
    return points;
  }

  #axes(g, { w, h, top, bottom, from, limit, x, y }) {
    g.strokeStyle = ink("grid");
    g.fillStyle = ink("soft");
    g.beginPath();
    g.textAlign = "right";
    for (let power = bottom; power <= top; power++) {
      const place = Math.round(y(10 ** power)) + 0.5;
      g.moveTo(AREA.left, place); g.lineTo(AREA.left + w, place);
      g.fillText(power >= -3 && power <= 3 ? String(Number((10 ** power).toPrecision(1))) : `1e${power}`, AREA.left - 6, place + 4);
    }
    g.textAlign = "center";
    for (const { hertz, text } of this.isLog ? decadeTicks(from, limit) : linearTicks(limit, w)) {
      g.moveTo(Math.round(x(hertz)) + 0.5, AREA.top); g.lineTo(Math.round(x(hertz)) + 0.5, AREA.top + h);
      if (text && x(hertz) < AREA.left + w - 40) g.fillText(text, x(hertz), AREA.top + h + 15);
    }
    g.stroke();
    g.textAlign = "right";
    g.fillText("Hz", AREA.left + w, AREA.top + h + 15);
    g.textAlign = "left";
    g.strokeStyle = ink("axis");
    g.strokeRect(AREA.left + 0.5, AREA.top + 0.5, w, h);
  }

  // Marks the highest peak of each trace, or the point below the mouse.
  #point(g, { w, x, y, hertz }) {
    g.textAlign = "left";
    this.found.slice(0, 8).forEach(({ name, number, of }, row) => {
      const at = this.pointer === null ? highest(of)
        : Math.min(Math.max(Math.round(hertz(this.pointer) / of.step), 1), of.amplitudes.length - 1);
      const { frequency, amplitude } = this.pointer === null ? peak(of, at) : { frequency: at * of.step, amplitude: of.amplitudes[at] };
      g.fillStyle = colour(number);
      g.beginPath();
      g.arc(x(frequency), y(amplitude), 3.5, 0, 7);
      g.fill();
      const text = `${name}  ${hertzText(frequency, of.resolution)}  ${figure(amplitude, this.scope.unit(name))}`;
      g.fillText(text, AREA.left + w - g.measureText(text).width - 10, AREA.top + 16 + row * 15);
    });
    g.fillStyle = ink("soft");
    g.fillText(`Hann's window; resolution ${scaled(this.found[0].of.resolution, "Hz")}`, AREA.left + 70, AREA.top + 16);
  }
}

// The text of a peak's frequency, which is accurate to a hundredth of the resolution.
export function hertzText(frequency, resolution) {
  const unit = 10 ** Math.floor(Math.log10(resolution / 100) + 1e-9);
  return scaled(Math.round(frequency / unit) * unit, "Hz");
}

function linearTicks(limit, w) {
  const { at, step } = ticks(0, limit, w / 110);
  return at.map((hertz) => ({ hertz, text: tickText(hertz, step) }));
}

// In each decade, 1, 2 and 5 have numbers, and all ticks have lines.
function decadeTicks(from, limit) {
  const found = [];
  for (let power = Math.floor(Math.log10(from)); 10 ** power <= limit; power++)
    for (let n = 1; n < 10; n++) {
      const hertz = n * 10 ** power;
      if (hertz >= from && hertz <= limit) found.push({ hertz, text: n === 1 || n === 2 || n === 5 ? String(Number(hertz.toPrecision(2))) : "" });
    }
  return found;
}
