// The readout at the pointer: a line at its time in all panes, and a box with the values at this time
// of the traces of its pane. The trace nearest to the pointer is bold.
import { figure } from "./axes.js";
import { colour } from "./palette.js";
import { clockText } from "./ruler.js";
import { LEFT, TOP } from "./values.js";

const OFTEN_MS = 100; // interval of updates while values move below the pointer
const ROW = 17, HEAD = 30, AWAY = 14; // CSS pixels

export class Readout {
  constructor(pane, scope) {
    this.pane = pane;
    this.scope = scope;
    this.line = element("div", "hair");
    this.box = element("div", "readout");
    this.head = element("p", "");
    this.rows = element("div", "");
    this.box.append(this.head, this.rows);
    this.line.hidden = this.box.hidden = true;
    pane.plot.append(this.line);
    pane.face.append(this.box);
    this.y = null; // y of the pointer in the plot; null = it is in another pane
    this.next = 0;
  }

  // Sets the position of the pointer in the plot, CSS pixels.
  point(x, y) {
    this.x = x;
    this.y = y;
    this.next = 0;
    this.line.hidden = false;
    this.line.style.transform = `translateX(${Math.round(x)}px)`;
    this.box.hidden = y === null;
  }

  leave() { this.line.hidden = this.box.hidden = true; }

  // Called for each frame.
  show(now = performance.now()) {
    const { pane, scope } = this, { sight, size } = pane;
    if (this.box.hidden || now < this.next) return;
    this.next = now + OFTEN_MS;
    const time = sight.time(this.x), sources = scope.sources(), [store] = sources;
    const at = store.nearest(time);
    if (at < 0) { this.box.hidden = true; return; }
    const there = store.time(at), origin = scope.secondOfDay();
    say(this.head, [`${figure(there)} s`, origin === null ? "" : clockText(origin + there, Math.min(sight.seconds, 1e-3)),
      Number.isNaN(store.cycle(at)) ? "" : `cycle ${store.cycle(at)}`].filter(Boolean).join(" · "));
    const traces = this.#near(pane.drawn.map((trace) => this.#read(trace, sources, time)));
    while (this.rows.children.length > traces.length) this.rows.lastChild.remove();
    while (this.rows.children.length < traces.length) this.#row();
    const nearest = traces.reduce((one, other) => (other.away < one.away ? other : one), { away: Infinity });
    traces.forEach((trace, i) => {
      const row = this.rows.children[i], [dot, name, value] = row.children;
      dot.style.background = colour(trace.number);
      say(name, trace.name);
      say(value, trace.text);
      row.classList.toggle("nearest", trace === nearest);
    });
    const right = this.x > size.width / 2, low = this.y > size.height / 2, { style } = this.box;
    style.left = right ? "" : `${LEFT + this.x + AWAY}px`;
    style.right = right ? `${pane.face.clientWidth - LEFT - this.x + AWAY}px` : "";
    style.top = low ? "" : `${TOP + this.y + 6}px`;
    style.bottom = low ? `${pane.face.clientHeight - TOP - this.y + 6}px` : "";
  }

  // Returns a trace's value in each source, and the distance of its line from the pointer.
  #read({ name, number, sight }, sources, time) {
    const values = sources.map((store) => {
      const column = store.column(name), at = store.nearest(time);
      return column && at >= 0 ? column.get(at) : NaN;
    });
    const away = Math.min(...values.map((value) => (Number.isFinite(value) ? Math.abs(sight.y(value) - this.y) : Infinity)));
    return { name, number, away, text: values.map((value) => figure(value, this.scope.unit(name))).join(" | ") };
  }

  // Returns the traces nearest to the pointer, as many as fit.
  #near(traces) {
    const { size } = this.pane, room = Math.max(1, Math.floor((Math.max(this.y, size.height - this.y) - HEAD) / ROW));
    if (traces.length <= room) return traces;
    const kept = new Set([...traces].sort((one, other) => one.away - other.away).slice(0, room));
    return traces.filter((each) => kept.has(each));
  }

  #row() {
    const row = element("p", "");
    row.append(element("i", ""), element("span", ""), element("b", ""));
    this.rows.append(row);
  }
}

function say(element, text) { if (element.textContent !== text) element.textContent = text; }

function element(name, kind) {
  const made = document.createElement(name);
  if (kind) made.className = kind;
  return made;
}
