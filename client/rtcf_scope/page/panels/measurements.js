// Figures of each trace, between the cursors or of all that is in sight.
import { figure, scaled } from "../drawing/axes.js";
import { measured } from "../data/measure.js";
import { colour } from "../drawing/palette.js";

const HEADS = ["", "trace", "A", "B", "B − A", "min", "max", "peak-peak", "mean", "RMS", "frequency", "rise 10–90 %", "overshoot", "settling 2 %"];

export class Measurements {
  constructor(scope, box) { this.scope = scope; this.box = box; }

  show() {
    const { scope } = this;
    const { a, b } = scope.cursors;
    const both = a !== null && b !== null;
    const begin = both ? Math.min(a, b) : scope.view.begin, end = both ? Math.max(a, b) : scope.view.end;
    const caption = document.createElement("caption");
    caption.textContent = both
      ? `between the cursors: ${scaled(end - begin, "s")}, ${scaled(1 / (end - begin), "Hz")}, ${cycles(scope.store, a, b)} cycles`
      : "of all in sight; a click sets cursor A, with Shift B, a double click takes them away";
    const table = document.createElement("table");
    const head = table.createTHead().insertRow();
    for (const text of HEADS) {
      const cell = document.createElement("th");
      cell.textContent = text;
      head.append(cell);
    }
    const body = table.createTBody();
    const sources = scope.sources();
    for (const trace of scope.traces())
      sources.forEach((store, second) => this.#row(body.insertRow(), trace, store, begin, end, second));
    table.append(caption);
    this.box.replaceChildren(table);
  }

  #row(row, { name, number }, store, begin, end, second) {
    const { scope } = this;
    const { a, b } = scope.cursors;
    const column = store.column(name), unit = scope.unit(name);
    const dot = document.createElement("i");
    dot.style.background = colour(number);
    row.insertCell().append(dot);
    row.insertCell().textContent = scope.mode === "recording" ? `${name} · ${scope.recordings[second].name}` : name;
    const at = (time) => (column && time !== null && !store.empty ? column.get(store.nearest(time)) : NaN);
    const found = column && !store.empty ? measured(store, column, begin, end) : null;
    const cells = [figure(at(a), unit), figure(at(b), unit), figure(at(b) - at(a), unit)];
    if (found) cells.push(...[found.min, found.max, found.span, found.mean, found.rms].map((each) => figure(each, unit)),
      scaled(found.frequency, "Hz"), scaled(found.rise, "s"), isFinite(found.overshoot) ? `${figure(found.overshoot)} %` : "–", scaled(found.settling, "s"));
    else cells.push(...Array(9).fill("–"));
    for (const text of cells) row.insertCell().textContent = text;
  }
}

function cycles(store, a, b) { return Math.abs(store.cycle(store.nearest(a)) - store.cycle(store.nearest(b))); }
