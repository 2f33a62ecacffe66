// Derived signals: "=" and an expression of signals, as in "= d(/arm.q[0]) - /arm.dq[0]".
// Functions keep their state from cycle to cycle, and restart after missing cycles.
const LONGEST = 500; // characters

const pure = (f) => () => (dt, ...values) => f(...values);
// For each function the number of its arguments, and a factory of (seconds since the last cycle, arguments) => value.
const FUNCTIONS = {
  d: [1, () => { let last = NaN; return (dt, x) => { const rate = (x - last) / dt; last = x; return rate; }; }],
  diff: [1, () => { let last = NaN; return (dt, x) => { const step = x - last; last = x; return step; }; }],
  integral: [1, () => { let sum = 0; return (dt, x) => { if (isFinite(x * dt)) sum += x * dt; return sum; }; }],
  low: [2, lowPass],
  high: [2, () => { const low = lowPass(); return (dt, x, hertz) => x - low(dt, x, hertz); }],
  abs: [1, pure(Math.abs)], sqrt: [1, pure(Math.sqrt)], sin: [1, pure(Math.sin)], cos: [1, pure(Math.cos)],
  exp: [1, pure(Math.exp)], log: [1, pure(Math.log)], atan2: [2, pure(Math.atan2)],
  min: [2, pure(Math.min)], max: [2, pure(Math.max)],
};

const FILTERS = ["low", "high"]; // their second argument is a frequency

// A first-order low-pass filter with the corner frequency `hertz`.
function lowPass() {
  let y = NaN;
  return (dt, x, hertz) => {
    y = isFinite(y) && isFinite(dt) ? y + (1 - Math.exp(-2 * Math.PI * hertz * dt)) * (x - y) : x;
    return y;
  };
}

const NUMBER = /(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?/y;
const WORD = /[A-Za-z]\w*/y;
const SIGNAL = /(?:\/[A-Za-z]\w*)+\.[A-Za-z_]\w*(?:\.[A-Za-z_]\w*|\[(?:\d+|state)\])*/y;
const CYCLE = ["latency", "duration"]; // properties of a cycle; their signals are "~latency" and "~duration"

export const isDerived = (name) => name.startsWith("=");

// Returns {signals, start}; `start` returns a function of (value of a signal by name, seconds since
// the last cycle). Throws an Error with a message of one line.
const known = new Map();
export function derived(name) {
  if (!known.has(name)) known.set(name, new Parser(name.slice(1)).parse());
  return known.get(name);
}

// Returns the error of an expression, one line; empty if it is valid.
export function errorOf(name) {
  try { derived(name); } catch (error) { return error.message; }
  return "";
}

// Returns the signals that traces need, each once.
export function sources(names) {
  return [...new Set(names.flatMap((name) => (isDerived(name) ? derived(name).signals : [name])))];
}

class Parser {
  constructor(text) {
    this.text = text.trim();
    this.at = 0;
    this.signals = new Set();
    this.reads = 0; // of signals so far
  }

  parse() {
    if (this.text.length > LONGEST) this.#fail(`an expression has ${LONGEST} characters at most`);
    const make = this.#sum();
    if (this.#peek()) this.#fail(`"${this.#peek()}" is not expected ${this.#where()}`);
    if (!this.signals.size) this.#fail("it has no signal, such as /wave.wave");
    return { signals: [...this.signals], start: make };
  }

  #fail(reason) {
    const text = this.text.length > 80 ? `${this.text.slice(0, 80)}…` : this.text;
    throw new Error(`= ${text}: ${reason}`);
  }

  #where() { return this.at ? `after "${this.text.slice(Math.max(this.at - 12, 0), this.at).trim()}"` : "at the beginning"; }

  #peek() {
    while (this.text[this.at] === " ") this.at++;
    return this.text[this.at] ?? "";
  }

  #take(signs) {
    const sign = this.#peek();
    if (!sign || !signs.includes(sign)) return "";
    this.at++;
    return sign;
  }

  #match(pattern) {
    this.#peek();
    pattern.lastIndex = this.at;
    const found = pattern.exec(this.text)?.[0] ?? "";
    this.at += found.length;
    return found;
  }

  #sum() {
    let left = this.#product();
    for (let sign; (sign = this.#take("+-−"));) left = both(left, this.#product(), sign === "+" ? (a, b) => a + b : (a, b) => a - b);
    return left;
  }

  #product() {
    let left = this.#sign();
    for (let sign; (sign = this.#take("*/"));) left = both(left, this.#sign(), sign === "*" ? (a, b) => a * b : (a, b) => a / b);
    return left;
  }

  #sign() {
    if (!this.#take("-−")) return this.#power();
    const make = this.#sign();
    return () => { const value = make(); return (get, dt) => -value(get, dt); };
  }

  #power() {
    const base = this.#atom();
    return this.#take("^") ? both(base, this.#sign(), (a, b) => a ** b) : base;
  }

  #atom() {
    if (this.#take("(")) {
      const make = this.#sum();
      this.#close();
      return make;
    }
    const signal = this.#match(SIGNAL);
    if (signal) return this.#signal(signal);
    const number = this.#match(NUMBER);
    if (number) return () => () => Number(number);
    const word = this.#match(WORD);
    if (CYCLE.includes(word)) return this.#signal(`~${word}`);
    if (word) return this.#call(word);
    const sign = this.#peek();
    if (sign === "/") this.#fail(`"${this.text.slice(this.at, this.at + 24)}" is no signal: a signal is named as /wave.wave`);
    return this.#fail(sign ? `"${sign}" is not expected ${this.#where()}` : "it ends too early");
  }

  #signal(name) {
    this.signals.add(name);
    this.reads++;
    return () => (get) => get(name);
  }

  #call(word) {
    if (!Object.hasOwn(FUNCTIONS, word)) this.#fail(`"${word}" is none of the functions ${Object.keys(FUNCTIONS).join(", ")}`);
    const [count, make] = FUNCTIONS[word];
    if (!this.#take("(")) this.#fail(`the arguments of ${word} stand in parentheses`);
    const of = [this.#sum()];
    let last = { at: this.at, reads: this.reads }; // before the last argument
    while (this.#take(",")) { last = { at: this.at, reads: this.reads }; of.push(this.#sum()); }
    if (of.length !== count) this.#fail(`${word} has ${count} argument${count > 1 ? "s" : ""}, not ${of.length}`);
    if (FILTERS.includes(word) && this.reads === last.reads && !(of[1]()(() => NaN, 0) > 0))
      this.#fail(`${word} needs a frequency above 0 Hz, not ${this.text.slice(last.at, this.at).trim()}`);
    this.#close();
    return () => {
      const values = of.map((each) => each()), call = make();
      return (get, dt) => call(dt, ...values.map((each) => each(get, dt)));
    };
  }

  #close() {
    if (!this.#take(")")) this.#fail(`")" is missing ${this.#where()}`);
  }
}

function both(left, right, f) {
  return () => {
    const a = left(), b = right();
    return (get, dt) => f(a(get, dt), b(get, dt));
  };
}
