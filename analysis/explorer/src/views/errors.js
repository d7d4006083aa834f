// Time against error.
import * as Plot from "@observablehq/plot";
import { clippedMarks, dotLook, figure, logAxis, logScale } from "../chart.js";
import { make, paintOf } from "../dom.js";
import { MEASURES, compare, selected, value } from "../model.js";
import { factor, milliseconds, percent, plural, sentence, significant, tick } from "../words.js";
import { empty } from "./overview.js";

/** The share of missed pairs below which an approximate contestant counts in the sentence on top, as in analysis/figures/time_error.py. */
const FEW = 0.01;

const missedShare = (run) => (run.missed === null ? null : run.missed / Math.max(run.pairs ?? 1, 1));

/** The share of the reported pairs that are false; null where it is not known. */
function falseShare(run) {
  if (run.extra === null || run.pairs === null) return null;
  const reported = run.pairs - (run.missed ?? 0) + run.extra;
  return reported > 0 ? run.extra / reported : 0;
}

/** Whether a contestant without a guarantee answered wrongly: what time against error is about. */
export const errs = (run) => run.contestant.guarantee === "approximate" && (run.missed ?? 0) + (run.extra ?? 0) > 0;

const ERRORS = {
  missed: {
    name: "missed pairs",
    of: missedShare,
    format: (v) => percent(v),
    reading: "Pairs of the oracle that were not reported, as a share of all.",
  },
  extra: {
    name: "false pairs",
    of: falseShare,
    format: (v) => percent(v),
    reading: "Reported pairs that the oracle does not have, as a share of the reported ones.",
  },
  protrusion: {
    name: "protrusion",
    of: (run) => run.protrusion,
    format: (v) => significant(v, 2),
    reading: "How far a vertex leaves a box that a query has read, in units of the scene: a valid box has exactly 0.",
  },
  false: {
    name: "false candidates per pair",
    of: (run) =>
      run.pairs === null || run.candidates === null
        ? null
        : (run.candidates - run.pairs + (run.missed_candidates ?? 0)) / Math.max(run.pairs, 1),
    format: (v) => significant(v, 3),
    reading: "Candidates that are no pairs, for each pair.",
  },
  looseness: {
    name: "looseness of the boxes",
    of: (run) => run.looseness,
    format: (v) => percent(v),
    reading: "Summed surface area of the boxes over that of tight ones, minus one: loose boxes cost query time.",
  },
};

/** Colours and markers of the approximate strategies, in the order of their ids: those of analysis/figures/time_error_panels.py. */
const COLOURS = ["#D55E00", "#009E73", "#AA4499", "#E69F00", "#56B4E9", "#8C7A00", "#CC79A7", "#A8324A", "#5D4A9C", "#117733"];
const MARKERS = ["o", "s", "^", "D", "v", "p", "<", "h", ">", "d"];

/** Returns, for each approximate strategy, a contestant that looks unlike the others: their family has one colour. */
function apart(model) {
  const approximate = model.contestants.filter((one) => one.guarantee === "approximate");
  const ids = [...new Set(approximate.map((one) => one.id))].sort();
  return new Map(
    ids.map((id, i) => {
      const first = approximate.find((one) => one.id === id);
      const corners = model.data.palette.corners[MARKERS[i % MARKERS.length]] ?? [];
      const paint = `color-mix(in srgb, ${COLOURS[i % COLOURS.length]} 80%, var(--ink))`;
      return [id, { ...first, paint, look: { ...first.look, corners, filled: true } }];
    }),
  );
}

export function errors(context) {
  const { model, state } = context;
  const cell = context.cell;
  if (!cell) return [empty("Time against error", "No cell of this selection has a time.")];
  const runs = selected(model, { ...state, contestants: "all" }).filter(
    (run) => run.cell === cell && value(model, run, state.measure) > 0,
  );
  const looks = apart(model);
  const figures = Object.values(ERRORS)
    .map((error) => one(context, error, runs, looks))
    .filter(Boolean);
  if (!figures.length)
    return [
      empty(
        `Time against error: ${cell.title}`,
        "All contestants of this cell have the same errors. Cells with contestants that err come first in the menu.",
      ),
    ];
  return [
    ...["none", ""].map((known) => bargain(model, runs, known)).map((text, i, all) => text && text !== all[i - 1] && make("p", { class: "bargain", text })),
    make("p", {
      class: "lead",
      text: `One cell, with every contestant and setting, also those without a guarantee: ${cell.title}. Further down and further left is better. The line joins the contestants that no other one beats in both time and error.`,
    }),
    make("div", { class: "pair" }, figures),
    context.legendList([...new Map(runs.map(({ contestant: one }) => [one.id, [looks.get(one.id) ?? one, one.title]])).values()]),
  ];
}

function one({ model, state, choose }, error, runs, looks) {
  const usable = runs
    .map((run) => ({ run, time: value(model, run, state.measure), error: error.of(run) }))
    .filter((p) => p.error !== null && p.error >= 0);
  if (new Set(usable.map((p) => p.error)).size < 2) return null;
  // As in the report (analysis/figures/time_error_panels.py): time to the right, the error upwards.
  const times = logAxis(usable.map((p) => p.time));
  // Errors are not clipped: the few that differ are the finding. An error of exactly 0 has its own place, below all others.
  const errors = usable.map((p) => p.error).filter((v) => v > 0);
  const axis = logAxis([], { include: [] });
  if (errors.length) axis.domain = [Math.min(...errors) / 1.1, Math.max(...errors) * 1.1];
  const zero = axis.domain[0] / Math.max((axis.domain[1] / axis.domain[0]) ** 0.12, 1.08);
  const above = Math.sqrt(zero * axis.domain[0]);
  const points = usable.map((p) => {
    const [x, side] = times.clip(p.time);
    const look = looks.get(p.run.contestant.id) ?? p.run.contestant;
    return { ...p, look, x, y: p.error === 0 ? zero : p.error, side, paint: paintOf(look) };
  });
  const front = pareto(points);
  const measure = MEASURES[state.measure];
  return figure({
    title: sentence(error.name),
    reading: error.reading,
    notes: times.outside ? [`${plural(times.outside, "point")} beyond the axis of time: arrows at its edge.`] : [],
    plot: (width) => ({
      height: 330,
      marginLeft: 68,
      marginBottom: 44,
      marginRight: 24,
      x: logScale(times, width - 90, `${measure.name}${measure.unit === "ms" ? ", ms per frame" : ""} →`, { grid: true }),
      y: {
        ...logScale({ domain: [zero ** 1.25 / axis.domain[0] ** 0.25, axis.domain[1]] }, 220, `↑ ${error.name}`, { grid: true }),
        ticks: [zero, ...logScale(axis, 200, "").ticks.filter((t) => t > above)],
        tickFormat: (v) => (v === zero ? "0" : error.format(1) === "100\u202f%" ? `${tick(v * 100)}%` : tick(v)),
      },
      marks: [
        Plot.ruleY([above], { stroke: "var(--line)", strokeDasharray: "2 3" }),
        Plot.line(front, { x: "x", y: "y", stroke: "var(--soft)", strokeWidth: 1, curve: "step-after" }),
        ...points.map((p) => Plot.dot([p], { x: "x", y: "y", ...dotLook(p.look, 4.5) })),
        clippedMarks(points, "x"),
      ],
    }),
    points: points.map((p) => ({
      x: p.x,
      y: p.y,
      run: p.run,
      looks: p.look,
      current: p.run.key === state.point,
      lines: [
        p.run.contestant.label,
        `${measure.format(p.time)}${measure.unit === "ms" ? " ms" : ""}`,
        `${error.name}: ${error.format(p.error)}`,
        p.run.contestant.guarantee.replace("_", " "),
      ],
    })),
    choose,
    table: {
      head: ["contestant", `${measure.name}${measure.unit === "ms" ? ", ms" : ""}`, error.name],
      rows: usable
        .toSorted((a, b) => a.time - b.time)
        .map((p) => [p.run.contestant.label, measure.format(p.time), error.format(p.error)]),
    },
  });
}

/**
 * Says what errors buy in a cell: how many times as fast as the fastest exact contestant the fastest is that misses less than FEW of the
 * pairs; of those that know nothing of the future ("none"), or of all (""). "" if nothing misses pairs.
 */
function bargain(model, runs, known) {
  const fastest = (list) => list.reduce((best, run) => (best && value(model, best, "with_motion") <= value(model, run, "with_motion") ? best : run), null);
  const timed = runs.filter((run) => run.contestant.family !== "oracle" && run.times.length && (!known || run.contestant.foresight === known));
  const exact = fastest(timed.filter((run) => run.contestant.guarantee !== "approximate"));
  const few = fastest(timed.filter((run) => run.contestant.guarantee === "approximate" && run.pairs > 0 && missedShare(run) < FEW));
  if (!exact || !few || !runs.some(errs)) return "";
  const ms = (run) => `${milliseconds(value(model, run, "with_motion"))}\u00a0ms a frame`;
  const wins = value(model, few, "with_motion") < value(model, exact, "with_motion");
  const ratio = wins ? compare(model, few, exact, "with_motion") : compare(model, exact, few, "with_motion");
  const ends = [
    ratio.low < ratio.high && `${factor(ratio.low)} to ${factor(ratio.high)}`,
    ratio.disturbed && "a doubtful run: the machine was disturbed",
    ratio.low <= 1 && !wins && "this run does not tell them apart",
  ].filter(Boolean);
  const doubt = ratio.low <= 1 && wins ? ", which may be no gain" : "";
  const times = `${factor(ratio.middle)} times as fast${ends.length ? ` (${ends.join("; ")})` : ""}${doubt}`;
  const one = `${few.contestant.label} takes ${ms(few)} and missed ${few.missed ? percent(missedShare(few)) : "nothing here, but promises nothing"}`;
  const other = `the fastest exact one, ${exact.contestant.title}, takes ${ms(exact)}`;
  return (
    `${known ? "If nothing of the future is known" : "Whatever is known of the future"}, missing up to ${percent(FEW, 1)} of the pairs ` +
    (wins ? `makes a frame ${times}: ${one}; ${other}.` : `gains nothing: ${other} and is ${times} as the fastest with errors (${one}).`)
  );
}

/** Returns the points that no other beats in both coordinates, from left to right. */
function pareto(points) {
  const front = [];
  for (const point of points.toSorted((a, b) => a.time - b.time || a.y - b.y)) if (!front.length || point.y < front.at(-1).y) front.push(point);
  return front;
}
