// Curves: one uPlot plot per panel, all zoomed by the same time axis.
"use strict";

const LEFT = 72, RIGHT = 14; // margins of the plotting area in pixels, the same for all panels and the ribbon
// pale colours are transparent, as the background of the page is light or dark
const EXCITING = "#1e844922", GRID = "#1c283316", LIMIT = "#b5402a", MARK = "#b5402a", BEGIN = "#1f2d3a";

/** Decode a curve (base64 of little-endian float32) to an array; null for missing values. */
function unpacked(text) {
  if (Array.isArray(text)) return text; // the live page passes numbers instead of base64
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return Array.from(new Float32Array(bytes.buffer), (value) => (Number.isNaN(value) ? null : value));
}

/** A colour `#rrggbb` with an alpha of 0 to 1. */
function faint(colour, alpha) {
  return colour + Math.round(255 * alpha).toString(16).padStart(2, "0");
}

/** A text with typeset symbols: the d of F_d becomes an index. */
function rich(text) {
  return text.split(/\b([vFuskx])_([a-z0-9])\b/).map((part, at) => {
    if (at % 3 !== 2) return part;
    const index = document.createElement("sub");
    index.textContent = part;
    return index;
  });
}

/** The shared time axis; plots and the ribbon listen to it. */
class TimeAxis {
  constructor(least, most) {
    this.least = least;
    this.most = Math.max(most, least + 1e-6);
    this.from = this.least;
    this.to = this.most;
    this.listeners = [];
    const wanted = location.hash.match(/^#([0-9.]+)-([0-9.]+)$/); // part of the run, as in page.html#2.9-3.1
    if (wanted) this.show(Number(wanted[1]), Number(wanted[2]));
  }

  show(from, to) {
    const width = Math.min(Math.max(to - from, 4e-3), this.most - this.least);
    this.from = Math.min(Math.max(from, this.least), this.most - width);
    this.to = this.from + width;
    for (const listener of this.listeners) listener();
  }

  around(t_s, width) {
    this.show(t_s - width / 2, t_s + width / 2);
  }
}

/** Series of one curve: its mean as a line, and its range, if any, as a band. */
function seriesOf(curve, logs) {
  const second = curve.log > 0;
  const colour = second ? faint(curve.colour, 0.6) : curve.colour;
  const whose = logs.length > 1 ? ` (${logs[curve.log].label})` : "";
  const label = (curve.symbol ? `${curve.symbol}, ` : "") + curve.words + whose;
  const line = { label, stroke: colour, width: second ? 1 : 1.4, dash: second ? [6, 4] : undefined, points: { show: false } };
  line.value = (plot, value) => (value === null || value === undefined ? "-" : value.toPrecision(4));
  const range = { stroke: "transparent", width: 0, points: { show: false }, label: "" };
  return "least" in curve ? [range, { ...range }, line] : [line];
}

/** Draw behind the curves: times of vibration, and the start of control. */
function drawBehind(plot, logs) {
  if (logs.length > 1) return;
  const { ctx, bbox } = plot;
  const modes = logs[0].bands.find((row) => row.title === "mode");
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  ctx.fillStyle = EXCITING;
  for (const [from, to, word] of modes ? modes.stretches : []) {
    if (word !== "excite") continue;
    const left = plot.valToPos(from, "x", true), right = plot.valToPos(to, "x", true);
    ctx.fillRect(left, bbox.top, right - left, bbox.height);
  }
  if (logs[0].in_charge_from_s !== null) {
    const at = plot.valToPos(logs[0].in_charge_from_s, "x", true);
    ctx.strokeStyle = BEGIN;
    ctx.setLineDash([2, 4]);
    ctx.beginPath();
    ctx.moveTo(at, bbox.top);
    ctx.lineTo(at, bbox.top + bbox.height);
    ctx.stroke();
  }
  ctx.restore();
}

/** Draw over the curves: limits as dashed, labelled lines; slips as triangles. */
function drawOver(plot, panel, logs) {
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top - 8, bbox.width, bbox.height + 8);
  ctx.clip();
  ctx.strokeStyle = ctx.fillStyle = LIMIT;
  ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
  ctx.textAlign = "left";
  ctx.textBaseline = "alphabetic";
  for (const limit of panel.limits) {
    // a limit beyond the axis, which the curve scales, is named at its edge
    const at = plot.valToPos(limit.value, "y", true), beyond = at < bbox.top ? ", above" : at > bbox.top + bbox.height ? ", below" : "";
    const y = Math.min(Math.max(at, bbox.top), bbox.top + bbox.height), low = y > bbox.top + bbox.height / 2;
    ctx.setLineDash([8, 5]);
    ctx.beginPath();
    ctx.moveTo(bbox.left, y);
    ctx.lineTo(bbox.left + bbox.width, y);
    ctx.stroke();
    ctx.fillText(`${limit.words}, ${Number(limit.value.toPrecision(4))} ${panel.unit}${beyond}`, bbox.left + 8, y + (low ? -5 : 14) * devicePixelRatio);
  }
  ctx.setLineDash([]);
  const size = 5 * devicePixelRatio;
  for (const [number, log] of panel.slips ? logs.entries() : []) {
    ctx.fillStyle = ctx.strokeStyle = MARK;
    for (const [t_s, force_N] of log.slips) {
      const x = plot.valToPos(t_s, "x", true), y = plot.valToPos(force_N, "y", true) - size;
      ctx.beginPath();
      ctx.moveTo(x - size, y - size);
      ctx.lineTo(x + size, y - size);
      ctx.lineTo(x, y + size);
      ctx.closePath();
      if (number === 0) ctx.fill();
      else ctx.stroke();
    }
  }
  ctx.restore();
}

/** Vertical range of a panel: all curves, and the limits that are at most three times as large, with a margin. */
function heightOf(panel) {
  return (plot, least, most) => {
    const size = Math.max(Math.abs(least ?? 0), Math.abs(most ?? 0));
    const limits = panel.limits.map((limit) => limit.value).filter((value) => !size || Math.abs(value) <= 3 * size);
    let low = Math.min(least ?? 0, ...limits), high = Math.max(most ?? 1, ...limits);
    if (["velocity", "amplitude", "time to slip"].includes(panel.axis)) low = Math.min(low, 0);
    const room = 0.08 * (high - low || Math.abs(high) || 1);
    return [low === 0 ? 0 : low - room, high + room];
  };
}

/** Columns of a panel in the order of its series: the first curve is drawn last, on top. */
function columnsOf(panel, x) {
  const columns = [x];
  for (const curve of [...panel.curves].reverse()) {
    if ("least" in curve) columns.push(unpacked(curve.least), unpacked(curve.most));
    columns.push(unpacked(curve.mean));
  }
  return columns;
}

/** Plot a panel in `place`. */
function plotOf(place, panel, x, logs, axis) {
  const series = [{ label: "time", value: (plot, value) => (value === null || value === undefined ? "-" : `${value.toFixed(3)} s`) }];
  const bands = [], hidden = [];
  for (const curve of [...panel.curves].reverse()) {
    if ("least" in curve) {
      const at = series.length;
      bands.push({ series: [at + 1, at], fill: faint(curve.colour, curve.log > 0 ? 0.15 : 0.28) });
      hidden.push(at, at + 1);
    }
    series.push(...seriesOf(curve, logs));
  }
  const width = () => Math.max(place.clientWidth, 300);
  const options = {
    width: width(),
    height: panel.slips ? 260 : 190,
    padding: [12, RIGHT, 0, 0],
    cursor: { sync: { key: "time", setSeries: false }, drag: { x: true, y: false, setScale: false } },
    scales: { x: { time: false, range: () => [axis.from, axis.to] }, y: { range: heightOf(panel) } },
    axes: [
      { label: "time [s]", labelSize: 18, labelFont: "12px system-ui", size: 34, grid: { stroke: GRID } },
      {
        label: panel.unit ? `${panel.axis} [${panel.unit}]` : panel.axis,
        labelSize: 20,
        labelFont: "12px system-ui",
        size: LEFT - 20,
        grid: { stroke: GRID },
      },
    ],
    series,
    bands,
    hooks: {
      drawClear: [(plot) => drawBehind(plot, logs)],
      draw: [(plot) => drawOver(plot, panel, logs)],
      setSelect: [
        (plot) => {
          if (plot.select.width < 4) return;
          const from = plot.posToVal(plot.select.left, "x"), to = plot.posToVal(plot.select.left + plot.select.width, "x");
          plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
          axis.show(from, to);
        },
      ],
      ready: [(plot) => plot.over.addEventListener("dblclick", () => axis.show(axis.least, axis.most))],
    },
  };
  const plot = new uPlot(options, columnsOf(panel, x), place);
  const rows = [...plot.root.querySelectorAll(".u-legend .u-series")];
  for (const at of hidden) rows[at].style.display = "none";
  for (const row of rows.slice(1)) rows[0].after(row); // the legend lists the curves in the order of the panel
  for (const label of plot.root.querySelectorAll(".u-label")) label.replaceChildren(...rich(label.textContent));
  axis.listeners.push(() => plot.setScale("x", { min: axis.from, max: axis.to }));
  addEventListener("resize", () => plot.setSize({ width: width(), height: options.height }));
  return plot;
}
