// The spectrum of each trace, of what is in sight or between the cursors.
import { figure, scaled, tickText, ticks } from "../drawing/axes.js";
import { blank } from "../drawing/canvas.js";
import { spectrum } from "../data/fft.js";
import { values } from "../data/measure.js";
import { colour, ink } from "../drawing/palette.js";

const AREA = { left: 64, top: 8, right: 12, bottom: 22 };
const DECADES = 5;

export class Spectrum {
  constructor(scope, canvas) {
    this.scope = scope;
    this.canvas = canvas;
    this.pointer = null;
    canvas.onpointermove = (event) => { this.pointer = event.offsetX; this.show(); };
    canvas.onpointerleave = () => { this.pointer = null; this.show(); };
  }

  show() {
    const { canvas, scope } = this;
    const { g, width, height } = blank(canvas);
    const found = this.#spectra();
    if (!found.length) {
      g.fillStyle = ink("soft");
      g.fillText("no spectrum: choose a signal, and at least 16 cycles in sight", AREA.left, 30);
      return;
    }
    const most = Math.max(...found.map(({ of }) => Math.max(...of.amplitudes)), 1e-12);
    const top = Math.ceil(Math.log10(most)), bottom = top - DECADES;
    const limit = Math.max(...found.map(({ of }) => of.step * of.amplitudes.length));
    const w = width - AREA.left - AREA.right, h = height - AREA.top - AREA.bottom;
    const x = (hertz) => AREA.left + hertz / limit * w;
    const y = (size) => AREA.top + (top - Math.max(Math.log10(size), bottom)) / (top - bottom) * h;
    this.#axes(g, { w, h, top, bottom, limit, x, y });
    for (const { number, of } of found) {
      g.strokeStyle = colour(number);
      g.lineWidth = 1.3;
      g.beginPath();
      for (let i = 1; i < of.amplitudes.length; i++) g.lineTo(x(i * of.step), y(of.amplitudes[i]));
      g.stroke();
    }
    this.#point(g, found, limit, w, x, y, h);
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

  #axes(g, { w, h, top, bottom, limit, x, y }) {
    g.strokeStyle = ink("grid");
    g.fillStyle = ink("soft");
    g.beginPath();
    g.textAlign = "right";
    for (let power = bottom; power <= top; power++) {
      const place = Math.round(y(10 ** power)) + 0.5;
      g.moveTo(AREA.left, place); g.lineTo(AREA.left + w, place);
      g.fillText(power >= -3 && power <= 3 ? String(Number((10 ** power).toPrecision(1))) : `1e${power}`, AREA.left - 6, place + 4);
    }
    const columns = ticks(0, limit, w / 110);
    g.textAlign = "center";
    for (const hertz of columns.at) {
      g.moveTo(Math.round(x(hertz)) + 0.5, AREA.top); g.lineTo(Math.round(x(hertz)) + 0.5, AREA.top + h);
      if (x(hertz) < AREA.left + w - 40) g.fillText(tickText(hertz, columns.step), x(hertz), AREA.top + h + 15);
    }
    g.stroke();
    g.textAlign = "right";
    g.fillText("Hz", AREA.left + w, AREA.top + h + 15);
    g.textAlign = "left";
    g.strokeStyle = ink("axis");
    g.strokeRect(AREA.left + 0.5, AREA.top + 0.5, w, h);
  }

  // The highest peak of each, or what the mouse points at.
  #point(g, found, limit, w, x, y, h) {
    g.textAlign = "left";
    found.slice(0, 8).forEach(({ name, number, of }, row) => {
      let at = 1;
      if (this.pointer !== null) at = Math.min(Math.max(Math.round((this.pointer - AREA.left) / w * limit / of.step), 1), of.amplitudes.length - 1);
      else for (let i = 2; i < of.amplitudes.length; i++) if (of.amplitudes[i] > of.amplitudes[at]) at = i;
      g.fillStyle = colour(number);
      g.beginPath();
      g.arc(x(at * of.step), y(of.amplitudes[at]), 3.5, 0, 7);
      g.fill();
      const text = `${name}  ${scaled(at * of.step, "Hz")}  ${figure(of.amplitudes[at], this.scope.unit(name))}`;
      g.fillText(text, AREA.left + w - g.measureText(text).width - 10, AREA.top + 16 + row * 15);
    });
  }
}
