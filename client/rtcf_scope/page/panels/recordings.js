// Recordings: the first one replaces the stream, a second one is drawn over it.
import { ask, recorded } from "../server.js";
import { sources } from "../data/derived.js";
import { Store } from "../data/store.js";

const CHOSEN = 4; // signals

export class Recordings {
  constructor(scope, box, setError) {
    this.scope = scope;
    this.box = box;
    this.setError = setError;
    this.open = []; // {name, signals, beginNs, shift}
    this.shift = null; // the field for the shift; null unless there are two recordings
    this.alsoNeeded = () => []; // signals that are read besides those of the panes
    scope.onShift = (seconds) => {
      const [, second] = this.open;
      if (second) second.shift = seconds;
      this.#tellShift();
    };
  }

  async show() {
    // An older rtcfd, or one that does not run, has no list of incidents.
    const [names, incidents] = await Promise.all([ask("/api/recordings"), ask("/api/incidents").catch(() => [])]);
    const list = document.createElement("div");
    const add = (name, title) => {
      const button = document.createElement("button");
      button.className = "leaf";
      button.title = title;
      button.setAttribute("aria-pressed", String(this.open.some((each) => each.name === name)));
      button.append(Object.assign(document.createElement("span"), { textContent: name }));
      button.onclick = () => this.toggle(name);
      list.append(button);
    };
    for (const name of names) add(name, "");
    if (incidents.length) list.append(Object.assign(element("p", "hint"), { textContent: "Incidents" }));
    for (const { name, reason } of incidents) add(name, reason);
    const hint = document.createElement("p");
    hint.className = "hint";
    hint.textContent = names.length || incidents.length ? "Choose one; a second one is drawn dashed over it, from the same beginning."
      : "None: rtcfctl scope FILE… opens recordings, made by rtcfctl record -o FILE.";
    this.shift = null;
    this.box.replaceChildren(list, hint, ...(this.open.length === 2 ? this.#shifting() : []));
    this.#tellShift();
  }

  // Shows the shift of the second recording relative to the first.
  #shifting() {
    const { scope } = this, [first, second] = this.open;
    const label = element("label", "shift"), bar = element("div", "group");
    this.shift = Object.assign(element("input", ""), { type: "number", step: "any" });
    this.shift.setAttribute("aria-label", `shift of ${second.name}, seconds`);
    this.shift.onchange = () => scope.shiftSecond(Number(this.shift.value));
    label.append(Object.assign(element("span", ""), { textContent: `shift of ${second.name}` }), this.shift, " s");
    const button = (text, title, does) => {
      const made = Object.assign(element("button", ""), { textContent: text, title, onclick: does });
      bar.append(made);
      return made;
    };
    button("Beginning", "the same beginning: no shift", () => scope.shiftSecond(0));
    button("Clock", "the same clock: as they were recorded", () => scope.shiftSecond(Number(second.beginNs - first.beginNs) / 1e9));
    button("A → B", "moves what is at cursor A to cursor B", () => {
      const { a, b } = scope.cursors;
      if (a === null || b === null) { this.setError("set cursor A (click) on the second recording and cursor B (Shift and click) on the first"); return; }
      this.setError("");
      scope.shiftSecond(scope.recordings[1].shift + b - a);
    });
    const hint = element("p", "hint");
    hint.textContent = "Dragging with Alt shifts it, too.";
    return [label, bar, hint];
  }

  #tellShift() {
    if (this.shift && this.shift !== document.activeElement) this.shift.value = Number((this.open[1]?.shift ?? 0).toFixed(9));
  }

  // Opens an incident alone, at its end; empty panes show the component that failed.
  async openIncident(name) {
    this.open = [];
    this.scope.recordings = [];
    await this.toggle(name);
  }

  async toggle(name) {
    try {
      const there = this.open.findIndex((each) => each.name === name);
      if (there >= 0) this.open.splice(there, 1);
      else {
        const found = await ask(`/api/recordings/${encodeURIComponent(name)}`);
        this.open = [...this.open.slice(-1), { ...found, beginNs: BigInt(found.begin_ns) }];
        this.#choose(found);
      }
      for (const each of this.open) each.shift = 0;
      await this.load();
      await this.show();
    } catch (error) { this.setError(error.message); }
  }

  // Shows signals of the component that failed in a page without traces.
  #choose({ signals, incident }) {
    const { scope } = this;
    if (!incident || scope.traces().length) return;
    const own = signals.filter(({ name }) => name.startsWith(`${incident.component}.`));
    scope.know(signals);
    for (const { name } of (own.length ? own : signals).slice(0, CHOSEN)) scope.active.add(name);
  }

  // Reads the traces of the panes.
  async load() {
    const { scope } = this;
    const named = [...scope.traces().map((each) => each.name), ...this.alsoNeeded()];
    const wanted = sources([...new Set(named)]).filter((name) => !name.startsWith("~"));
    for (const { signals } of this.open) scope.know(signals);
    scope.showRecordings(await Promise.all(this.open.map((each) => Opened.of(each, wanted, scope.view))));
  }

  // Reads each visible cycle of a recording that is too large to read as a whole; called a few times a second.
  async loadVisible() {
    try {
      for (const each of this.scope.recordings) if (await each.loadVisible()) this.scope.changed();
    } catch (error) { this.setError(error.message); }
  }

  // The signals of the open recordings, by name.
  catalog() {
    const found = new Map();
    for (const { signals } of this.open) for (const signal of signals) found.set(signal.name, signal);
    return [...found.values()];
  }
}

// An open recording: an overview, and the visible part in detail.
class Opened {
  static async of(description, wanted, view) {
    const { name, beginNs, events = [], incident = null } = description, opened = new Opened();
    Object.assign(opened, { name, beginNs, events, incident, wanted, view, all: await part(name, wanted), close: null, asks: false });
    // The user may have shifted it meanwhile.
    opened.shift = description.shift;
    return opened;
  }

  get store() { return this.close && this.#covers() ? this.close.store : this.all.store; }

  get shift() { return this.all.store.shift; }
  set shift(seconds) {
    this.all.store.move(seconds);
    this.close?.store.move(seconds);
  }

  #covers() {
    const { close: { begin, end }, view, shift } = this;
    return begin <= view.begin - shift && end >= view.end - shift;
  }

  async loadVisible() {
    const { view, all, close, shift } = this;
    const fine = all.each === 1 || view.span > all.store.lastTime - all.store.firstTime;
    if (fine || this.asks || (close && this.#covers() && (close.each === 1 || view.span > (close.end - close.begin) / 8))) return false;
    this.asks = true;
    try {
      this.close = await part(this.name, this.wanted, view.begin - shift - view.span, view.end - shift + view.span);
      this.close.store.move(this.shift);
    } finally { this.asks = false; }
    return true;
  }
}

async function part(name, wanted, begin = -Infinity, end = Infinity) {
  const message = isFinite(begin) ? await recorded(name, wanted, begin, end) : await recorded(name, wanted);
  return { begin, end, each: message.hit, store: Store.of(message, wanted) };
}

function element(name, kind) {
  const made = document.createElement(name);
  if (kind) made.className = kind;
  return made;
}
