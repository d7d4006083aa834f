// Times over l and over n, one figure a scene.
import * as Plot from "@observablehq/plot";
import { clippedMarks, dotLook, figure, lineLook, logAxis, logScale } from "../chart.js";
import { make, paintOf } from "../dom.js";
import { leading } from "../looks.js";
import { MEASURES, SIX, endsOf, entrants, seriesOfName, value } from "../model.js";
import { SCOPES } from "../statistics.js";
import { plural, tick } from "../words.js";
import { empty, profiled } from "./overview.js";

export function scaling(context) {
  const cells = entrants(context.model, context.state);
  const over_l = sweeps(cells, "l", ["primitives"]);
  const over_n = sweeps(cells, "primitives", ["l"]);
  if (!over_l.length && !over_n.length)
    return [empty("Over l and over n", "No scene of this selection has two sizes or two values of l.")];
  const names = new Set([...over_l, ...over_n].flatMap((sweep) => [...sweep.lines.keys()]));
  const order = profiled(context, cells).map((one) => one.name).filter((name) => names.has(name));
  const strong = new Set(order.slice(0, SIX));
  return [
    over_l.length &&
      make(
        "section",
        {},
        make("h2", { text: "Over l, the frames per keyframe" }),
        make("p", {
          class: "lead",
          text: "The work of event-driven strategies depends on the keyframes only: their lines fall as more frames share it. A refit pays for every frame, so its line is level.",
        }),
        figures(context, over_l, "l", strong),
      ),
    over_n.length &&
      make(
        "section",
        {},
        make("h2", { text: "Over n, the triangles of both bodies" }),
        make("p", {
          class: "lead",
          text: "Both axes are logarithmic: work proportional to n is as steep as the thin grey lines.",
        }),
        figures(context, over_n, "primitives", strong),
      ),
    context.legend([...strong], names.size - strong.size, leading),
  ].filter(Boolean);
}

/** Returns the sweeps of cells that differ in one field only, with at least two values of it. */
export function sweeps(cells, field, fixed) {
  const found = new Map();
  for (const [cell, series] of cells) {
    const key = [
      cell.scene,
      cell.scalar,
      cell.machine.index,
      cell.commit.index,
      cell.continuous,
      ...fixed.map((name) => cell[name]),
    ].join("~");
    if (!found.has(key)) found.set(key, { cells: new Map(), lines: new Map(), first: cell });
    const sweep = found.get(key);
    sweep.cells.set(cell[field], cell);
    for (const [name, run] of series) {
      if (!sweep.lines.has(name)) sweep.lines.set(name, []);
      sweep.lines.get(name).push({ at: cell[field], run });
    }
  }
  for (const { lines } of found.values()) for (const line of lines.values()) line.sort((a, b) => a.at - b.at);
  return [...found.values()].filter((sweep) => sweep.cells.size > 1).sort((a, b) => b.cells.size - a.cells.size);
}

/** Figures of the sweeps: those with two values only are folded where there are others. */
function figures(context, sweeps, field, strong) {
  const draw = (list) =>
    make(
      "div",
      { class: "pair" },
      list.map((sweep) => sweepFigure(context, sweep, field, strong)),
    );
  const [long, short] = [sweeps.filter((s) => s.cells.size > 2), sweeps.filter((s) => s.cells.size === 2)];
  if (!long.length || !short.length) return draw(sweeps);
  const more = make("details", {}, make("summary", { text: `${plural(short.length, "more figure")} with two values` }));
  more.addEventListener("toggle", () => more.open && more.children.length === 1 && more.append(draw(short)));
  return [draw(long), more];
}

/** Draws a sweep: strong lines, of which the first stands out, and the others pale if they are wanted. */
export function sweepFigure({ model, state, choose }, sweep, field, strong) {
  const measure = MEASURES[state.measure];
  const { first } = sweep;
  const place = [
    first.shown,
    field === "l" ? `${first.size} triangles` : `${plural(first.l, "frame")} a keyframe`,
    model.several.scalars && first.scalar,
    model.several.commits && first.commit.label,
    model.several.machines && first.machine.label,
  ]
    .filter(Boolean)
    .join(", ");
  const kept = [...sweep.lines].filter(([name]) => strong.has(name) || state.lines === "all");
  const all = kept.flatMap(([, line]) => line.map(({ run }) => value(model, run, state.measure)));
  const axis = logAxis(all);
  const at = [...sweep.cells.keys()].sort((a, b) => a - b);
  const points = [];
  const rows = [];
  const [recommended] = strong;
  const [leader] = leading([...strong].map((name) => seriesOfName(model, state, name).contestant));
  const lines = kept.map(([name, line]) => {
    const series = seriesOfName(model, state, name);
    const best = name === recommended;
    const contestant = best ? leader : series.contestant;
    const own = line.map(({ at: x, run }) => {
      const time = value(model, run, state.measure);
      const ends = strong.has(name) ? endsOf(model, run, state.measure) : { low: time, high: time }; // pale lines have no bars
      const [y, side] = axis.clip(time);
      points.push({
        x,
        y,
        run,
        looks: contestant,
        current: run.key === state.point,
        lines: [
          run.contestant.label,
          `${field === "l" ? plural(x, "frame") + " a keyframe" : `${run.cell.size} triangles`}: ${measure.format(time)}${measure.unit === "ms" ? " ms" : ""}`,
          ...(ends.low < ends.high ? [`${ends.isInterval ? "95\u00a0% interval" : "range of its rounds"} ${measure.format(ends.low)} to ${measure.format(ends.high)}`] : []),
        ],
      });
      return {
        x,
        y,
        side,
        low: axis.clip(ends.low)[0],
        high: axis.clip(ends.high)[0],
        paint: paintOf(contestant),
      };
    });
    rows.push([
      series.label,
      ...at.map((x) => {
        const hit = line.find((p) => p.at === x);
        return hit ? measure.format(value(model, hit.run, state.measure)) : "–";
      }),
    ]);
    return { contestant, own, pale: !strong.has(name), best };
  });
  const guides =
    field === "l"
      ? []
      : [0.12, 0.5, 0.88].map((share) => {
          const middle = axis.domain[0] ** (1 - share) * axis.domain[1] ** share;
          const centre = Math.sqrt(at[0] * at.at(-1));
          return at
            .map((x) => ({ x, y: (middle * x) / centre }))
            .filter((p) => p.y >= axis.domain[0] && p.y <= axis.domain[1]);
        });
  const ends = { domain: [at[0] / 1.15, at.at(-1) * 1.15] };
  return figure({
    title: place,
    notes: [
      state.measure in SCOPES ? "Upright bars: 95\u00a0% intervals of the times; with fewer than five rounds, their range." : "",
      axis.outside ? `${plural(axis.outside, "point")} beyond the axis: arrows at its edge.` : "",
    ].filter(Boolean),
    plot: (width) => ({
      height: 330,
      marginLeft: 56,
      marginBottom: 42,
      marginRight: 22,
      x: {
        type: "log",
        domain: ends.domain,
        ticks: spaced(at, width - 90),
        tickFormat: tick,
        label: field === "l" ? "frames a keyframe (l) →" : "triangles of both bodies →",
        labelAnchor: "center",
      },
      y: logScale(axis, 240, `↑ ${measure.name}${measure.unit === "ms" ? ", ms per frame" : ""}`, { grid: true }),
      marks: [
        ...guides
          .filter((g) => g.length > 1)
          .map((guide) =>
            Plot.line(guide, { x: "x", y: "y", stroke: "var(--soft)", strokeWidth: 0.7, strokeOpacity: 0.6 }),
          ),
        ...lines
          .filter((line) => line.pale)
          .map(({ contestant, own }) =>
            Plot.line(own, { x: "x", y: "y", ...lineLook(contestant, 1), strokeOpacity: 0.35 }),
          ),
        ...lines.filter((line) => !line.pale).flatMap(({ contestant, own, best }) => [
          Plot.ruleX(own, {
            x: "x",
            y1: "low",
            y2: "high",
            stroke: paintOf(contestant),
            strokeOpacity: 0.5,
            strokeWidth: 2.4,
          }),
          Plot.line(own, { x: "x", y: "y", ...lineLook(contestant, best ? 3 : 1.5) }),
          Plot.dot(
            own.filter((p) => !p.side),
            { x: "x", y: "y", ...dotLook(contestant, best ? 5.5 : 4) },
          ),
        ]),
        clippedMarks(
          lines.filter((line) => !line.pale).flatMap(({ own }) => own),
          "y",
        ),
      ],
    }),
    points,
    choose,
    table: { head: [`strategy${measure.unit === "ms" ? ", ms" : ""}`, ...at.map((x) => (field === "l" ? `l = ${x}` : tick(x)))], rows },
  });
}

/** Returns measured values as ticks, without those that would overlap. */
function spaced(values, room) {
  const span = Math.log(values.at(-1) / values[0]) || 1;
  const kept = [];
  for (const value of values) if (!kept.length || (Math.log(value / kept.at(-1)) / span) * room > 34) kept.push(value);
  return kept;
}
