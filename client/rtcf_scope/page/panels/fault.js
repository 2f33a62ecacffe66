// The reason why the loop has ended, until it runs again or the user hides it.
export class FaultBanner {
  // `open(incident)`: the user wants to see an incident.
  constructor(box, open) {
    this.box = box;
    this.hidden = ""; // the text that the user has hidden
    this.text = "";
    this.incident = "";
    box.querySelector("[name=incident]").onclick = () => open(this.incident);
    box.querySelector("[name=dismiss]").onclick = () => { this.hidden = this.text; this.#show(); };
  }

  // Shows the fault in a state of the runner, if there is one.
  show({ state, status, iteration, incident }) {
    const isFault = state === "faulted" || state === "stuck";
    const text = isFault ? `${state} ${iteration} ${status}` : "";
    if (text === this.text && (incident ?? "") === this.incident) return;
    if (!text) this.hidden = "";
    Object.assign(this, { text, incident: isFault ? incident ?? "" : "" });
    const [, cycle, reason] = /^loop stopped in iteration (\d+): (.*)$/s.exec(status ?? "") ?? [null, iteration, status];
    this.box.querySelector("b").textContent = state === "stuck" ? "The loop is stuck" : `The loop ended in cycle ${cycle}`;
    this.box.querySelector("span").textContent = reason ?? "";
    this.#show();
  }

  #show() {
    this.box.hidden = !this.text || this.text === this.hidden;
    this.box.querySelector("[name=incident]").hidden = !this.incident;
  }
}
