// The signals as a tree, by component and port, with a search over it.
import { isDerived } from "../data/derived.js";
import { DURATION, LATENCY } from "../data/store.js";
import { colour } from "../drawing/palette.js";
import { SIGNAL } from "../drawing/pane.js";

const MANY = 60; // minimum number of signals for components to be closed at first
const TITLES = new Map([["cycles", "cycles of the loop"], ["derived", "derived signals"]]);
const KINDS = { bool: "bool", integer: "int" };

export class Tree {
  constructor(scope, box, search) {
    this.scope = scope;
    this.box = box;
    this.search = search;
    this.derived = new Set(); // derived signals that have been shown in this page
    this.seen = new Set(); // components that have been listed
    search.oninput = () => this.show();
    search.addEventListener("keydown", ({ key }) => {
      if (key === "Escape") { search.value = ""; this.show(); }
      // The first signal that is found.
      if (key === "Enter" && search.value.trim()) this.box.querySelector(".leaf")?.click();
    });
  }

  show() {
    const words = this.search.value.toLowerCase().split(/\s+/).filter(Boolean);
    for (const { name } of this.scope.traces()) if (isDerived(name)) this.derived.add(name);
    const derived = [...this.derived].map((name) => ({ name, unit: "", kind: "number" }));
    const signals = [...this.scope.catalog, ...derived].filter(({ name }) => words.every((word) => name.toLowerCase().includes(word)));
    const components = new Map([["cycles", []]]);
    for (const signal of signals) {
      const component = signal.name.startsWith("~") ? "cycles" : isDerived(signal.name) ? "derived" : signal.name.slice(0, signal.name.indexOf("."));
      if (!components.has(component)) components.set(component, []);
      components.get(component).push(signal);
    }
    const closed = new Set([...this.box.querySelectorAll("details:not([open])")].map((each) => each.dataset.name));
    const isOpen = (name, count) => (this.seen.has(name) ? !closed.has(name) : count < MANY || TITLES.has(name));
    this.box.replaceChildren(...[...components].filter(([, all]) => all.length).map(([component, all]) => {
      const details = document.createElement("details");
      details.dataset.name = component;
      details.open = words.length > 0 || isOpen(component, signals.length);
      if (!words.length) this.seen.add(component);
      const summary = document.createElement("summary");
      summary.textContent = TITLES.get(component) ?? component;
      details.append(summary, ...all.map((signal) => this.#leaf(signal, component)));
      return details;
    }));
    if (!signals.length) {
      const none = document.createElement("p");
      none.className = "hint";
      none.textContent = words.length ? `no signal has "${words.join(" ")}" in its name`
        : "no signals: load components that write ports of fixed size";
      this.box.append(none);
    }
  }

  #leaf({ name, unit, kind }, component) {
    const button = document.createElement("button");
    const trace = this.scope.traces().find((each) => each.name === name), isHere = this.scope.active.has(name);
    button.className = "leaf";
    button.setAttribute("aria-pressed", String(isHere));
    const dot = document.createElement("i");
    dot.style.background = trace ? colour(trace.number) : "transparent";
    const text = document.createElement("span");
    text.textContent = name === LATENCY ? "wake-up latency" : name === DURATION ? "calculation"
      : isDerived(name) ? name : name.slice(component.length + 1);
    const right = document.createElement("small");
    right.textContent = trace && !isHere ? "in another pane" : unit || (KINDS[kind] ?? "");
    button.title = name;
    button.append(dot, text, right);
    button.onclick = () => this.scope.toggle(name);
    button.draggable = true;
    button.ondragstart = ({ dataTransfer }) => { dataTransfer.setData(SIGNAL, name); dataTransfer.effectAllowed = "copy"; };
    return button;
  }
}
