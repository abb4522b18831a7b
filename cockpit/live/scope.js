// The scope: samples at full rate around a slip. Shows the newest capture unless the operator holds one.
"use strict";

const CAPTURES = 8; // captures kept for selection

class ScopeView {
  constructor(hello) {
    this.channels = hello.channels;
    this.panels = hello.panels.filter((panel) => panel.curves.every((curve) => this.channels.includes(curve.name)));
    this.captures = [];
  }

  clear() {
    this.captures = [];
    document.getElementById("captures").replaceChildren();
    document.getElementById("scope").replaceChildren();
    document.getElementById("scopetold").textContent = "Waiting for a slip counted by the controller.";
  }

  add(capture, values) {
    this.captures.unshift({ ...capture, values });
    this.captures.length = Math.min(this.captures.length, CAPTURES);
    if (!document.getElementById("hold").checked || this.captures.length === 1) this.show(this.captures[0]);
    this.list();
  }

  list() {
    const buttons = this.captures.map((one) => {
      const button = made("button", `${one.cause} at ${one.t_s.toFixed(2)} s`);
      button.addEventListener("click", () => {
        document.getElementById("hold").checked = true;
        this.show(one);
      });
      return button;
    });
    document.getElementById("captures").replaceChildren(...buttons);
  }

  show(capture) {
    const place = document.getElementById("scope");
    place.replaceChildren();
    const x = Array.from({ length: capture.count }, (_, at) => at * capture.sample_s - capture.before_s);
    const axis = new TimeAxis(x[0], x.at(-1));
    const log = { label: "", bands: [], slips: [], in_charge_from_s: null };
    const lost = capture.missing ? ` ${capture.missing} blocks are missing.` : "";
    document.getElementById("scopetold").textContent =
      `Capture ${capture.number}: ${capture.cause} at ${capture.t_s.toFixed(3)} s of the run, shown as 0; one sample every ${(1e6 * capture.sample_s).toFixed(0)} µs.${lost}`;
    for (const panel of this.panels) {
      const curves = panel.curves.map((curve) => {
        const from = this.channels.indexOf(curve.name) * capture.count;
        const mean = Array.from(capture.values.subarray(from, from + capture.count), (value) => (Number.isNaN(value) ? null : value * curve.factor));
        return { ...curve, log: 0, mean };
      });
      const under = made("div", []);
      place.append(made("h3", panel.title), under);
      plotOf(under, { ...panel, curves, limits: [], slips: false }, x, [log], axis);
    }
  }
}
