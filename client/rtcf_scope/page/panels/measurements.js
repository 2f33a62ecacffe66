// Measurements of each trace, between the cursors or of the visible part.
import { figure, scaled } from "../drawing/axes.js";
import { measured } from "../data/measure.js";
import { colour } from "../drawing/palette.js";

const HEADS = ["", "trace", "last", "A", "B", "B − A", "min", "max", "peak-peak", "mean", "RMS", "frequency", "rise 10–90 %", "overshoot", "settling 2 %"];
const STEP = [["initial", "from", "level before the step"], ["target", "to", "target of the step"], ["zero", "at", "time of the step, s"]];
const MOST_MS = 12; // longest time of one call; the next call continues with the other traces

export class Measurements {
  constructor(scope, box) {
    this.scope = scope;
    this.box = box;
    const table = document.createElement("table");
    const head = table.createTHead().insertRow();
    for (const text of HEADS) {
      const cell = document.createElement("th");
      cell.textContent = text;
      head.append(cell);
    }
    this.caption = table.createCaption();
    this.body = table.createTBody();
    this.steps = new Map(); // {initial, target, zero} by trace
    this.of = document.createElement("select");
    this.fields = STEP.map(([key, text, title]) => this.#field(key, text, title));
    const controls = document.createElement("form");
    controls.className = "controls";
    controls.onsubmit = (event) => event.preventDefault();
    this.of.onchange = () => this.#given();
    this.of.setAttribute("aria-label", "trace of the step");
    const word = document.createElement("label");
    word.append("step of ", this.of);
    controls.append(word, ...this.fields.map((each) => each.parentNode));
    box.append(controls, table);
    this.next = 0; // row
    this.shown = ""; // names of the rows
  }

  show() {
    const { scope } = this;
    const { a, b } = scope.cursors;
    this.#given();
    const both = a !== null && b !== null;
    const begin = both ? Math.min(a, b) : scope.view.begin, end = both ? Math.max(a, b) : scope.view.end;
    say(this.caption, both
      ? `between the cursors: ${scaled(end - begin, "s")}, ${scaled(1 / (end - begin), "Hz")}, ${cycles(scope.store, a, b)} cycles`
      : "of all in sight; a click sets cursor A, with Shift B, a double click takes them away");
    const rows = scope.traces().flatMap((trace) => scope.sources().map((store, second) => ({ trace, store, second })));
    const still = `${rows.map(({ trace, store }) => `${trace.name} ${store.serial}`)} ${a} ${b}`;
    const all = still !== this.shown;
    this.shown = still;
    while (this.body.rows.length > rows.length) this.body.deleteRow(-1);
    while (this.body.rows.length < rows.length) this.#row();
    const until = performance.now() + MOST_MS;
    for (let done = 0; done < rows.length && (all || performance.now() < until); done++) {
      this.next = this.next % rows.length;
      this.#fill(this.body.rows[this.next], rows[this.next], begin, end);
      this.next++;
    }
  }

  // A field for a number of the step; empty = found in the signal.
  #field(key, text, title) {
    const label = document.createElement("label"), input = document.createElement("input");
    Object.assign(input, { size: 8, placeholder: "found", title });
    input.dataset.key = key;
    input.oninput = () => {
      const text = input.value.trim().replace(",", ".").replace("−", "-"), value = text ? Number(text) : NaN;
      const wrong = text !== "" && !isFinite(value);
      input.classList.toggle("wrong", wrong);
      input.title = wrong ? `${input.value.trim()} is no number` : title;
      this.steps.set(this.of.value, { ...this.steps.get(this.of.value), [key]: wrong ? NaN : value });
      this.shown = "";
    };
    label.append(`${text} `, input);
    return input;
  }

  // Shows the traces, and the numbers of the chosen one.
  #given() {
    const names = this.scope.traces().map((each) => each.name);
    if (names.join() !== [...this.of.options].map((each) => each.value).join()) {
      const { value } = this.of;
      this.of.replaceChildren(...names.map((name) => new Option(name)));
      if (names.includes(value)) this.of.value = value;
    }
    for (const field of this.fields) {
      if (field === document.activeElement) continue;
      const value = this.steps.get(this.of.value)?.[field.dataset.key];
      const text = Number.isFinite(value) ? String(value) : "";
      if (field.value !== text && !field.classList.contains("wrong")) field.value = text;
    }
  }

  #row() {
    const row = this.body.insertRow();
    row.insertCell().append(document.createElement("i"));
    for (let i = 1; i < HEADS.length; i++) row.insertCell();
  }

  #fill(row, { trace: { name, number }, store, second }, begin, end) {
    const { scope } = this;
    const { a, b } = scope.cursors;
    const column = store.column(name), unit = scope.unit(name);
    row.cells[0].firstChild.style.background = colour(number);
    const at = (time) => (column && time !== null && !store.empty ? column.get(store.nearest(time)) : NaN);
    const found = column && !store.empty ? measured(store, column, begin, end, this.steps.get(name)) : null;
    const cells = [scope.mode === "recording" ? `${name} · ${scope.recordings[second].name}` : name,
      figure(column && !store.empty ? column.get(scope.mode === "trigger" ? scope.readAt : store.end - 1) : NaN, unit),
      figure(at(a), unit, Math.abs(at(b) - at(a))), figure(at(b), unit, Math.abs(at(b) - at(a))), figure(at(b) - at(a), unit)];
    if (found) cells.push(...[found.min, found.max, found.span, found.mean, found.rms].map((each) => figure(each, unit)),
      scaled(found.frequency, "Hz"), scaled(found.rise, "s"), isFinite(found.overshoot) ? `${figure(found.overshoot)} %` : "–", scaled(found.settling, "s"));
    else cells.push(...Array(9).fill("–"));
    cells.forEach((text, i) => say(row.cells[i + 1], text));
    row.lastChild.title = found?.why ?? "";
  }
}

function say(element, text) { if (element.textContent !== text) element.textContent = text; }

function cycles(store, a, b) { return Math.abs(store.cycle(store.nearest(a)) - store.cycle(store.nearest(b))); }
