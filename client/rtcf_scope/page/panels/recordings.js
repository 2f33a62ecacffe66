// Recordings: one opens in place of the stream, a second one over it.
import { ask, recorded } from "../server.js";
import { Store } from "../data/store.js";

export class Recordings {
  constructor(scope, box, trouble) {
    this.scope = scope;
    this.box = box;
    this.trouble = trouble;
    this.open = []; // {name, signals}
  }

  async show() {
    const names = await ask("/api/recordings");
    const list = document.createElement("div");
    for (const name of names) {
      const button = document.createElement("button");
      button.className = "leaf";
      button.setAttribute("aria-pressed", String(this.open.some((each) => each.name === name)));
      button.append(Object.assign(document.createElement("span"), { textContent: name }));
      button.onclick = () => this.toggle(name);
      list.append(button);
    }
    const hint = document.createElement("p");
    hint.className = "hint";
    hint.textContent = names.length ? "Choose one; a second one is drawn dashed over it, from the same beginning."
      : "None: rtcfctl scope FILE… opens recordings, made by rtcfctl record -o FILE.";
    this.box.replaceChildren(list, hint);
  }

  async toggle(name) {
    try {
      const there = this.open.findIndex((each) => each.name === name);
      if (there >= 0) this.open.splice(there, 1);
      else this.open = [...this.open.slice(-1), await ask(`/api/recordings/${encodeURIComponent(name)}`)];
      await this.load();
      await this.show();
    } catch (error) { this.trouble(error.message); }
  }

  // Reads the traces of the panes.
  async load() {
    const wanted = this.scope.traces().map((each) => each.name).filter((name) => !name.startsWith("~"));
    for (const { signals } of this.open) for (const { name, unit } of signals) this.scope.units.set(name, unit);
    this.scope.showRecordings(await Promise.all(this.open.map((each) => Opened.of(each.name, wanted, this.scope.view))));
  }

  // Reads each cycle in sight where all of a recording is too much; called a few times a second.
  async look() {
    try {
      for (const each of this.scope.recordings) if (await each.look()) this.scope.changed();
    } catch (error) { this.trouble(error.message); }
  }

  // The signals of what is open, by name.
  catalog() {
    const found = new Map();
    for (const { signals } of this.open) for (const signal of signals) found.set(signal.name, signal);
    return [...found.values()];
  }
}

// One that is shown: all of it, and the part in sight more closely.
class Opened {
  static async of(name, wanted, view) {
    const opened = new Opened();
    Object.assign(opened, { name, wanted, view, all: await part(name, wanted), close: null, asks: false });
    return opened;
  }

  get store() { return this.close && covers(this.close, this.view) ? this.close.store : this.all.store; }

  async look() {
    const { view, all, close } = this;
    const fine = all.each === 1 || view.span > all.store.lastTime - all.store.firstTime;
    if (fine || this.asks || (close && covers(close, view) && (close.each === 1 || view.span > (close.end - close.begin) / 8))) return false;
    this.asks = true;
    try {
      this.close = await part(this.name, this.wanted, view.begin - view.span, view.end + view.span);
    } finally { this.asks = false; }
    return true;
  }
}

async function part(name, wanted, begin = -Infinity, end = Infinity) {
  const message = isFinite(begin) ? await recorded(name, wanted, begin, end) : await recorded(name, wanted);
  return { begin, end, each: message.hit, store: Store.of(message, wanted) };
}

const covers = ({ begin, end }, view) => begin <= view.begin && end >= view.end;
