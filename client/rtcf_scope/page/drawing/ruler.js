// The numbers of a time axis: seconds, the time of day, or the numbers of the cycles.
import { grouped, tickStep, tickText } from "./axes.js";

const EVERY = 110, EVERY_LONG = 150; // CSS pixels from tick to tick, about
const CLOCK = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200, 86400]; // s
const DAY = 86400;
export const RULERS = ["seconds", "clock", "cycles"];

// One for a span of time that is so many CSS pixels wide. `zero` is the time of day (s) of the time 0
// of the axis, null where it is not known; `store` has the cycles, `rate` of them a second.
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

// Ticks of a number of seconds, counted from `zero` before time 0.
class EvenRuler {
  constructor(step, zero, text, unit, room) {
    this.step = step;
    this.zero = zero;
    this.text = ({ value }) => text(value);
    this.unit = unit;
    this.room = room; // CSS pixels at the right end without a number, for the unit
    this.state = `${unit} ${step} ${zero}`;
  }

  // {key, time, value} of those between two times.
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
    // Where a loop begins anew its numbers do, too.
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

  // Those of the cycles from `first` to before `last`, which count upwards.
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

  // The number of a cycle; a place that is none has that of the last one.
  #cycle(at) {
    const { store } = this, cycle = store.cycle(at);
    return Number.isNaN(cycle) && at > store.begin ? store.cycle(at - 1) : cycle;
  }
}

// Seconds since midnight, as clocks here show them.
export function secondOfDay(ns) {
  const zone = -60 * new Date(Number(ns / 1_000_000n)).getTimezoneOffset();
  return (Number(ns % (BigInt(DAY) * 1_000_000_000n)) / 1e9 + zone + DAY) % DAY;
}

// A time of day, with as many digits as a step of so many seconds needs.
export function clockText(seconds, step) {
  const digits = Math.min(Math.max(Math.ceil(-Math.log10(step) - 1e-9), 0), 9), unit = 10 ** digits;
  const units = Math.round((seconds - Math.floor(seconds / DAY) * DAY) * unit) % (DAY * unit);
  const whole = Math.floor(units / unit);
  const text = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60].map((each) => String(each).padStart(2, "0")).join(":");
  return digits ? `${text}.${String(units - whole * unit).padStart(digits, "0")}` : text;
}
