// Frames of one cell: the worst ones, the latency over the clip, and query time next to the quality of the tree.
import * as Plot from "@observablehq/plot";
import { clippedMarks, dotLook, figure, lineLook, logAxis, logScale, meanLook, rowLabels } from "../chart.js";
import { make, paintOf } from "../dom.js";
import { SIX, entrants, seriesOfName } from "../model.js";
import { median } from "../statistics.js";
import { factor, milliseconds, plural, significant } from "../words.js";
import { empty } from "./overview.js";


export function frames(context) {
  const { model, state } = context;
  const cells = entrants(model, state, state.measure);
  const cell = context.cell;
  const series = cell && cells.get(cell);
  if (!series) return [empty("Frames", "No cell of this selection has a time.")];
  const runs = [...series.values()].filter((run) => run.worst !== null).sort((a, b) => a.worst - b.worst);
  const fast = [...series.values()].filter((run) => run.pace.length > 1).sort((a, b) => total(a) - total(b));
  const shown = state.strategy.length ? fast : fast.slice(0, SIX);
  const parts = [];
  if (runs.length) parts.push(worst(context, cell, runs));
  if (shown.length)
    parts.push(
      make(
        "div",
        { class: "pair" },
        [
          over(
            context,
            cell,
            shown,
            "latency",
            `Latency over the clip: ${cell.title}`,
            "Update and query, means of equal parts of the clip; motion evaluation is not included. A line rises where an aging tree costs time, or where there is more to find.",
            "ms per frame",
            (run) => run.pace.map(([begin, update, query]) => [begin, update + query]),
          ),
          over(
            context,
            cell,
            shown,
            "update",
            `Update over the clip: ${cell.title}`,
            "The update alone: peaks are rebuilds, or many events.",
            "ms per frame",
            (run) => run.pace.map(([begin, update]) => [begin, update]),
          ),
          over(
            context,
            cell,
            shown,
            "query",
            `Query time over the clip: ${cell.title}`,
            "The query alone, next to the quality of the tree that it searches.",
            "ms per frame",
            (run) => run.pace.map(([begin, , query]) => [begin, query]),
          ),
          over(
            context,
            cell,
            shown,
            "quality",
            `Quality of the tree over the clip: ${cell.title}`,
            "What the surface-area heuristic expects a random query to cost, divided by the same for a tree that is built at that time. A level line is a tree that does not age.",
            "× the cost of a rebuilt tree",
            (run) => share(run.quality.map(([t, quality]) => [t, quality])),
          ),
        ].filter(Boolean),
      ),
    );
  parts.push(stutter(context, cells));
  parts.push(context.legendOf(shown));
  return parts;
}

const total = (run) => run.pace.reduce((sum, [, update, query]) => sum + update + query, 0) / run.pace.length;

/** Times of samples as shares of the sampled part of the clip. */
function share(samples) {
  const [from, to] = [samples[0]?.[0], samples.at(-1)?.[0]];
  return samples.map(([t, v]) => [to > from ? (t - from) / (to - from) : 0, v]);
}

function worst({ model, state, choose }, cell, runs) {
  const axis = logAxis(runs.flatMap((run) => [run.p50, run.worst]));
  const rows = runs.map((run) => {
    const [x, side] = axis.clip(run.worst);
    return {
      run,
      y: String(run.index),
      x,
      side,
      p50: axis.clip(run.p50)[0],
      p99: axis.clip(run.p99)[0],
      paint: paintOf(run.contestant),
    };
  });
  const label = new Map(rows.map((row) => [row.y, row.run.contestant.label]));
  return figure({
    title: `Worst frames: ${cell.title}`,
    reading:
      "Update and query, without motion evaluation. The marker is the median frame, the bar ends at the 99th percentile, and the cross is the worst frame. A long line means stutter, even if the mean is good.",
    notes: axis.outside ? [`${plural(axis.outside, "value")} beyond the axis: arrows at its edge.`] : [],
    least: 340,
    plot: (width) => {
      const { left, cut } = rowLabels([...label.values()], width);
      return {
        height: 62 + 22 * rows.length,
        marginLeft: left,
        marginRight: 24,
        marginTop: 30,
        marginBottom: 38,
        x: logScale(axis, width - left - 30, "ms per frame →", { grid: true, axis: "both" }),
        y: {
          type: "point",
          domain: rows.map((row) => row.y),
          tickFormat: (key) => cut(label.get(key)),
          label: null,
          padding: 0.6,
        },
        marks: [
          Plot.ruleY(rows, { y: "y", x1: "p50", x2: "x", stroke: "paint", strokeWidth: 1 }),
          Plot.ruleY(rows, { y: "y", x1: "p50", x2: "p99", stroke: "paint", strokeWidth: 4, strokeOpacity: 0.6 }),
          ...rows.map((row) => Plot.dot([row], { x: "p50", y: "y", ...dotLook(row.run.contestant, 4.5) })),
          Plot.dot(
            rows.filter((row) => !row.side),
            { x: "x", y: "y", symbol: "times", stroke: "paint", strokeWidth: 2, r: 4 },
          ),
          clippedMarks(rows, "x"),
        ],
      };
    },
    points: rows.map((row) => ({
      x: row.x,
      y: row.y,
      also: [row.p50, row.p99],
      run: row.run,
      current: row.run.key === state.point,
      lines: [
        row.run.contestant.label,
        `median ${milliseconds(row.run.p50)} ms, 99th percentile ${milliseconds(row.run.p99)} ms`,
        `worst ${milliseconds(row.run.worst)} ms, ${factor(row.run.worst / row.run.p50)} times the median`,
      ],
    })),
    choose,
    table: {
      head: ["contestant", "median, ms", "99th percentile", "worst", "worst over median"],
      rows: rows.map(({ run }) => [
        run.contestant.label,
        milliseconds(run.p50),
        milliseconds(run.p99),
        milliseconds(run.worst),
        factor(run.worst / run.p50),
      ]),
    },
  });
}

function over({ state, choose }, cell, runs, kind, title, reading, unit, samples) {
  const lines = runs
    .map((run) => ({ run, own: samples(run).filter(([, v]) => v > 0) }))
    .filter((line) => line.own.length > 1);
  if (!lines.length) return null;
  const axis = logAxis(
    lines.flatMap(({ own }) => own.map(([, v]) => v)),
    { include: kind === "quality" ? [1] : [] },
  );
  const drawn = lines.map(({ run, own }) => ({
    run,
    own: own.map(([at, v]) => {
      const [y, side] = axis.clip(v);
      return { x: 100 * at, y, side, v, paint: paintOf(run.contestant) };
    }),
  }));
  return figure({
    title,
    reading,
    notes: axis.outside ? [`${plural(axis.outside, "value")} beyond the axis: arrows at its edge.`] : [],
    plot: (width) => ({
      height: 290,
      marginLeft: 56,
      marginBottom: 40,
      marginRight: 22,
      x: { domain: [0, 100], label: "of the clip, % →", ticks: width < 420 ? 4 : 6 },
      y: logScale(axis, 200, `↑ ${unit}`, { grid: true }),
      marks: [
        kind === "quality" ? Plot.ruleY([1], { stroke: "var(--soft)" }) : null,
        ...drawn.flatMap(({ run, own }) => [
          Plot.line(own, { x: "x", y: "y", ...lineLook(run.contestant, 1.5) }),
          Plot.dot(
            own.filter((_, i) => i % 4 === 2),
            { x: "x", y: "y", ...dotLook(run.contestant, 4) },
          ),
        ]),
        clippedMarks(
          drawn.flatMap(({ own }) => own),
          "y",
        ),
      ],
    }),
    points: drawn.flatMap(({ run, own }) =>
      own.map((p) => ({
        x: p.x,
        y: p.y,
        run,
        lines: [run.contestant.label, `${significant(p.v, 3)} ${unit}, at ${Math.round(p.x)} % of the clip`],
      })),
    ),
    choose,
    table: {
      head: ["contestant", ...drawn[0].own.map((p) => `${Math.round(p.x)} %`)],
      rows: drawn.map(({ run, own }) => [run.contestant.label, ...own.map((p) => significant(p.v, 3))]),
    },
  });
}

/** How much worse than the median the worst frame is, in every cell. */
function stutter({ model, state, choose }, cells) {
  const of = new Map();
  for (const series of cells.values())
    for (const [name, run] of series)
      if (run.worst > 0 && run.p50 > 0) {
        if (!of.has(name)) of.set(name, []);
        of.get(name).push({ run, factor: run.worst / run.p50, name });
      }
  const points = [...of.values()].flat();
  if (!points.length) return null;
  const axis = logAxis(
    points.map((p) => p.factor),
    { include: [1] },
  );
  const order = [...of].sort((a, b) => median(a[1].map((p) => p.factor)) - median(b[1].map((p) => p.factor)));
  const drawn = points.map((p) => {
    const [x, side] = axis.clip(p.factor);
    return { ...p, x, side, y: p.name, paint: paintOf(p.run.contestant) };
  });
  const label = new Map(order.map(([name]) => [name, seriesOfName(model, state, name).label]));
  return figure({
    title: "How much worse than the median is the worst frame? Every cell",
    reading:
      "Each mark is one cell; the line is the median over the cells. Compare strategies here, not scenes: what there is to find in a frame differs from scene to scene.",
    notes: axis.outside ? [`${plural(axis.outside, "point")} beyond the axis: arrows at its edge.`] : [],
    least: 340,
    plot: (width) => {
      const { left, cut } = rowLabels([...label.values()], width);
      return {
        height: 60 + 22 * order.length,
        marginLeft: left,
        marginRight: 24,
        marginBottom: 38,
        x: logScale(axis, width - left - 30, "worst frame over median →", { grid: true, tickFormat: (v) => `${v}×` }),
        y: {
          type: "point",
          domain: order.map(([name]) => name),
          tickFormat: (key) => cut(label.get(key)),
          label: null,
          padding: 0.6,
        },
        marks: [
          Plot.dot(
            drawn.filter((p) => !p.side),
            { x: "x", y: "y", stroke: "paint", strokeWidth: 1.2, r: 3.5, strokeOpacity: 0.8 },
          ),
          Plot.dot(
            order.map(([name, own]) => ({ y: name, x: axis.clip(median(own.map((p) => p.factor)))[0] })),
            { x: "x", y: "y", ...meanLook, rowLabels },
          ),
          clippedMarks(drawn, "x"),
        ],
      };
    },
    points: drawn.map((p) => ({
      x: p.x,
      y: p.y,
      run: p.run,
      lines: [
        label.get(p.name),
        p.run.cell.title,
        `worst ${milliseconds(p.run.worst)} ms, ${factor(p.factor)} times the median`,
      ],
    })),
    choose,
    table: {
      head: ["strategy", "median of worst over median", "largest", "cells"],
      rows: order.map(([name, own]) => [
        label.get(name),
        factor(median(own.map((p) => p.factor))),
        factor(Math.max(...own.map((p) => p.factor))),
        String(own.length),
      ]),
    },
  });
}
