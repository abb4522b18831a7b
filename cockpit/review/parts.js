// Elements shared by the pages of runs. Texts are inserted as text, never as HTML.
"use strict";

/** An element with a text or children; `more`: its properties. */
function made(tag, content, more = {}) {
  const element = Object.assign(document.createElement(tag), more);
  element.append(...(Array.isArray(content) ? content : [content]).flatMap((part) => (typeof part === "string" ? rich(part) : [part])));
  return element;
}

function into(id, ...children) {
  document.getElementById(id).append(...children);
}

/** A box that scrolls if the page is narrower than its content. */
function wide(content) {
  return made("div", [content], { className: "wide", tabIndex: 0 });
}

function table(head, rows) {
  const heads = made("tr", head.map((text) => made(text ? "th" : "td", text)));
  return wide(made("table", [heads, ...rows]));
}

/** Latency histogram as SVG: a bar per interval, its height the logarithm of the count. */
function histogram(logs) {
  const w = 900, h = 200, left = 60, bottom = 40, top = 26;
  const least = Math.min(...logs.map((log) => log.latency.edges_us[0])), most = Math.max(1500, ...logs.map((log) => log.latency.edges_us.at(-1)));
  const highest = Math.max(...logs.flatMap((log) => log.latency.counts));
  const px = (us) => left + ((w - left - 10) * Math.log(us / least)) / Math.log(most / least);
  const py = (count) => h - bottom - ((h - bottom - top) * Math.log10(1 + count)) / Math.log10(1 + highest);
  const svg = (tag, attributes, text = "") => {
    const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    element.textContent = text;
    return element;
  };
  const picture = svg("svg", { viewBox: `0 0 ${w} ${h}`, "font-size": 12, role: "img", "aria-label": "histogram of latency" });
  for (const [at, log] of logs.entries()) {
    const fill = at === 0 ? "#2a6fb5" : "none";
    log.latency.counts.forEach((count, bar) => {
      const [from, to] = [px(log.latency.edges_us[bar]), px(log.latency.edges_us[bar + 1])];
      picture.append(svg("rect", { x: from, y: py(count), width: to - from, height: h - bottom - py(count), fill, stroke: fill === "none" ? "#b5402a" : "none" }));
    });
  }
  picture.append(svg("line", { x1: px(1000), x2: px(1000), y1: 5, y2: h - bottom, stroke: "#b5402a", "stroke-dasharray": "6 4" }));
  const ticks = [1, 10, 100, 1e3, 1e4, 1e5, 1e6].flatMap((us) => [us, 2 * us, 5 * us]);
  for (const us of ticks.filter((tick) => tick >= least && tick <= most)) picture.append(svg("text", { x: px(us), y: h - bottom + 16, "text-anchor": "middle" }, us < 1000 ? `${us} µs` : `${us / 1000} ms`));
  for (let count = 1; count <= highest; count *= 10) picture.append(svg("text", { x: left - 6, y: py(count) + 4, "text-anchor": "end" }, String(count)));
  picture.append(svg("text", { x: (left + w) / 2, y: h - 6, "text-anchor": "middle" }, "time from the block to its command"));
  picture.append(svg("line", { x1: left, x2: w - 10, y1: h - bottom, y2: h - bottom, stroke: "#808b96" }));
  picture.append(svg("text", { x: 0, y: 14 }, "commands"));
  return wide(picture);
}
