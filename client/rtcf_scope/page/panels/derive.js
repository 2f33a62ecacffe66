// The field for a new derived signal, with suggestions from the shown traces.
import { errorOf, isDerived } from "../data/derived.js";

export class Derive {
  constructor(scope, form) {
    this.scope = scope;
    this.input = form.querySelector("input");
    this.says = form.querySelector("output");
    this.list = form.querySelector("datalist");
    form.onsubmit = (event) => { event.preventDefault(); this.#add(); };
    this.input.onfocus = () => this.#suggest();
    this.input.oninput = () => this.#say("");
    this.input.onkeydown = ({ key }) => { if (key === "Escape") { this.input.value = ""; this.#say(""); } };
  }

  #add() {
    const text = this.input.value.trim().replace(/^=\s*/, "");
    if (!text) return;
    const name = `= ${text}`, error = errorOf(name);
    this.#say(error);
    if (error) return;
    if (!this.scope.active.has(name)) this.scope.toggle(name);
    this.input.value = "";
  }

  #say(text) {
    this.says.textContent = text;
    this.input.classList.toggle("wrong", text !== "");
  }

  #suggest() {
    const signals = this.scope.traces().map((each) => each.name).filter((name) => !isDerived(name)).map((name) => name.replace("~", ""));
    const [first, second] = signals;
    const texts = [...(second ? [`${second} - ${first}`] : []), ...signals.slice(0, 8).flatMap((name) => [`d(${name})`, `low(${name}, 10)`, `high(${name}, 10)`, `integral(${name})`])];
    this.list.replaceChildren(...texts.map((text) => new Option("", text)));
  }
}
