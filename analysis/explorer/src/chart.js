// Figures: a plot, its title and reading, points that lead to their runs by mouse and by keyboard, and its numbers.
import * as Plot from "@observablehq/plot";
import { hintScrolling, make, paintOf, symbol } from "./dom.js";
import { quantile } from "./statistics.js";
import { tick } from "./words.js";

/** Returns a marker for Plot, as analysis/figures/colours.py draws it. */
export function marker(contestant) {
  const { corners } = contestant.look;
  return {
    draw(context, size) {
      const scale = Math.sqrt(size / Math.PI) / 4.4;
      if (!corners.length) return context.arc(0, 0, 4.2 * scale, 0, 2 * Math.PI);
      corners.forEach(([x, y], i) => (i ? context.lineTo(x * scale, y * scale) : context.moveTo(x * scale, y * scale)));
      context.closePath();
    },
  };
}

/** A short vertical line as a marker: a mean among points. */
const bar = {
  draw(context, size) {
    const half = Math.sqrt(size / Math.PI);
    context.rect(-1.2, -half, 2.4, 2 * half);
  },
};

/** Returns the options of marks for means. */
export const meanLook = { symbol: bar, r: 9, fill: "var(--ink)", stroke: "var(--page)", strokeWidth: 0.7 };

/** Returns the options of a contestant's dots. */
export function dotLook(contestant, r = 4.5) {
  return {
    symbol: marker(contestant),
    r,
    stroke: paintOf(contestant),
    strokeWidth: 1.5,
    fill: contestant.look.filled ? paintOf(contestant) : "var(--page)",
  };
}

/** Returns the options of a contestant's line. */
export function lineLook(contestant, width = 1.7) {
  const dashes = contestant.look.dashes.map((part) => part * width);
  return { stroke: paintOf(contestant), strokeWidth: width, strokeDasharray: dashes.length ? dashes.join(" ") : null };
}

/**
 * Returns a logarithmic axis that no outlier stretches: its domain, and `clip`, which returns a value moved to the edge and
 * the side on which it was outside (-1, 0, 1). Outside are values beyond three times the spread of the middle half (Tukey's
 * outer fences, of logarithms), and at most a twentieth of the values at each end.
 */
export function logAxis(values, { include = [], least = 1.5 } = {}) {
  const sorted = values.filter((v) => v > 0 && Number.isFinite(v)).sort((a, b) => a - b);
  if (!sorted.length) return { domain: [0.5, 2], clip: (v) => [v, 0], outside: 0 };
  const [q05, q25, q75, q95] = [0.05, 0.25, 0.75, 0.95].map((share) => quantile(sorted, share));
  const spread = Math.max(q75 / q25, 1.05) ** 3;
  let low = Math.max(sorted[0], Math.min(q25 / spread, q05));
  let high = Math.min(sorted.at(-1), Math.max(q75 * spread, q95));
  // A little beyond is not worth an arrow.
  if (sorted[0] > low / 1.6) low = sorted[0];
  if (sorted.at(-1) < high * 1.6) high = sorted.at(-1);
  low = Math.min(low, ...include);
  high = Math.max(high, ...include);
  if (high / low < least) {
    const middle = Math.sqrt(high * low);
    [low, high] = [middle / Math.sqrt(least), middle * Math.sqrt(least)];
  }
  const margin = (high / low) ** 0.04;
  const clip = (v) => (v < low / margin ? [low / margin, -1] : v > high * margin ? [high * margin, 1] : [v, 0]);
  return { domain: [low / margin, high * margin], clip, outside: sorted.filter((v) => clip(v)[1] !== 0).length };
}

/**
 * Returns ticks of a logarithmic axis, as many as there is room for, all inside: 1, 2 and 5 times the powers of ten, or equal
 * steps where these are too few.
 */
export function logTicks([low, high], room) {
  const most = Math.max(2, Math.floor(room / 46));
  const inside = (value) => value >= low && value <= high;
  const powers = [];
  for (let power = Math.floor(Math.log10(low)); power <= Math.ceil(Math.log10(high)); ++power) powers.push(power);
  const times = (steps) => powers.flatMap((power) => steps.map((step) => Number(`${step}e${power}`))).filter(inside);
  if (times([1, 2, 5]).length < 3) return equalSteps(low, high, Math.min(most, 6));
  const ticks = [[1, 2, 5], [1, 3], [1]].map(times).find((list) => list.length <= most) ?? times([1]);
  const every = Math.ceil(ticks.length / most);
  return ticks.filter((_, i) => i % every === 0);
}

function equalSteps(low, high, most) {
  const least = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(least));
  const step = [1, 2, 5, 10].map((k) => k * power).find((one) => one >= least);
  const ticks = [];
  for (let k = Math.ceil(low / step); k * step <= high; ++k) ticks.push(Number((k * step).toPrecision(6)));
  return ticks;
}

/** Writes tick labels: on logarithmic axes Plot leaves out those that D3 thinks too many, although `logTicks` chose them. */
function label(chart, options) {
  for (const name of ["x", "y"]) {
    const { ticks, tickFormat } = options[name] ?? {};
    if (!Array.isArray(ticks) || typeof tickFormat !== "function") continue;
    for (const group of chart.querySelectorAll(`[aria-label="${name}-axis tick label"]`))
      [...group.children].forEach((text, i) => (text.textContent = tickFormat(ticks[i])));
  }
}

let ruler;
/** Cuts a text to a width in pixels, as drawn in the figures. */
export function fit(text, room) {
  ruler ??= Object.assign(document.createElement("canvas").getContext("2d"), {
    font: `12px ${getComputedStyle(document.body).fontFamily}`,
  });
  if (ruler.measureText(text).width <= room) return text;
  let end = text.length;
  while (end > 1 && ruler.measureText(`${text.slice(0, end)}…`).width > room) end -= 1;
  return `${text.slice(0, end)}…`;
}

/** Returns the margin for labels of rows, at most a share of the width, and a function that cuts a label to it. */
export function rowLabels(texts, width, most = 0.42) {
  fit("", 0);
  const left = Math.ceil(Math.min(Math.max(...texts.map((text) => ruler.measureText(text).width)) + 16, width * most));
  const room = left - 14;
  return {
    left,
    // The name of a scene is cut before its size and l, which tell its rows apart.
    cut: (text) => {
      const at = text.indexOf(", ");
      const tail = ruler.measureText(text.slice(at)).width;
      return at < 0 || tail > room * 0.6 ? fit(text, room) : fit(text.slice(0, at), room - tail) + text.slice(at);
    },
  };
}

/** Options of a logarithmic axis of Plot. */
export function logScale(axis, room, label, more = {}) {
  return { type: "log", domain: axis.domain, ticks: logTicks(axis.domain, room), tickFormat: tick, label, ...more };
}

/** Arrows at the edge for clipped points: pixel marks, `side` -1 or 1 along x or y. */
export function clippedMarks(points, along) {
  const outside = points.filter((p) => p.side);
  const glyph = (p) => (along === "x" ? (p.side < 0 ? "◂" : "▸") : p.side < 0 ? "▾" : "▴");
  return Plot.text(outside, {
    x: "x",
    y: "y",
    text: glyph,
    fill: "paint",
    fontSize: 13,
    stroke: "var(--page)",
    strokeWidth: 3,
  });
}

const known = new Map(); // figure -> redraw
const observer = new ResizeObserver((entries) => {
  for (const { target, contentRect } of entries) {
    const width = Math.round(contentRect.width);
    if (width && known.has(target) && known.get(target).width !== width) {
      known.get(target).width = width;
      known.get(target).draw(width);
    }
  }
});

/** Forgets the figures that left the page. */
export function forget() {
  for (const target of known.keys())
    if (!target.isConnected) {
      observer.unobserve(target);
      known.delete(target);
    }
}

/**
 * Makes a figure.
 *   plot(width)   the options of Plot
 *   points        [{x, y, run, lines: [text], also?: [x], looks?: contestant}]: what the pointer and the arrow keys visit, in data's units; `also` are
 *                 other places on the same row that the pointer takes for the point
 *   table         {head: [text], rows: [[text]]}: the same numbers for readers of tables
 *   choose(run)   called when a point is chosen
 *   least         the width below which the figure scrolls instead of shrinking
 */
export function figure({ title, reading, plot, points = [], table, choose, least = 300, notes = [] }) {
  const host = make("div", {
    class: "plot",
    tabindex: points.length ? 0 : null,
    role: points.length ? "application" : "img",
    "aria-label": `${title}. ${points.length ? `${points.length} points: arrow keys visit them, Enter shows where one comes from.` : ""}`,
  });
  const tip = make("div", { class: "tip", role: "status", "aria-live": "polite", hidden: true });
  const scroll = make("div", { class: "plot-scroll" }, host);
  let placed = [];
  let at = -1;

  const show = (index) => {
    at = index;
    const point = placed[index];
    host.querySelector(".ring")?.remove();
    if (!point) {
      tip.hidden = true;
      return;
    }
    host.querySelector("svg.chart").append(make("svg:circle", { class: "ring", cx: point.px, cy: point.py, r: 9 }));
    tip.replaceChildren(
      ...(point.run
        ? [make("div", { class: "tip-name" }, symbol(point.looks ?? point.run.contestant), point.lines[0])]
        : [make("div", { text: point.lines[0] })]),
      ...point.lines.slice(1).map((line) => make("div", { text: line })),
    );
    tip.hidden = false;
    const left = point.px - scroll.scrollLeft;
    const room = scroll.clientWidth;
    const width = tip.offsetWidth;
    tip.style.left = `${Math.max(4, Math.min(left > room / 2 ? left - width - 14 : left + 14, room - width - 4))}px`;
    tip.style.top = `${Math.max(0, Math.min(point.py - 12, host.clientHeight - tip.offsetHeight))}px`;
  };

  const nearest = (event) => {
    const box = host.getBoundingClientRect();
    const [x, y] = [event.clientX - box.left, event.clientY - box.top];
    let best = -1;
    let distance = 26 ** 2;
    placed.forEach((point, i) => {
      for (const px of [point.px, ...point.others]) {
        const d = (px - x) ** 2 + (point.py - y) ** 2;
        if (d < distance) [best, distance] = [i, d];
      }
    });
    return best;
  };

  const go = (dx, dy) => {
    if (!placed.length) return;
    if (at < 0) return show(0);
    const from = placed[at];
    let best = -1;
    let least = Infinity;
    placed.forEach((point, i) => {
      const [x, y] = [point.px - from.px, point.py - from.py];
      const along = dx ? x * dx : y * dy;
      const across = Math.abs(dx ? y : x);
      if (i === at || along < 0 || (along < 0.5 && i < at)) return;
      const cost = along + 3 * across;
      if (cost < least && (along >= 0.5 || across < 0.5)) [best, least] = [i, cost];
    });
    if (best >= 0) show(best);
  };

  const draw = (width) => {
    const options = plot(Math.max(width, least));
    const svg = Plot.plot({
      width: Math.max(width, least),
      style: { fontFamily: "inherit", fontSize: "12px", background: "none", overflow: "visible" },
      className: "chart",
      ...options,
    });
    const chart = svg.matches("svg") ? svg : svg.querySelector("svg");
    label(chart, options);
    const [sx, sy] = ["x", "y"].map((name) => svg.scale(name));
    const on = (scale, value) => scale.apply(value) + (scale.bandwidth ?? 0) / 2;
    placed = points
      .map((point) => ({
        ...point,
        px: on(sx, point.x),
        py: on(sy, point.y),
        others: (point.also ?? []).map((x) => on(sx, x)),
      }))
      .filter((point) => Number.isFinite(point.px) && Number.isFinite(point.py));
    at = -1;
    tip.hidden = true;
    host.replaceChildren(svg, tip);
    chart.setAttribute("aria-hidden", "true");
    placed.forEach(
      (point) =>
        point.current && chart.append(make("svg:circle", { class: "ring chosen", cx: point.px, cy: point.py, r: 9 })),
    );
  };

  if (points.length) {
    host.addEventListener("pointermove", (event) => show(nearest(event)));
    host.addEventListener("pointerleave", () => show(-1));
    host.addEventListener("blur", () => show(-1));
    host.addEventListener("click", (event) => {
      const index = nearest(event);
      if (index >= 0 && placed[index].run) choose(placed[index].run, host);
    });
    host.addEventListener("keydown", (event) => {
      const step = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowDown: [0, 1], ArrowUp: [0, -1] }[event.key];
      if (step) go(...step);
      else if (event.key === "Enter" && placed[at]?.run) choose(placed[at].run, host);
      else if (event.key === "Escape") show(-1);
      else return;
      event.preventDefault();
    });
  }
  known.set(scroll, { width: 0, draw });
  observer.observe(scroll);
  return make(
    "figure",
    {},
    make("figcaption", {}, make("h3", { text: title }), reading && make("p", { class: "reading", text: reading })),
    scroll,
    notes.map((text) => make("p", { class: "note", text })),
    table && numbers(table),
  );
}

/** Makes a figure's numbers, folded; the table is made when it is opened. */
function numbers({ head, rows }) {
  const details = make("details", { class: "numbers" }, make("summary", { text: `Numbers (${rows.length} ${rows.length === 1 ? "row" : "rows"})` }));
  details.addEventListener("toggle", () => {
    if (!details.open || details.children.length > 1) return;
    details.append(make("div", { class: "scroll", tabindex: 0 }, tableOf(head, rows)));
    hintScrolling(details);
  });
  return details;
}

/** Makes a table; cells are texts, numbers are aligned to the right. */
export function tableOf(head, rows) {
  const numeric = head.map(
    (_, i) => rows.length > 0 && rows.every((row) => /^[–~◂▸]? ?[\d.,\u202f]/.test(row[i] ?? "–") || row[i] === "–"),
  );
  const cell = (kind, text, i) =>
    make(kind, { class: numeric[i] ? "n" : null }, text instanceof Node ? text : document.createTextNode(text ?? "–"));
  return make(
    "table",
    {},
    make(
      "thead",
      {},
      make(
        "tr",
        {},
        head.map((text, i) => cell("th", text, i)),
      ),
    ),
    make(
      "tbody",
      {},
      rows.map((row) =>
        make(
          "tr",
          {},
          row.map((text, i) => cell("td", text, i)),
        ),
      ),
    ),
  );
}
