// Received data: signals on an even grid of buckets, states as stretches with a word each, slips and events.
"use strict";

const KEPT_S = 60; // length of the kept curves; the server keeps as much for newly opened pages

/** The last minute of one run. */
class Store {
  constructor(hello, step_s) {
    this.names = hello.columns;
    this.step_s = step_s;
    this.factor = new Map();
    for (const curve of hello.panels.flatMap((panel) => panel.curves)) {
      for (const name of [curve.name, ...["least", "mean", "most"].map((which) => `${curve.name}.${which}`)]) this.factor.set(name, curve.factor);
    }
    this.columns = new Map(this.names.map((name) => [name, []]));
    this.words = new Map(hello.words.map((one) => [`${one.column} ${one.number}`, one.word.toLowerCase().replaceAll("_", " ")]));
    this.end = null; // number of the bucket after the last
    this.log = { label: "", name: "", good: true, grows: true, in_charge_from_s: null, slips: [], bands: [], events: [] };
    for (const [title, column] of [["mode", "mode"], ["contact", "state"], ["reason", "reason"], ["limit", "limit"], ["guard", "guard_state"]]) {
      this.log.bands.push({ title, column, stretches: [] });
    }
  }

  get first() {
    return this.end === null ? 0 : this.end - this.columns.get(this.names[0]).length;
  }

  /** Time at the end of the bucket of this number [s]. */
  timeOf(bucket) {
    return (bucket + 1) * this.step_s;
  }

  /** Add buckets: `values` is one column after the other. */
  add(first, count, values) {
    if (this.end === null) this.end = first;
    const hole = Math.max(0, Math.min(first - this.end, KEPT_S / this.step_s));
    this.names.forEach((name, at) => {
      const column = this.columns.get(name), factor = this.factor.get(name) ?? 1;
      for (let lost = 0; lost < hole; lost++) column.push(null);
      for (let bucket = 0; bucket < count; bucket++) {
        const value = values[at * count + bucket];
        column.push(Number.isNaN(value) ? null : value * factor);
      }
    });
    this.end = first + count;
    for (const row of this.log.bands) this.band(row, first, count, values);
    this.slips(count, values);
    const most = KEPT_S / this.step_s, over = this.columns.get(this.names[0]).length - most;
    if (over > most / 20) for (const column of this.columns.values()) column.splice(0, over);
    const least = this.timeOf(this.first);
    for (const row of this.log.bands) while (row.stretches.length && row.stretches[0][1] < least) row.stretches.shift();
    while (this.log.slips.length && this.log.slips[0][0] < least) this.log.slips.shift();
    while (this.log.events.length && this.log.events[0].t_s < least) this.log.events.shift();
  }

  /** Extend the stretches of one row of states, such as the modes, by the words of new buckets. */
  band(row, first, count, values) {
    const at = this.names.indexOf(row.column) * count;
    for (let bucket = 0; bucket < count; bucket++) {
      const number = values[at + bucket];
      if (Number.isNaN(number)) continue;
      const word = this.words.get(`${row.column} ${number}`) ?? String(number), to = this.timeOf(first + bucket), from = to - this.step_s;
      const last = row.stretches.at(-1);
      if (last && last[2] === word && from - last[1] < 1.5 * this.step_s) last[1] = to;
      else row.stretches.push([from, to, word]);
    }
  }

  /** A slip is where the controller's count rises; mark it at the peak of the force before it. */
  slips(count, values) {
    const counted = this.columns.get("slips"), force = this.columns.get("drive_force_N.most");
    for (let at = Math.max(1, counted.length - count); at < counted.length; at++) {
      if (counted[at] === null || counted[at - 1] === null || counted[at] <= counted[at - 1]) continue;
      let top = at;
      for (let before = at; before > at - 0.1 / this.step_s && before >= 0; before--) {
        if (force[before] !== null && force[before] > (force[top] ?? -Infinity)) top = before;
      }
      if (force[top] !== null) this.log.slips.push([this.timeOf(this.first + top), force[top]]);
    }
  }

  /** The curves of a panel between two times, ready for a plot. */
  part(panel, from_s, to_s) {
    const length = this.columns.get(this.names[0]).length;
    const from = Math.max(0, Math.floor(from_s / this.step_s) - 1 - this.first), to = Math.min(length, Math.ceil(to_s / this.step_s) + 1 - this.first);
    const x = [];
    for (let at = from; at < to; at++) x.push(this.timeOf(this.first + at));
    const cut = (name) => this.columns.get(name).slice(from, Math.max(from, to));
    const curves = panel.curves.map((curve) =>
      this.columns.has(`${curve.name}.mean`)
        ? { ...curve, least: cut(`${curve.name}.least`), most: cut(`${curve.name}.most`), mean: cut(`${curve.name}.mean`) }
        : { ...curve, mean: cut(curve.name) });
    return columnsOf({ curves }, x);
  }
}

/** Split a frame of the server into its JSON and the numbers after it. */
function unframed(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const told = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  return [told, new Float32Array(buffer, 4 + length, told.rows * told.count)];
}
