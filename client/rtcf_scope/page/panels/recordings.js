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

  // Reads what the panes show.
  async load() {
    const wanted = this.scope.traces().map((each) => each.name).filter((name) => !name.startsWith("~"));
    for (const { signals } of this.open) for (const { name, unit } of signals) this.scope.units.set(name, unit);
    const stores = await Promise.all(this.open.map(async ({ name }) => ({ name, store: Store.of(await recorded(name, wanted), wanted) })));
    this.scope.showRecordings(stores);
  }

  // The signals of what is open, by name.
  catalog() {
    const found = new Map();
    for (const { signals } of this.open) for (const signal of signals) found.set(signal.name, signal);
    return [...found.values()];
  }
}
