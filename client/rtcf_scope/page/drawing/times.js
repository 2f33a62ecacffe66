// The numbers below a plot, which move with time.
import { tickText } from "./axes.js";
import { Strip } from "./strip.js";

const LEFT = 14, RIGHT = 40; // CSS pixels at the ends without a number: one has the unit

export class Times {
  constructor(box) {
    this.strip = new Strip("numbers");
    const unit = document.createElement("span");
    unit.className = "unit";
    unit.textContent = "s";
    box.append(this.strip.box, unit);
    this.shown = new Map(); // number of the tick: its element
    this.state = "";
  }

  show(sight) {
    this.strip.move(sight);
    const numbers = labelled(sight);
    const state = `${this.strip.number} ${sight.step} ${numbers[0]} ${numbers.length}`;
    if (state === this.state) return;
    if (!this.state.startsWith(`${this.strip.number} ${sight.step} `)) this.#clear();
    this.state = state;
    const wanted = new Set(numbers);
    for (const [number, element] of this.shown)
      if (!wanted.has(number)) { element.remove(); this.shown.delete(number); }
    for (const number of numbers) {
      if (this.shown.has(number)) continue;
      const element = document.createElement("span");
      element.textContent = tickText(number * sight.step, sight.step);
      element.style.left = this.strip.left(Math.round(sight.column(number * sight.step)));
      this.strip.box.append(element);
      this.shown.set(number, element);
    }
  }

  #clear() {
    for (const element of this.shown.values()) element.remove();
    this.shown.clear();
  }
}

// The numbers of the ticks that have room for a text.
export function labelled(sight) {
  return sight.ticks(sight.first + LEFT * sight.ratio, sight.first + sight.width - RIGHT * sight.ratio);
}
