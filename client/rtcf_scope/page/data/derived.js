// Derived signals: "=" and an expression of others, as in "= d(/arm.q[0]) - /arm.dq[0]".
// Each function keeps its state from cycle to cycle; where cycles are missing it begins anew.

const PURE = (f) => () => (dt, ...values) => f(...values);
const FUNCTIONS = { // name: how many arguments, and a maker of (seconds since the last cycle, arguments) => value
  abs: [1, PURE(Math.abs)], sqrt: [1, PURE(Math.sqrt)], sin: [1, PURE(Math.sin)], cos: [1, PURE(Math.cos)],
  exp: [1, PURE(Math.exp)], log: [1, PURE(Math.log)], atan2: [2, PURE(Math.atan2)],
  min: [2, PURE(Math.min)], max: [2, PURE(Math.max)],
  diff: [1, () => { let last = NaN; return (dt, x) => { const by = x - last; last = x; return by; }; }],
  d: [1, () => { let last = NaN; return (dt, x) => { const by = (x - last) / dt; last = x; return by; }; }],
  integral: [1, () => { let sum = 0; return (dt, x) => { if (isFinite(x * dt)) sum += x * dt; return sum; }; }],
  low: [2, () => {
    let y = NaN;
    return (dt, x, hertz) => (y = isFinite(y) && isFinite(dt) ? y + (1 - Math.exp(-2 * Math.PI * hertz * dt)) * (x - y) : x);
  }],
  high: [2, () => {
    const low = FUNCTIONS.low[1]();
    return (dt, x, hertz) => x - low(dt, x, hertz);
  }],
};
const TOKEN = /\s*(?:(\d+\.?\d*(?:[eE][-+]?\d+)?|\.\d+(?:[eE][-+]?\d+)?)|([A-Za-z]\w*)|(.))/y;
const SIGNAL = /\s*(\/[\p{L}\p{N}_/]+\.[\p{L}\p{N}_.]+(?:\[(?:\d+|state)\])*)/uy;

export const isDerived = (name) => name.startsWith("=");

// {signals, start() => (value(signal), seconds since the last cycle) => number}; throws Error in one line.
const known = new Map();
export function derived(name) {
  if (!known.has(name)) known.set(name, new Parser(name.slice(1)).parse());
  return known.get(name);
}

// The names of signals that names of traces stand for, each once.
export function sources(names) {
  return [...new Set(names.flatMap((name) => (isDerived(name) ? derived(name).signals : [name])))];
}

class Parser {
  constructor(text) { this.text = text; this.at = 0; this.signals = new Set(); }

  parse() {
    const make = this.#sum();
    if (this.#peek() !== "") this.#fail(`"${this.#peek()}" is not expected there`);
    if (!this.signals.size) this.#fail("it has no signal, as /wave.phase");
    return { signals: [...this.signals], start: make };
  }

  #fail(reason) { throw new Error(`=${this.text.trim()}: ${reason}`); }

  #peek() { return this.text.slice(this.at).trimStart().slice(0, 1); }

  #take(signs) {
    const sign = this.#peek();
    if (!sign || !signs.includes(sign)) return "";
    this.at = this.text.indexOf(sign, this.at) + 1;
    return sign;
  }

  #sum() {
    let left = this.#product();
    for (let sign; (sign = this.#take("+-"));) left = both(left, this.#product(), sign === "+" ? (a, b) => a + b : (a, b) => a - b);
    return left;
  }

  #product() {
    let left = this.#sign();
    for (let sign; (sign = this.#take("*/"));) left = both(left, this.#sign(), sign === "*" ? (a, b) => a * b : (a, b) => a / b);
    return left;
  }

  #sign() {
    if (!this.#take("-")) return this.#power();
    const of = this.#sign();
    return () => { const value = of(); return (get, dt) => -value(get, dt); };
  }

  #power() {
    const base = this.#atom();
    return this.#take("^") ? both(base, this.#sign(), (a, b) => a ** b) : base;
  }

  #atom() {
    if (this.#take("(")) return this.#closed(this.#sum());
    SIGNAL.lastIndex = this.at;
    const signal = SIGNAL.exec(this.text);
    if (signal) {
      this.at = SIGNAL.lastIndex;
      this.signals.add(signal[1]);
      return () => (get) => get(signal[1]);
    }
    TOKEN.lastIndex = this.at;
    const [, number, word, other] = TOKEN.exec(this.text) ?? [];
    this.at = TOKEN.lastIndex;
    if (number) return () => () => Number(number);
    if (["latency", "duration"].includes(word) && this.#peek() !== "(") {
      this.signals.add(`~${word}`);
      return () => (get) => get(`~${word}`);
    }
    if (!word) this.#fail(other ? `"${other}" is not expected there` : "it ends too early");
    return this.#call(word);
  }

  #call(word) {
    const [count, make] = Object.hasOwn(FUNCTIONS, word) ? FUNCTIONS[word] : [0];
    if (!make) this.#fail(`"${word}" is none of the functions ${Object.keys(FUNCTIONS).join(", ")}`);
    if (!this.#take("(")) this.#fail(`${word} has its arguments in parentheses`);
    const of = [this.#sum()];
    while (this.#take(",")) of.push(this.#sum());
    if (of.length !== count) this.#fail(`${word} has ${count} argument${count > 1 ? "s" : ""}`);
    return this.#closed(() => {
      const arguments_ = of.map((each) => each()), call = make();
      return (get, dt) => call(dt, ...arguments_.map((each) => each(get, dt)));
    });
  }

  #closed(make) {
    if (!this.#take(")")) this.#fail("a parenthesis is not closed");
    return make;
  }
}

function both(left, right, f) {
  return () => { const a = left(), b = right(); return (get, dt) => f(a(get, dt), b(get, dt)); };
}
