// The ribbon: modes and limits of controller and guard, a row each, and the events, over the time axis of the curves.
"use strict";

const ROW = 20; // height of a row in pixels
const QUIET = "#1c28331a", BAD = "#c0392b70"; // transparent, as the background is light or dark
const COLOURS = ["#2a6fb53a", "#7d3c983a", "#148f773a", "#ca6f1e3a", "#7d8b1f3a", "#4a5fc13a"];

/** Assign colours to words in the order of first use; quiet words are grey. */
function colouring() {
  const known = new Map([["excite", "#1e844955"], ["watch", QUIET], ["disabled", QUIET], ["stick", "#d4a01770"], ["slip", BAD],
    ["smooth", "#1e844930"], ["standstill", QUIET], ["unknown", QUIET], ["fault", BAD], ["stopped", BAD], ["no limit", QUIET]]);
  return (word) => {
    if (!known.has(word)) known.set(word, COLOURS[known.size % COLOURS.length]);
    return known.get(word);
  };
}

/** Build the ribbon in `place`; a click on a word zooms to its interval, on an event to its time. */
function ribbon(place, logs, axis, helps) {
  const rows = [];
  for (const log of logs) {
    const whose = logs.length > 1 ? ` ${log.label}` : "";
    for (const row of log.bands) rows.push({ title: row.title + whose, stretches: row.stretches, kind: row.title });
    const events = () => log.events.filter((one) => !one.code.endsWith("PAUSE"));
    if (log.grows || events().length) rows.push({ title: "events" + whose, events });
  }
  if (!rows.length) return;
  const canvas = document.createElement("canvas"), colour = colouring();
  canvas.id = "bands";
  canvas.role = "img";
  canvas.ariaLabel = "modes, limits and events over time";
  place.append(canvas);
  const tip = document.createElement("div");
  tip.id = "tip";
  tip.hidden = true;
  document.body.append(tip);
  const inner = () => canvas.clientWidth - LEFT - RIGHT;
  const xOf = (t_s) => LEFT + (inner() * (t_s - axis.from)) / (axis.to - axis.from);

  function drawRow(ctx, row, top) {
    ctx.fillStyle = "#566573";
    ctx.textAlign = "right";
    ctx.fillText(row.title, LEFT - 6, top + 14);
    ctx.textAlign = "left";
    ctx.save();
    ctx.beginPath();
    ctx.rect(LEFT, top, inner(), ROW);
    ctx.clip();
    for (const [from, to, word] of row.stretches ?? []) {
      if (to < axis.from || from > axis.to) continue;
      const left = Math.max(xOf(from), LEFT), right = Math.min(xOf(to), LEFT + inner());
      ctx.fillStyle = colour(word);
      ctx.fillRect(left, top + 1, Math.max(right - left, 1), ROW - 2);
      if (ctx.measureText(word).width + 8 < right - left) {
        ctx.fillStyle = "#1c2833";
        ctx.fillText(word, left + 4, top + 14);
      }
    }
    ctx.fillStyle = ctx.strokeStyle = "#6c3483";
    for (const event of row.events?.() ?? []) {
      const x = xOf(event.t_s);
      ctx.fillRect(x - 1, top + 1, 3, ROW - 2);
    }
    ctx.restore();
  }

  function draw() {
    const width = Math.max(place.clientWidth, 300), height = rows.length * ROW + 2;
    canvas.style.width = `${width}px`;
    canvas.style.height = `${height}px`;
    canvas.width = width * devicePixelRatio;
    canvas.height = height * devicePixelRatio;
    const ctx = canvas.getContext("2d");
    ctx.scale(devicePixelRatio, devicePixelRatio);
    ctx.font = "12px system-ui, sans-serif";
    rows.forEach((row, number) => drawRow(ctx, row, number * ROW));
  }

  /** The interval or event under the mouse, with its text. */
  function under(mouse) {
    const row = rows[Math.floor(mouse.offsetY / ROW)];
    if (!row) return null;
    const t_s = axis.from + ((mouse.offsetX - LEFT) / inner()) * (axis.to - axis.from);
    if (row.events) {
      const near = row.events().filter((one) => Math.abs(xOf(one.t_s) - mouse.offsetX) < 5);
      return near.length ? { from: near[0].t_s - 0.5, to: near[0].t_s + 0.5, text: near.map((one) => `${one.t_s.toFixed(3)} s ${one.code}: ${one.text}`).join("\n") } : null;
    }
    const found = row.stretches.find(([from, to]) => from <= t_s && t_s <= to);
    if (!found) return null;
    const [from, to, word] = found;
    return { from, to, text: `${row.title}: ${word}, ${from.toFixed(3)} to ${to.toFixed(3)} s. ${helps.get(word) ?? ""}` };
  }

  canvas.addEventListener("mousemove", (mouse) => {
    const found = under(mouse);
    tip.hidden = !found;
    if (!found) return;
    tip.textContent = found.text;
    tip.style.left = `${Math.min(mouse.clientX + 12, innerWidth - 320)}px`;
    tip.style.top = `${mouse.clientY + 14}px`;
  });
  canvas.addEventListener("mouseleave", () => (tip.hidden = true));
  canvas.addEventListener("click", (mouse) => {
    const found = under(mouse);
    if (found) axis.show(found.from - 0.1 * (found.to - found.from), found.to + 0.1 * (found.to - found.from));
  });
  canvas.addEventListener("dblclick", () => axis.show(axis.least, axis.most));
  axis.listeners.push(draw);
  addEventListener("resize", draw);
  draw();
}
