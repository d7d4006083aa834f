// Ratios to whatever is chosen, with their intervals: one row a cell.
import * as Plot from "@observablehq/plot";
import { clippedMarks, dotLook, figure, logAxis, logScale, rowLabels } from "../chart.js";
import { paintOf } from "../dom.js";
import { compare, entrants, ratioText, reference, referenceName, seriesOfName, MEASURES, SIX } from "../model.js";
import { FEWEST_OF_AN_INTERVAL, geometricMean } from "../statistics.js";
import { factor, plural, sentence } from "../words.js";
import { empty, profiled } from "./overview.js";

export function pairwise(context) {
  const { model, state } = context;
  const cells = entrants(model, state);
  const against = referenceName(model, state);
  const order = profiled(context, cells).map((one) => one.name);
  const names = state.strategy.length ? order : order.filter((name) => name !== state.against).slice(0, SIX);
  const points = [];
  const rows = [];
  const order_of = [];
  for (const [cell, series] of cells) {
    let any = false;
    for (const name of names) {
      const run = series.get(name);
      const base = run && reference(model, state, cell, run);
      if (!run || !base || run === base) continue;
      const found = compare(model, run, base, state.measure);
      if (!found) continue;
      any = true;
      points.push({ name, cell, run, found, key: cell.key });
      rows.push([
        seriesOfName(model, state, name).label,
        cell.title,
        ratioText(found),
        base.contestant.label,
        found.paired ? "yes" : "no",
      ]);
    }
    if (any) order_of.push(cell);
  }
  const title = `How many times as fast as ${against}? ${sentence(MEASURES[state.measure].name)}`;
  if (!points.length) return [empty(title, `Nothing of this selection can be compared with ${against}.`)];
  const axis = logAxis(
    points.flatMap((p) => [p.found.middle]),
    { include: [1] },
  );
  const means = names
    .map((name) => [name, points.filter((p) => p.name === name)])
    .filter(([, own]) => own.length)
    .map(([name, own]) => ({
      name,
      key: "geometric mean",
      run: own[0].run,
      x: geometricMean(own.map((p) => p.found.middle)),
      of: own.length,
      low: geometricMean(own.map((p) => p.found.low)),
      high: geometricMean(own.map((p) => p.found.high)),
    }));
  const clipped = (v) => axis.clip(v)[0];
  const drawn = points.map((p) => {
    const [x, side] = axis.clip(p.found.middle);
    return { ...p, x, side, y: p.key, low: clipped(p.found.low), high: clipped(p.found.high), paint: paintOf(p.run.contestant) };
  });
  const label = new Map(order_of.map((cell) => [cell.key, cell.title]));
  label.set("geometric mean", "geometric mean");
  const fewest = Math.min(...points.map((p) => p.run.repetitions));
  const looks = names.filter((name) => points.some((p) => p.name === name));
  const each = (name, list) => list.filter((p) => p.name === name);
  return [
    figure({
      title,
      reading:
        `A point to the right of 1 is faster. Its line is the 95 % interval of the ratio (bootstrap over whole rounds) or, with fewer than five repetitions, their range; ~ marks ratios of different sessions. The last row has the geometric mean over each strategy's cells; its line reaches from the mean of the intervals' lower ends to that of their upper ends.` +
        (state.strategy.length
          ? ""
          : ` Shown are the ${plural(looks.length, "strategy").replace("strategys", "strategies")} with the best profiles; the filter of strategies shows others.`),
      notes: [
        fewest < FEWEST_OF_AN_INTERVAL && MEASURES[state.measure].column === undefined
          ? "Some have fewer than five repetitions: their lines are ranges, not intervals."
          : "",
        points.some((p) => p.found.disturbed)
          ? "Faint points were measured while the machine was disturbed: see their details."
          : "",
        axis.outside ? `${plural(axis.outside, "point")} beyond the axis: arrows at its edge.` : "",
      ].filter(Boolean),
      least: 340,
      plot: (width) => {
        const { left, cut } = rowLabels([...label.values()], width);
        return {
          height: 60 + 22 * (order_of.length + 1),
          marginLeft: left,
          marginRight: 24,
          marginTop: 34,
          marginBottom: 36,
          x: logScale(axis, width - left - 30, "times as fast →", { axis: "both", grid: true }),
          y: {
            type: "point",
            domain: [...order_of.map((cell) => cell.key), "geometric mean"],
            tickFormat: (key) => cut(label.get(key)),
            label: null,
            padding: 0.6,
          },
          marks: [
            Plot.ruleX([1], { stroke: "var(--ink)", strokeWidth: 1.2 }),
            Plot.ruleY(order_of, { y: "key", stroke: "var(--line)", strokeWidth: 0.6 }),
            ...looks.flatMap((name, i) => {
              const { contestant } = seriesOfName(model, state, name);
              const dy = (i - (looks.length - 1) / 2) * Math.min(3, 14 / looks.length);
              return [
                Plot.ruleY(each(name, drawn), {
                  y: "key",
                  x1: "low",
                  x2: "high",
                  stroke: paintOf(contestant),
                  strokeWidth: 1.6,
                  strokeOpacity: (p) => (p.found.disturbed ? 0.25 : 0.75),
                  dy,
                }),
                Plot.dot(
                  each(name, drawn).filter((p) => !p.side),
                  { x: "x", y: "key", ...dotLook(contestant, 4), dy, opacity: (p) => (p.found.disturbed ? 0.35 : 1) },
                ),
                Plot.ruleY(each(name, means), {
                  y: "key",
                  x1: (d) => clipped(d.low ?? d.x),
                  x2: (d) => clipped(d.high ?? d.x),
                  stroke: paintOf(contestant),
                  strokeWidth: 2,
                  dy,
                }),
                Plot.dot(each(name, means), { x: (d) => clipped(d.x), y: "key", ...dotLook(contestant, 5.5), dy }),
              ];
            }),
            clippedMarks(drawn, "x"),
          ],
        };
      },
      points: [
        ...drawn.map((p) => ({
          x: p.x,
          y: p.key,
          run: p.run,
          current: p.run.key === state.point,
          lines: [seriesOfName(model, state, p.name).label, p.cell.title, `${ratioText(p.found)} times as fast`],
        })),
        ...means.map((p) => ({
          x: clipped(p.x),
          y: p.key,
          run: undefined,
          lines: [
            seriesOfName(model, state, p.name).label,
            `geometric mean over ${plural(p.of, "cell")}: ${factor(p.x)}`,
          ],
        })),
      ],
      choose: context.choose,
      table: { head: ["strategy", "cell", "times as fast (95 %)", "compared with", "paired"], rows },
    }),
    context.legend(looks),
  ];
}
