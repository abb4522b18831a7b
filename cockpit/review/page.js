// The page: answer, figures, differences, curves, latency, events and words. Texts are inserted as text, never as HTML.
"use strict";

const data = JSON.parse(document.getElementById("data").textContent);
const logs = data.logs;
const controlled = logs.some((log) => !log.imported); // an imported log has no controller
const axis = new TimeAxis(data.grid.start_s, data.grid.start_s + (data.grid.bins - 1) * data.grid.step_s);

function answers() {
  into("name", logs.map((log) => log.name).join(" and "));
  for (const log of logs) {
    const name = logs.length > 1 ? [made("small", `${log.label}: ${log.name}`)] : [];
    into("answers", made("p", [...name, log.answer], { className: `verdict ${{ true: "good", false: "bad" }[log.good] ?? "unjudged"}` }));
  }
  if (logs.length < 2) return;
  const first = data.differences.slice(0, 4).map((row) => `${row.key} ${row.values.map((value) => value || "(none)").join(" \u2192 ")}`);
  const more = data.differences.length - first.length;
  const summary = first.length ? `From A to B: ${first.join("; ")}${more > 0 ? `; and ${more} more below` : ""}.` : "A and B have the same parameters.";
  into("answers", made("p", summary));
}

function figures() {
  const rows = data.figures.map((row) => {
    const cells = row.logs.map((lines) => made("td", lines.length ? lines.flatMap((line, at) => (at ? [made("br", ""), line] : [line])) : "\u2013"));
    return made("tr", [made("td", row.what, { className: "key" }), ...cells], { className: row.what === "warning" ? "warning" : "" });
  });
  into("figures", made("h2", "Results"), table(["", ...logs.map((log) => (logs.length > 1 ? `${log.label}: ${log.name}` : log.name))], rows));
}

function differences() {
  if (logs.length < 2) return;
  const rows = data.differences.map((row) => made("tr", [made("td", row.key), ...row.values.map((value) => made("td", value || "(none)"))]));
  into("differences", made("h2", "Parameters that differ"));
  into("differences", rows.length ? table(["parameter", ...logs.map((log) => log.label)], rows) : made("p", "None: both logs have the same parameters."));
}

function curves() {
  const x = Array.from({ length: data.grid.bins }, (_, at) => data.grid.start_s + at * data.grid.step_s);
  document.getElementById("key").hidden = logs.length > 1 || !controlled;
  const step_ms = 1e3 * data.grid.step_s;
  document.getElementById("step").textContent = `${Number(step_ms.toPrecision(3))} ms`;
  for (const panel of data.panels) {
    const place = made("div", []);
    const hint = made("p", panel.empty ? `${panel.hint} No data in this run.` : panel.hint, { className: "small" });
    if (panel.empty) {
      into("curves", made("h3", panel.title), hint);
      continue;
    }
    if (panel.open) {
      into("curves", made("h3", panel.title), hint, place);
      plotOf(place, panel, x, logs, axis);
      continue;
    }
    const folded = made("details", [made("summary", panel.title), hint, place]);
    folded.addEventListener("toggle", () => {
      if (folded.open && !place.childElementCount) plotOf(place, panel, x, logs, axis);
    });
    into("curves", folded);
  }
}

function zoom() {
  const on = (id, work) => document.getElementById(id).addEventListener("click", work);
  const width = () => axis.to - axis.from, middle = () => (axis.from + axis.to) / 2;
  on("whole", () => axis.show(axis.least, axis.most));
  on("nearer", () => axis.around(middle(), width() / 2));
  on("farther", () => axis.around(middle(), width() * 2));
  on("back", () => axis.show(axis.from - width() / 2, axis.to - width() / 2));
  on("forth", () => axis.show(axis.from + width() / 2, axis.to + width() / 2));
  const slips = logs.flatMap((log) => log.slips.map(([t_s]) => t_s)).sort((one, other) => one - other);
  const button = document.getElementById("slip");
  button.disabled = !slips.length;
  let last = -Infinity;
  on("slip", () => {
    last = slips.find((t_s) => t_s > last) ?? slips[0];
    axis.around(last, 0.3);
  });
  const tell = () => {
    const [from, to] = [axis.from.toFixed(3), axis.to.toFixed(3)];
    document.getElementById("shown").textContent = `${from} to ${to} s`;
    history.replaceState(null, "", axis.to - axis.from < axis.most - axis.least ? `#${from}-${to}` : location.pathname);
  };
  axis.listeners.push(tell);
  tell();
}

function latency() {
  if (!controlled) return;
  const with_ = logs.filter((log) => log.latency);
  into("latency", made("h2", "Latency: block to command"));
  if (!with_.length) {
    into("latency", made("p", "Not measured: the run was in lockstep, in one process, or without a controller.", { className: "small" }));
    return;
  }
  into("latency", made("p", "Latency of the commands; both axes are logarithmic. Commands right of 1 ms were too late for their block.", { className: "small" }));
  into("latency", histogram(with_));
  if (with_.length > 1) into("latency", made("p", "Filled: A. Outlined: B.", { className: "small" }));
}

function events() {
  const all = logs.flatMap((log) => log.events.map((event) => ({ ...event, log: log.label }))).sort((one, other) => one.t_s - other.t_s);
  if (!controlled && !all.length) return;
  const isPause = (event) => event.code.endsWith("PAUSE");
  const row = (event) => {
    const cells = [event.t_s.toFixed(3), ...(logs.length > 1 ? [event.log] : []), event.source, event.code, event.text, event.help];
    const line = made("tr", cells.map((text, at) => made("td", text, { className: at ? (cells.length - at > 2 ? "key" : "") : "number" })), { className: "go" });
    line.addEventListener("click", () => {
      axis.around(event.t_s, 1);
      document.getElementById("zoom").scrollIntoView({ behavior: "smooth" });
    });
    return line;
  };
  const head = ["time [s]", ...(logs.length > 1 ? ["log"] : []), "source", "event", "text", "meaning"];
  into("events", made("h2", "Events"), table(head, all.filter((event) => !isPause(event)).map(row)));
  const pauses = all.filter(isPause);
  if (pauses.length) into("events", made("details", [made("summary", `${pauses.length} stalls of the computer`), table(head, pauses.map(row))]));
}

function words() {
  if (!data.words.length) return;
  const rows = data.words.map(({ row, word, help }) => made("tr", [made("td", row), made("td", word), made("td", help)]));
  into("words", made("h2", "Words in the rows above the curves"), table(["row", "word", "meaning"], rows));
}

function parameters() {
  const rows = data.parameters.map(({ key, value }) => made("tr", [made("td", key), made("td", value)]));
  into("parameters", made("h2", controlled ? "Parameters" : "Import"), made("details", [made("summary", `all ${rows.length} of ${logs[0].name}`), table(["parameter", "value"], rows)]));
}

answers();
figures();
differences();
ribbon(document.getElementById("ribbon"), logs, axis, new Map(data.words.map(({ word, help }) => [word, help])));
curves();
zoom();
latency();
events();
words();
parameters();
into("made", `Made by ${data.made}`);
document.body.dataset.ready = "yes";
