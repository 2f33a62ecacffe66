// The numbers of a time axis: seconds, the time of day, or the numbers of the cycles.
import { grouped, tickStep, tickText } from "./axes.js";

const EVERY = 110, EVERY_LONG = 150; // approximate distance of ticks, CSS pixels
const CLOCK = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200, 86400]; // s
const DAY = 86400;
export const RULERS = ["seconds", "clock", "cycles"];

// Returns a ruler for `span` seconds on `width` CSS pixels. `zero` is the time of day (s) at time 0 of
// the axis, null if unknown; `store` has the cycles; `rate` is their number per second.
export function rulerOf(kind, { span, width, zero, store, rate }) {
  if (kind === "cycles" && !store.empty) return new CycleRuler(Math.max(1, tickStep(span * rate, Math.max(2, width / EVERY))), store);
  if (kind === "clock" && zero !== null) {
    const wanted = span / Math.max(2, width / EVERY);
    const step = wanted < 1 ? tickStep(span, Math.max(2, width / (wanted < 1e-3 ? EVERY_LONG : EVERY))) : CLOCK.find((each) => each >= wanted * 0.999) ?? DAY;
    return new EvenRuler(step, zero, (time) => clockText(time, step), "clock", 36 + 3.2 * clockText(0, step).length);
  }
  const step = tickStep(span, Math.max(2, width / EVERY));
  return new EvenRuler(step, 0, (time) => tickText(time, step), "s", 40);
}

// Ticks at multiples of a number of seconds, counted from `zero` before time 0.
class EvenRuler {
  constructor(step, zero, text, unit, room) {
    this.step = step;
    this.zero = zero;
    this.text = ({ value }) => text(value);
    this.unit = unit;
    this.room = room; // CSS pixels at the right end without a number, for the unit
    this.state = `${unit} ${step} ${zero}`;
  }

  // The ticks between two times: {key, time, value}.
  ticks(begin, end) {
    const { step, zero } = this, found = [];
    for (let n = Math.ceil((begin + zero) / step); n * step <= end + zero; n++) found.push({ key: n, time: n * step - zero, value: n * step });
    return found;
  }
}

// Ticks at cycles whose numbers are round.
class CycleRuler {
  constructor(step, store) {
    this.step = step;
    this.store = store;
    this.unit = "cycle";
    this.room = 64;
    this.state = `cycle ${step} ${store.serial}`;
  }

  ticks(begin, end) {
    const { store } = this, found = [];
    // Cycle numbers restart with the loop.
    let from = begin;
    for (const gap of store.gaps) {
      const to = gap.to + store.shift;
      if (to <= from || to > end) continue;
      this.#add(found, store.find(from), store.find(to));
      from = to;
    }
    const last = store.find(end);
    this.#add(found, store.find(from), last < store.end && store.time(last) <= end ? last + 1 : last);
    return found;
  }

  text({ value }) { return grouped(tickText(value, 1)); }

  // Adds the ticks of the cycles [first, last), whose numbers increase.
  #add(found, first, last) {
    if (last <= first) return;
    const { step, store } = this;
    for (let n = Math.ceil(this.#cycle(first) / step); n * step <= this.#cycle(last - 1); n++) {
      let low = first, high = last - 1;
      while (low < high) {
        const middle = Math.floor((low + high) / 2);
        if (this.#cycle(middle) < n * step) low = middle + 1; else high = middle;
      }
      const time = store.time(low);
      found.push({ key: `${n} ${time}`, time, value: n * step });
    }
  }

  // Returns the number of the cycle at a place; without a cycle there, that of the last one.
  #cycle(at) {
    const { store } = this, cycle = store.cycle(at);
    return Number.isNaN(cycle) && at > store.begin ? store.cycle(at - 1) : cycle;
  }
}

// Seconds since midnight, local time.
export function secondOfDay(ns) {
  const zone = -60 * new Date(Number(ns / 1_000_000n)).getTimezoneOffset();
  return (Number(ns % (BigInt(DAY) * 1_000_000_000n)) / 1e9 + zone + DAY) % DAY;
}

// The text of a time of day, with the digits that a step of `step` seconds needs.
export function clockText(seconds, step) {
  const digits = Math.min(Math.max(Math.ceil(-Math.log10(step) - 1e-9), 0), 9), unit = 10 ** digits;
  const units = Math.round((seconds - Math.floor(seconds / DAY) * DAY) * unit) % (DAY * unit);
  const whole = Math.floor(units / unit);
  const text = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60].map((each) => String(each).padStart(2, "0")).join(":");
  return digits ? `${text}.${String(units - whole * unit).padStart(digits, "0")}` : text;
}
