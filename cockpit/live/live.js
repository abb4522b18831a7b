// The page: shows the frames of the server and reports when they stop. Old values are never shown as current.
"use strict";

const OLD_S = 1; // age of the data from which on the headline names it
const GONE_S = 3; // age of the data from which on they are hidden; a connection without a frame for as long is reopened
const LOOK_MS = 250; // interval at which connection and age of the data are checked
const AGAIN_MS = 500; // pause before a reconnection
const READ_MS = 200; // least time between two updates of the figures, so that they can be read
const DRIFT_MS = 0.01; // largest drift per frame between the clocks of server and browser, maybe two computers: 200 ppm
const NO_SERVER = "no connection to `stickslip serve`: the state is unknown, and STOP reaches no rig; use `stickslip stop` in a terminal, or the amplifier's switch";
const LATE = "this browser or its connection is too slow to show current data; STOP still works";
const WINDOWS_S = [2, 10, 30, 60];
const EVENTS_SHOWN = 200;
const element = (id) => document.getElementById(id);

let hello = null, store = null, scope = null, axis = null, socket = null, helps = new Map();
let plots = [], window_s = 10, follows = true, dirty = false, phase = "", said = "", read_ms = 0;
let latest = null, heard_ms = performance.now(), fresh_ms = heard_ms, offset_ms = null, full = ""; // newest frame; times of its arrival and of its data
const commands = new Commands(() => socket, () => phase);

/** Build the display of a run; `step_s` is null without a run. */
function begin(step_s) {
  element("curves").replaceChildren();
  element("ribbon").replaceChildren();
  document.getElementById("tip")?.remove();
  scope.clear();
  plots = [];
  store = step_s ? new Store(hello, step_s) : null;
  if (!store) return;
  element("step").textContent = `${Number((1e3 * step_s).toPrecision(3))} ms`;
  axis = new TimeAxis(0, KEPT_S);
  const show = axis.show.bind(axis);
  axis.show = (from, to) => { // zooming stops the scrolling
    follows = false;
    show(from, to);
    refresh();
  };
  axis.slide = show;
  ribbon(element("ribbon"), [store.log], axis, new Map(hello.words.map((one) => [one.word.toLowerCase().replaceAll("_", " "), one.help])));
  for (const panel of hello.panels) {
    const curves = panel.curves.map((curve) => ({ ...curve, log: 0, mean: [], ...(store.columns.has(`${curve.name}.mean`) ? { least: [], most: [] } : {}) }));
    const live = { ...panel, curves, limits: [], slips: panel.curves[0].name === "drive_force_N" };
    const place = made("div", []), hint = made("p", panel.hint, { className: "small" });
    const add = () => {
      plots.push({ panel: live, plot: plotOf(place, live, [], [store.log], axis) });
      dirty = true;
    };
    if (panel.open) {
      into("curves", made("h3", panel.title), hint, place);
      add();
      continue;
    }
    const folded = made("details", [made("summary", panel.title), hint, place]);
    folded.addEventListener("toggle", () => folded.open && !place.childElementCount && add());
    into("curves", folded);
  }
}

/** Draw the curves of the visible time. */
function refresh() {
  if (!store || store.end === null) return;
  axis.least = store.timeOf(store.first);
  axis.most = Math.max(store.timeOf(store.end - 1), axis.least + 1e-3);
  const begin_s = Math.max(axis.most - window_s, axis.least); // a run shorter than the window fills it gradually
  const [from, to] = follows ? [begin_s, begin_s + window_s] : [axis.from, axis.to];
  if (follows) [axis.from, axis.to] = [from, to];
  for (const { panel, plot } of plots) plot.setData(store.part(panel, from, to), false);
  for (const listener of axis.listeners) listener();
  element("shown").textContent = `${axis.from.toFixed(2)} to ${axis.to.toFixed(2)} s`;
  element("follow").classList.toggle("on", follows);
}

/** Keep a frame, and the time of its data on this browser's clock. The fastest frame gives the difference of both clocks. */
function note(now) {
  const delay_ms = performance.now() - 1e3 * now.sent_s;
  offset_ms = offset_ms === null ? delay_ms : Math.min(delay_ms, offset_ms + DRIFT_MS);
  fresh_ms = 1e3 * now.sent_s + offset_ms - (now.phase === "live" ? 1e3 * now.silent_s : 0);
  latest = now;
  commands.follow(now);
}

/** Show the newest frame with its age; without one, or if it is too old, report this and blank the old values. */
function show() {
  const age_s = (performance.now() - fresh_ms) / 1e3, gone = !latest || !commands.connected || age_s > GONE_S;
  const why = full || (commands.connected ? (latest ? LATE : "connecting") : NO_SERVER);
  const now = gone ? { phase: "cut", answer: { level: "bad", text: why } } : latest;
  element("age").textContent = full || age_s <= OLD_S ? "" : gone ? `no data for ${age_s.toFixed(0)} s: ` : `${age_s.toFixed(0)} s old: `;
  document.querySelector("main").classList.toggle("off", now.phase !== "live");
  element("answer").className = `verdict ${now.answer.level === "good" && age_s > OLD_S ? "look" : now.answer.level}`;
  if (said !== now.answer.text) element("said").replaceChildren(...rich((said = now.answer.text))); // only a new text: a screen reader reads it aloud
  element("whose").textContent = [now.rig && `rig ${now.rig}`, now.roles?.length ? `on the bus: ${now.roles.join(", ")}` : "no process on the bus"].filter(Boolean).join("; ");
  document.title = `${now.phase === "live" ? (now.guard_state === "FAULT" ? "FAULT" : (now.mode ?? "no controller")) : now.phase}: stickslip`;
  if (now.phase === phase && performance.now() - read_ms < READ_MS) return;
  [phase, read_ms] = [now.phase, performance.now()];
  element("tiles").replaceChildren(...tilesOf(now));
  element("state").replaceChildren(table(["", "now", "meaning"], stateRows(now, helps)));
  element("lost").replaceChildren(made("p", lostWords(now), { className: "small" }));
}

/** Draw the current limits of the stroke and the breakaway force. */
function showLimits(now) {
  for (const { panel } of plots) {
    if (panel.axis === "amplitude") panel.limits = (now.limits ?? []).map((one) => ({ words: one.words, value: 1e9 * one.value }));
    if (panel.slips) panel.limits = now.breakaway_force_N ? [{ words: "breakaway force, learned", value: now.breakaway_force_N }] : [];
  }
}

function addEvents(events) {
  const body = element("events").querySelector("table");
  for (const event of events) {
    body.rows[0].after(eventRow(event));
    store?.log.events.push(event);
  }
  while (body.rows.length > EVENTS_SHOWN) body.deleteRow(-1);
}

function receive(buffer) {
  heard_ms = performance.now();
  const [told, values] = unframed(buffer);
  if (told.kind === "hello") {
    hello = told;
    helps = new Map(told.words.map((one) => [`${one.column} ${one.word}`, one.help]));
    scope = new ScopeView(told);
    element("events").replaceChildren(table(["time [s]", "local time", "source", "event", "severity", "text", "meaning and remedy"], []));
    begin(told.step_s);
  } else if (told.kind === "new-run") {
    begin(told.step_s);
  } else if (told.kind === "capture") {
    scope.add(told, values);
  } else if (told.kind === "answer") {
    commands.answered(told);
  } else if (told.kind === "full") {
    full = told.line;
  } else {
    if (store && told.count) store.add(told.first, told.count, values);
    addEvents(told.events);
    showLimits(told);
    note(told);
    show();
    if (told.latency) element("latency").replaceChildren(histogram([{ latency: told.latency }]));
    dirty = true;
  }
  document.body.dataset.ready = "yes";
}

function connect() {
  heard_ms = performance.now();
  [offset_ms, full] = [null, ""];
  socket = new WebSocket(`ws://${location.host}/stream`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => commands.retry();
  socket.onmessage = (message) => receive(message.data);
  socket.onclose = () => {
    commands.disconnected();
    show();
    setTimeout(connect, AGAIN_MS);
  };
}

element("stop").addEventListener("click", () => commands.order("STOP", ""));
element("orders").addEventListener("submit", (event) => event.preventDefault()); // Enter in the field sends no command
for (const button of document.querySelectorAll("[data-word]")) {
  button.addEventListener("click", () => commands.order(button.dataset.word, element("token").value.trim()));
}
element("take").addEventListener("click", () => commands.order("SCOPE", ""));
element("follow").addEventListener("click", () => {
  follows = true;
  dirty = true;
});
for (const seconds of WINDOWS_S) {
  const button = made("button", `${seconds} s`, { className: seconds === window_s ? "on" : "" });
  button.addEventListener("click", () => {
    [window_s, follows, dirty] = [seconds, true, true];
    for (const choice of element("windows").children) choice.classList.toggle("on", choice === button);
  });
  into("windows", button);
}
let looked_ms = performance.now();
setInterval(() => {
  const late_ms = performance.now() - looked_ms - LOOK_MS;
  looked_ms = performance.now();
  // close a silent connection, unless this page itself stalled and so has unread frames
  if (late_ms < LOOK_MS && looked_ms - heard_ms > 1e3 * GONE_S && !full) socket?.close();
  commands.retry();
  show();
}, LOOK_MS);
(function draw() {
  if (dirty) {
    dirty = false;
    refresh();
  }
  requestAnimationFrame(draw);
})();
connect();
