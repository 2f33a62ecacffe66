// What has happened: faults, changes, overruns, each a mark in the panes, too; and what components
// log, warnings and errors as marks.
import { isBad, isForInformation } from "../scope.js";

export class Events {
  constructor(scope, box) { this.scope = scope; this.box = box; }

  show() {
    const { events } = this.scope;
    if (!events.length) {
      const none = document.createElement("p");
      none.className = "hint";
      none.textContent = "Nothing has happened since this page was opened.";
      this.box.replaceChildren(none);
      return;
    }
    const list = document.createElement("ol");
    const shown = new Set([...events.filter((each) => !isForInformation(each)).slice(-150), ...events.filter(isForInformation).slice(-50)]);
    list.append(...events.filter((each) => shown.has(each)).reverse().map((event) => {
      const item = document.createElement("li");
      const button = document.createElement("button");
      button.textContent = new Date(Number(BigInt(event.time_ns) / 1000000n)).toLocaleTimeString();
      button.title = "show this moment";
      button.onclick = () => this.#go(event);
      const what = document.createElement(isForInformation(event) ? "span" : "b");
      what.textContent = event.what.replaceAll("_", " ");
      what.className = isBad(event) ? "what bad" : "what";
      const text = document.createElement("span");
      const who = event.kind === "record" && event.component ? `${event.component}: ` : "";
      text.textContent = who + [event.message, event.user && `by ${event.user}`].filter(Boolean).join(", ");
      text.title = `cycle ${event.iteration}`;
      item.append(button, what, text);
      return item;
    }));
    this.box.replaceChildren(list);
  }

  #go(event) {
    const { scope } = this;
    if (scope.mode !== "roll") scope.setMode("roll");
    const time = Number(BigInt(event.time_ns) - scope.baseNs) / 1e9;
    scope.view.show(time - scope.view.span / 2, time + scope.view.span / 2);
    scope.changed();
  }
}
