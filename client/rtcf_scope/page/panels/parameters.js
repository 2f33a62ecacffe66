// The parameters of all components, as fields, which are editable if the scope has the right.
import { ask, query } from "../server.js";

const UNDONE = 100; // changes that can be undone

export class Parameters {
  constructor(box, page) { // page: right, runner(), setError(text)
    this.box = box;
    this.page = page;
    this.fields = new Map(); // "component.parameter" -> function(value)
    this.values = new Map(); // "component.parameter" -> the value from rtcfd
    this.done = []; // {component, name, before}, of this page, newest last
    this.undoing = document.createElement("button");
    this.undoing.onclick = () => this.undo();
  }

  // Undoes the newest change of this page.
  async undo() {
    const change = this.done.pop();
    if (!change) return;
    const { component, name, before } = change;
    try {
      await this.#set(component, name, before);
      this.fields.get(`${component}.${name}`)?.(before);
      this.page.setError("");
    } catch (error) {
      this.done.push(change);
      this.page.setError(error.message);
    }
    this.#offer();
  }

  #offer() {
    const { component, name, before } = this.done.at(-1) ?? {};
    this.undoing.hidden = !component;
    this.undoing.textContent = `Undo: ${component}.${name} back to ${before}`;
  }

  async #set(component, name, value) {
    await ask(`/api/parameter?${query({ runner: this.page.runner() })}`, {
      method: "POST", headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ component, parameter: name, value }),
    });
    this.values.set(`${component}.${name}`, value);
  }

  show(components) {
    this.fields.clear();
    const open = new Set([...this.box.querySelectorAll("details[open]")].map((each) => each.dataset.name));
    const with_ = components.filter((each) => each.parameters.length);
    this.box.replaceChildren(this.undoing);
    this.#offer();
    for (const component of with_) for (const { name, value } of component.parameters) this.values.set(`${component.name}.${name}`, value);
    if (this.page.right === "observe" && with_.length) {
      const hint = document.createElement("p");
      hint.className = "hint";
      hint.textContent = "Only to look at: rtcfctl scope --right tune lets you set them.";
      this.box.append(hint);
    }
    for (const component of with_) {
      const details = document.createElement("details");
      details.dataset.name = component.name;
      details.open = open.has(component.name) || with_.length < 6;
      const summary = document.createElement("summary");
      summary.textContent = component.name;
      details.append(summary, ...component.parameters.map((each) => this.#row(component.name, each)));
      this.box.append(details);
    }
    if (!with_.length) this.box.textContent = "No component has parameters.";
  }

  // Shows changed values, without rebuilding the fields.
  update(components) {
    for (const component of components)
      for (const { name, value } of component.parameters) {
        this.values.set(`${component.name}.${name}`, value);
        this.fields.get(`${component.name}.${name}`)?.(value);
      }
  }

  async who() {
    const changes = await ask(`/api/history?${query({ runner: this.page.runner() })}`);
    const seen = new Set();
    for (const { component, parameter, who, how, time_ns } of changes) {
      const key = `${component}.${parameter}`;
      if (seen.has(key)) continue;
      seen.add(key);
      const at = this.box.querySelector(`[data-who="${CSS.escape(key)}"]`);
      if (at && how !== "load") at.textContent = `${who}, ${new Date(Number(BigInt(time_ns) / 1000000n)).toLocaleTimeString()}`;
    }
  }

  #row(component, parameter) {
    const row = document.createElement("label");
    row.className = "parameter";
    const name = document.createElement("span");
    name.textContent = parameter.name;
    name.title = parameter.doc;
    const field = this.#field(parameter);
    const key = `${component}.${parameter.name}`;
    field.dataset.key = key;
    field.disabled = this.page.right === "observe";
    const unit = document.createElement("small");
    unit.textContent = parameter.unit;
    const who = document.createElement("em");
    who.dataset.who = key;
    const head = document.createElement("div");
    head.append(name, field, unit);
    row.append(head);
    const bounded = parameter.minimum !== null && parameter.maximum !== null && ["int", "double"].includes(parameter.type);
    let slider = null;
    if (bounded) {
      slider = this.#slider(parameter);
      slider.dataset.slider = key;
      slider.disabled = field.disabled;
      const ends = document.createElement("div");
      ends.className = "ends";
      const [low, high] = [parameter.minimum, parameter.maximum].map((each) => {
        const text = document.createElement("small");
        text.textContent = each;
        return text;
      });
      ends.append(low, slider, high);
      row.append(ends);
    }
    row.append(who);
    this.#bind(component, parameter, field, slider);
    return row;
  }

  #bind(component, parameter, field, slider) {
    const read = (input) => parameter.type === "bool" ? input.checked
      : parameter.type === "int" || parameter.type === "double" ? Number(input.value) : input.value;
    // One request at a time, so that the newest value is set last.
    let isSetting = false, next;
    const setNext = async (value) => {
      next = { value };
      if (isSetting) return;
      isSetting = true;
      while (next) {
        const { value } = next;
        next = undefined;
        await set(value);
      }
      isSetting = false;
    };
    const set = async (value) => {
      const before = this.values.get(`${component}.${parameter.name}`);
      try {
        await this.#set(component, parameter.name, value);
        field.classList.remove("wrong");
        this.page.setError("");
        if (before !== value) this.done = [...this.done.slice(1 - UNDONE), { component, name: parameter.name, before }];
        this.#offer();
      } catch (error) {
        field.classList.add("wrong");
        this.page.setError(error.message);
      }
    };
    field.onchange = () => { if (slider) slider.value = field.value; setNext(read(field)); };
    if (slider) {
      // Dragging shows the value; releasing it sets it.
      slider.oninput = () => { field.value = slider.value; };
      slider.onchange = () => setNext(read(slider));
    }
    this.fields.set(`${component}.${parameter.name}`, (value) => {
      if (document.activeElement === field || document.activeElement === slider) return;
      if (parameter.type === "bool") field.checked = value; else field.value = value;
      if (slider) slider.value = value;
    });
  }

  #field({ type, value, choices, minimum, maximum }) {
    if (type === "enum") {
      const select = document.createElement("select");
      select.append(...choices.map((each) => new Option(each, each, false, each === value)));
      return select;
    }
    const input = document.createElement("input");
    if (type === "bool") { input.type = "checkbox"; input.checked = value; return input; }
    if (type === "int" || type === "double") {
      input.type = "number";
      input.step = type === "int" ? "1" : "any";
      if (minimum !== null) input.min = minimum;
      if (maximum !== null) input.max = maximum;
    }
    input.value = value;
    return input;
  }

  #slider({ type, value, minimum, maximum }) {
    const slider = document.createElement("input");
    slider.type = "range";
    slider.min = minimum;
    slider.max = maximum;
    slider.step = type === "int" ? 1 : Number(((maximum - minimum) / 1000).toPrecision(1));
    slider.value = value;
    return slider;
  }
}
