// The list of events (faults, changes and overruns) and log records of components. Events, warnings
// and errors are also marks in the panes.
import { isBad, isForInformation, isOverrun } from "../scope.js";

const MOST = 200; // in the list
const KINDS = [
  ["faults", "faults and errors", (event) => isBad(event) && !isOverrun(event)],
  ["overruns", "late cycles", isOverrun],
  ["warnings", "warnings that are logged", (event) => event.what === "warn"],
  ["changes", "changes of the graph, of parameters, of the loop", () => true],
  ["information", "what is logged for information", isForInformation],
];

export class Events {
  constructor(scope, box) {
    this.scope = scope;
    this.box = box;
    this.hidden = new Set(); // kinds
    this.buttons = KINDS.map(([kind, title]) => {
      const button = document.createElement("button");
      button.title = title;
      button.dataset.kind = kind;
      button.onclick = () => {
        if (!this.hidden.delete(kind)) this.hidden.add(kind);
        this.show();
      };
      return button;
    });
    this.search = Object.assign(document.createElement("input"), { type: "search", placeholder: "filter" });
    this.search.setAttribute("aria-label", "filter events");
    this.search.oninput = () => this.show();
    this.search.onkeydown = ({ key }) => { if (key === "Escape") { this.search.value = ""; this.show(); } };
    const group = document.createElement("span");
    group.className = "group";
    group.append(...this.buttons);
    const bar = document.createElement("nav");
    bar.append(group, this.search);
    this.list = document.createElement("ol");
    this.none = document.createElement("p");
    this.none.className = "hint";
    box.replaceChildren(bar, this.list, this.none);
  }

  show() {
    const { heard: events } = this.scope;
    const words = this.search.value.toLowerCase().split(/\s+/).filter(Boolean);
    // Rebuilt only after a change: the user may be about to click in it.
    const made = JSON.stringify([events.length, events.at(-1), events[0], words, [...this.hidden]]);
    if (made === this.made) return;
    this.made = made;
    const counts = Object.fromEntries(KINDS.map(([kind]) => [kind, 0]));
    for (const event of events) counts[kindOf(event)]++;
    for (const button of this.buttons) {
      const { kind } = button.dataset;
      button.textContent = `${kind} ${counts[kind]}`;
      button.setAttribute("aria-pressed", String(!this.hidden.has(kind)));
    }
    const found = events.filter((event) => !this.hidden.has(kindOf(event)) && words.every((word) => textOf(event).toLowerCase().includes(word)));
    // Informational events do not displace others.
    const shown = new Set([...found.filter((each) => !isForInformation(each)).slice(-MOST * 3 / 4), ...found.filter(isForInformation).slice(-MOST / 4)]);
    this.list.replaceChildren(...found.filter((each) => shown.has(each)).reverse().map((event) => this.#item(event)));
    const left = found.length - shown.size;
    const since = this.scope.mode === "recording" ? "in this recording" : "since this page was opened";
    this.none.textContent = !events.length ? `Nothing has happened ${since}.`
      : !found.length ? `Nothing of that kind has happened ${since}.`
        : left ? `${left} older ones are not listed: filter` : "";
    this.none.hidden = !this.none.textContent;
  }

  #item(event) {
    const item = document.createElement("li");
    const button = document.createElement("button");
    const date = new Date(Number(BigInt(event.time_ns) / 1000000n));
    button.textContent = date.toLocaleTimeString([], { hour: "2-digit", minute: "2-digit", second: "2-digit", fractionalSecondDigits: 3 });
    button.title = `show this moment: ${date.toLocaleString()}`;
    button.onclick = () => this.#go(event);
    const what = document.createElement(isForInformation(event) ? "span" : "b");
    what.textContent = whatOf(event);
    what.className = isBad(event) ? "what bad" : "what";
    const text = document.createElement("span");
    text.textContent = saidOf(event);
    text.title = `cycle ${event.iteration}`;
    item.append(button, what, text);
    return item;
  }

  #go(event) {
    const { scope } = this;
    if (scope.mode === "trigger") scope.setMode("roll");
    const time = scope.timeOf(event);
    scope.view.show(time - scope.view.span / 2, time + scope.view.span / 2);
    scope.changed();
  }
}

function kindOf(event) {
  if (isForInformation(event)) return "information";
  return KINDS.find(([, , is]) => is(event))[0];
}

function whatOf(event) { return event.what.replaceAll("_", " "); }

function saidOf(event) {
  const who = event.kind === "record" && event.component ? `${event.component}: ` : "";
  return who + [event.message, event.user && `by ${event.user}`].filter(Boolean).join(", ");
}

function textOf(event) { return `${whatOf(event)} ${event.component} ${saidOf(event)}`; }
