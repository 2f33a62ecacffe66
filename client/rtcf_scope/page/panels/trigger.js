// The settings of the trigger; the server checks every cycle.
import { isDerived } from "../data/derived.js";
import { figure } from "../drawing/axes.js";

const SLOPES = { edge: ["rising", "falling", "either"], level: ["above", "below"], window: ["leaves", "enters"], nan: [], condition: [] };

const AUTO_MS = 500; // without a hit before the newest cycles are shown

export class TriggerPanel {
  constructor(scope, box, arm) { // arm(settings or null)
    this.scope = scope;
    this.box = box;
    this.arm = arm;
    this.part = (name) => box.querySelector(`[name=${name}]`);
    for (const input of box.querySelectorAll("select, input")) input.onchange = () => { this.#read(); this.#again(); };
    scope.onLevel = (level, value) => {
      scope.trigger.settings[level] = value;
      this.part(level).value = value;
      this.#again();
    };
    this.part("arm").onclick = () => (this.scope.trigger.state === "armed" ? this.disarm() : this.start());
    this.part("earlier").onclick = () => this.scope.showShot(this.scope.shotNumber - 1);
    this.part("later").onclick = () => this.scope.showShot(this.scope.shotNumber + 1);
  }

  // Fills in the available signals and the settings.
  show() {
    const { settings } = this.scope.trigger;
    if (!(settings.kind in SLOPES)) settings.kind = "edge";
    this.#signals();
    for (const name of ["kind", "low", "high", "hysteresis", "single", "auto", "window", "position", "holdoff", "condition"]) {
      const input = this.part(name);
      // Do not change the field in which the user types.
      if (settings[name] === undefined || input === document.activeElement) continue;
      if (input.type === "checkbox") input.checked = settings[name]; else input.value = settings[name];
    }
    const slopes = SLOPES[settings.kind];
    if (!slopes.includes(settings.slope)) settings.slope = slopes[0] ?? "";
    this.part("slope").replaceChildren(...slopes.map((each) => new Option(each, each, false, each === settings.slope)));
    this.part("slope").hidden = !slopes.length;
    this.part("signal").parentElement.hidden = settings.kind === "condition";
    this.part("condition").hidden = settings.kind !== "condition";
    this.part("low").parentElement.hidden = settings.kind === "nan" || settings.kind === "condition";
    this.part("high").parentElement.hidden = settings.kind !== "window";
    this.part("hysteresis").parentElement.hidden = settings.kind !== "edge";
    this.showState();
  }

  // Lists the shown signals, all other signals, and the selected one, which may not exist.
  #signals() {
    const { settings } = this.scope.trigger;
    const there = this.scope.catalog.map((each) => each.name);
    // The server checks the cycles, and it does not compute derived signals.
    const shown = this.scope.traces().map((each) => each.name).filter((name) => !isDerived(name));
    if (!settings.signal) settings.signal = shown[0] ?? there.find((name) => !name.startsWith("~")) ?? there[0] ?? "";
    const known = new Set(there);
    const are = there.some((name) => !name.startsWith("~")); // the graph is known
    const names = [...new Set([settings.signal, ...shown, ...there])].filter(Boolean);
    const options = names.map((name) => [name, are && !known.has(name) ? `${name} (not there)` : name]);
    const select = this.part("signal");
    // An open list is not replaced.
    if (JSON.stringify(options) !== this.listed) {
      this.listed = JSON.stringify(options);
      select.replaceChildren(...options.map(([name, text]) => new Option(text, name)));
    }
    select.value = settings.signal;
  }

  showState() {
    const { trigger, shot, shots, shotNumber } = this.scope;
    const state = this.part("state");
    const armed = trigger.state === "armed";
    state.textContent = armed && trigger.missing.length ? `waiting for ${trigger.missing.join(", ")}: not there`
      : shot?.isPreview ? "no hit: the newest cycles"
      : shot ? `hit at cycle ${shot.cycle} (${shotNumber + 1} of ${shots.length})` : armed ? "waiting" : "not armed";
    state.className = shot && !shot.isPreview ? "hit" : trigger.state;
    this.part("arm").textContent = trigger.state === "armed" ? "Disarm" : "Arm";
    this.part("earlier").disabled = shotNumber <= 0;
    this.part("later").disabled = shotNumber >= shots.length - 1;
    state.title = shot ? `${figure(shot.hitTime)} s` : "";
  }

  start() {
    this.#read();
    const { settings } = this.scope.trigger;
    const rate = this.scope.rate || 1000;
    const all = Math.max(2, Math.round(settings.window / 1000 * rate));
    const before = Math.round(all * settings.position / 100);
    this.arm({ ...settings, before, after: Math.max(1, all - before), holdoff: Math.round(settings.holdoff / 1000 * rate) });
  }

  disarm() { this.arm(null); }

  // Shows the newest cycles while an armed trigger with `auto` has no hit; called a few times a second.
  preview() {
    const { scope } = this, { state, settings } = scope.trigger;
    if (scope.mode !== "trigger" || state !== "armed" || !settings.auto || performance.now() - scope.hitAt < AUTO_MS) return;
    scope.showPreview(settings.window / 1e3, settings.position / 100);
    this.showState();
  }

  #again() {
    this.show();
    if (this.scope.trigger.state === "armed") this.start();
    this.scope.changed();
  }

  #read() {
    const { settings } = this.scope.trigger;
    for (const name of ["signal", "kind", "slope", "condition"]) settings[name] = this.part(name).value;
    for (const name of ["low", "high", "hysteresis", "window", "position", "holdoff"]) {
      const number = Number(this.part(name).value);
      if (isFinite(number)) settings[name] = number;
    }
    settings.single = this.part("single").checked;
    settings.auto = this.part("auto").checked;
  }
}
