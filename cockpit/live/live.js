// The page: shows the frames of the server and reports when they stop. Old values are never shown as current.
"use strict";

const CUT_MS = 1500; // without a frame before the connection counts as lost; the server sends 20 frames per second
const LOOK_MS = 250;
const AGAIN_MS = 1000;
const OLD_MS = 20_000; // after which the outcome of a command is hidden: it is no longer the state of the rig
const READ_MS = 200; // between two updates of the figures, so that they can be read
const WINDOWS_S = [2, 10, 30, 60];
const EVENTS_SHOWN = 200;
const element = (id) => document.getElementById(id);

let hello = null, store = null, scope = null, axis = null, socket = null, helps = new Map();
let plots = [], heard_ms = performance.now(), window_s = 10, follows = true, dirty = false, phase = "", said = "", read_ms = 0, old = 0;

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

function showNow(now) {
  document.body.classList.toggle("off", now.phase !== "live");
  element("answer").className = `verdict ${now.answer.level}`;
  if (said !== now.answer.text) element("said").replaceChildren(...rich((said = now.answer.text))); // once: it is read aloud
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
    element("events").replaceChildren(table(["time [s]", "local time", "source", "event", "NE 107", "text", "meaning and remedy"], []));
    begin(told.step_s);
  } else if (told.kind === "anew") {
    begin(told.step_s);
  } else if (told.kind === "capture") {
    scope.add(told, values);
  } else if (told.kind === "answer") {
    tell([...(told.done ? [] : [`${told.word.toLowerCase()}: NOT DONE`]), ...told.lines].join("\n"), !told.done);
    element("stop").classList.remove("busy");
  } else if (told.kind === "full") {
    tell(told.line, true);
  } else {
    if (store && told.count) store.add(told.first, told.count, values);
    addEvents(told.events);
    showLimits(told);
    showNow(told);
    if (told.latency) element("latency").replaceChildren(histogram([{ latency: told.latency }]));
    dirty = true;
  }
  document.body.dataset.ready = "yes";
}

/** Show the outcome of a command with its time of day; a success is hidden after OLD_MS. */
function tell(text, bad) {
  const place = element("told");
  place.textContent = `${new Date().toLocaleTimeString([], { hour12: false })}  ${text}`;
  clearTimeout(old);
  if (!bad) old = setTimeout(() => (place.hidden = true), OLD_MS);
  place.classList.toggle("bad", bad);
  place.hidden = false;
}

/** Without the server the state is unknown: report that, and blank the old values. */
function cut() {
  showNow({ phase: "cut", answer: { level: "bad", text: "no connection to `stickslip serve`: the state is unknown, and STOP on this page does nothing; use `stickslip stop` in a terminal, or the amplifier's switch" } });
}

function connect() {
  heard_ms = performance.now();
  socket = new WebSocket(`ws://${location.host}/stream`);
  socket.binaryType = "arraybuffer";
  socket.onmessage = (message) => receive(message.data);
  socket.onclose = () => {
    cut();
    setTimeout(connect, AGAIN_MS);
  };
}

function say(word) {
  if (socket?.readyState !== WebSocket.OPEN) {
    tell(`${word.toLowerCase()}: NOT SENT: no connection to the server. Use \`stickslip ${word.toLowerCase()}\` in a terminal, or the amplifier's switch`, true);
    return;
  }
  socket.send(JSON.stringify({ word, token: word === "STOP" ? "" : element("token").value.trim() }));
  if (word !== "SCOPE") tell(`${word.toLowerCase()}: sent, waiting for the rig`, false);
}

element("stop").addEventListener("click", () => {
  element("stop").classList.add("busy");
  say("STOP");
});
element("person").addEventListener("submit", (event) => event.preventDefault()); // Enter in the field sends no command
for (const button of document.querySelectorAll("[data-word]")) button.addEventListener("click", () => say(button.dataset.word));
element("take").addEventListener("click", () => say("SCOPE"));
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
  // a page that stalled itself has unread frames
  if (late_ms < LOOK_MS && looked_ms - heard_ms > CUT_MS && hello) {
    cut();
    socket?.close();
  }
}, LOOK_MS);
(function draw() {
  if (dirty) {
    dirty = false;
    refresh();
  }
  requestAnimationFrame(draw);
})();
connect();
