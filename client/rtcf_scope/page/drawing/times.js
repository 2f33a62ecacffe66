// The numbers below a plot, which move with time, and their unit, a button that selects another kind.
import { Strip } from "./strip.js";

const LEFT = 14; // CSS pixels at the left end without a number

export class Times {
  constructor(box, change) { // change() is called when the user wants another kind
    this.strip = new Strip("numbers");
    this.unit = document.createElement("button");
    this.unit.className = "unit";
    this.unit.title = "seconds, time of day or cycle number (X)";
    this.unit.onclick = change;
    box.append(this.strip.box, this.unit);
    this.shown = new Map(); // key of the tick: its element
    this.state = "";
  }

  show(sight) {
    this.strip.move(sight);
    const { ruler } = sight;
    if (this.unit.textContent !== ruler.unit) this.unit.textContent = ruler.unit;
    const ticks = labelled(sight);
    const kind = `${this.strip.number} ${ruler.state} `, state = `${kind}${ticks[0]?.key} ${ticks.at(-1)?.key} ${ticks.length}`;
    if (state === this.state) return;
    if (!this.state.startsWith(kind)) this.#clear();
    this.state = state;
    const wanted = new Set(ticks.map(({ key }) => key));
    for (const [key, element] of this.shown)
      if (!wanted.has(key)) { element.remove(); this.shown.delete(key); }
    for (const tick of ticks) {
      if (this.shown.has(tick.key)) continue;
      const element = document.createElement("span");
      element.textContent = ruler.text(tick);
      element.style.left = this.strip.left(Math.round(sight.column(tick.time)));
      this.strip.box.append(element);
      this.shown.set(tick.key, element);
    }
  }

  #clear() {
    for (const element of this.shown.values()) element.remove();
    this.shown.clear();
  }
}

// The ticks that have room for a text.
export function labelled(sight) {
  return sight.ticks(sight.first + LEFT * sight.ratio, sight.first + sight.width - sight.ruler.room * sight.ratio);
}
