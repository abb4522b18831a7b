// The current state: answer, tiles, words with their meanings, losses. Unknown values are dashes.
"use strict";

const DASH = "\u2013";

function shown(value, digits = 3) {
  return value === null || value === undefined ? DASH : Number(value.toPrecision(digits)).toString();
}

const fixed = (value, digits) => (value === null || value === undefined ? DASH : value.toFixed(digits));

/** A tile: title, value, details, and optionally a bar from 0 to 1. */
function tile(what, value, more = "", { share = null, level = "" } = {}) {
  const parts = [made("div", what, { className: "what" }), made("div", value, { className: "value" })];
  if (share !== null) parts.push(Object.assign(document.createElement("meter"), { min: 0, max: 1, high: 0.9, optimum: 0, value: Math.min(share, 1), ariaLabel: what }));
  parts.push(made("div", more, { className: "more" }));
  return made("div", parts, { className: `tile ${level}` });
}

function tilesOf(now) {
  const mm = (value) => (value === null || value === undefined ? DASH : (1e3 * value).toFixed(3));
  const stroke_m = now.limits?.length ? Math.min(...now.limits.map((limit) => limit.value)) : null;
  const amplitude = now.amplitude_m ?? null, waiting = now.time_to_slip_s ?? null;
  const vibrates = amplitude !== null && amplitude > 0;
  const ratio = vibrates ? fixed(now.velocity_ratio, 2) : amplitude === null ? DASH : "no vibration";
  const live = now.phase === "live", decided = now.mode !== undefined;
  const late = now.lost?.commands ? `; ${((100 * now.lost.late) / now.lost.commands).toFixed(2)} % later than 1 ms` : "";
  const slips = decided ? `${now.slips} slip${now.slips === 1 ? "" : "s"}, ${now.slips_of_late} in the last ${fixed(now.slips_over_s, 0)} s` : "no controller counts slips";
  const recorded = now.roles?.includes("recorder"), lost = now.lost?.controller ?? 0;
  const when = (known, text) => (known ? text : "");
  return [
    tile("time of the run", live ? `${fixed(now.t_s, 1)} s` : DASH, when(live, recorded ? "recorded" : "not recorded"), { level: live && !recorded ? "look" : "" }),
    tile("contact", (now.state ?? DASH).toLowerCase(), when(live, slips), { level: now.state === "SLIP" || now.slips_of_late > 0 ? "look" : "" }),
    tile("drive force F_d", live ? `${fixed(now.drive_force_N, 2)} N` : DASH, when(now.breakaway_force_N, `breaks away at ${fixed(now.breakaway_force_N, 2)} N`)),
    tile("vibration over drive, v_a / v_d", ratio, when(decided, `v_a ${mm(now.vibration_velocity_mps)}, v_d ${mm(now.drive_velocity_mps)}, set point ${mm(now.wanted_velocity_mps)} mm/s`)),
    tile("amplitude of the base", amplitude === null ? DASH : `${fixed(1e9 * amplitude, 1)} nm`, when(live, `${stroke_m ? `of ${shown(1e9 * stroke_m)} nm` : ""}${vibrates ? ` at ${fixed(now.frequency_Hz, 0)} Hz` : ""}`), {
      share: stroke_m && amplitude !== null ? amplitude / stroke_m : null,
    }),
    tile("predicted time to slip", waiting === null ? DASH : `${fixed(waiting, 2)} s`, when(decided && waiting === null, "no slip expected")),
    tile("block to command", live && now.late_us?.p50 ? `${shown(now.late_us.p50, 2)} µs` : DASH, when(live && now.late_us?.p99, `99 % within ${shown(now.late_us?.p99 ?? 0, 2)} µs${late}`)),
    tile("blocks lost to the controller", live ? String(lost) : DASH, when(live, "since this server joined"), { level: live && lost ? "look" : "" }),
  ];
}

/** Rows of the state table: title, current word and its meaning. */
function stateRows(now, helps) {
  const rows = [["guard", "guard_state", now.guard_state], ["cause", "cause", now.cause], ["held back by", "cause", now.guard_limit === "NO_CAUSE" ? undefined : now.guard_limit],
    ["mode", "mode", now.mode], ["reason", "reason", now.reason], ["limit", "limit", now.limit], ["contact", "state", now.state]];
  return rows.filter(([title, , word]) => word !== undefined || title !== "held back by")
    .map(([title, column, word]) => made("tr", [made("td", title), made("td", word ?? DASH), made("td", word ? (helps.get(`${column} ${word}`) ?? "") : "unknown now")]));
}

function lostWords(now) {
  if (!now.lost) return "";
  const { controller, viewer, dropped, commands, late, refused } = now.lost;
  return `Since this server joined the run: ${controller} blocks lost before the controller; of ${commands} commands ${late} later than 1 ms, ${refused} refused by the rig; `
    + `${viewer} blocks lost before this page's server, ${dropped} messages dropped there because it was too slow, ${now.unreadable} reports of unreadable ones. `
    + `Stalls of the computer, counted by the recorder: ${now.pauses}. Open pages: ${now.viewers}; dropped as too slow: ${now.viewers_dropped}.`;
}

/** The table row of an event. */
function eventRow(event) {
  const cells = [fixed(event.t_s, 3), event.at, event.source, event.code, event.weight, event.text, event.help];
  const row = made("tr", cells.map((text, at) => {
    const cell = document.createElement("td");
    cell.textContent = text; // untrusted: any client of the bus may have sent it
    cell.className = at === 0 ? "number" : at < 5 ? "key" : "";
    return cell;
  }), { className: { F: "bad", S: "look", M: "look" }[event.letter] ?? "" });
  return row;
}
