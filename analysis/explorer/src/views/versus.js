// Two commits or two machines side by side.
import * as Plot from "@observablehq/plot";
import { clippedMarks, dotLook, figure, logAxis, logScale, meanLook, rowLabels } from "../chart.js";
import { choice, make, paintOf } from "../dom.js";
import { MEASURES, compare, decided, ratioText, selected, seriesOfName, value } from "../model.js";
import { geometricMean } from "../statistics.js";
import { factor, plural, sentence } from "../words.js";
import { empty } from "./overview.js";

/** Returns the sources of results: every pair of a commit and a machine. */
export function sources(model) {
  const found = new Map();
  for (const cell of model.cells) {
    const key = `${cell.commit.label}~m${cell.machine.index + 1}`;
    const name = [
      model.several.commits || !model.several.machines ? `commit ${cell.commit.label}` : "",
      model.several.machines ? cell.machine.label : "",
    ]
      .filter(Boolean)
      .join(", ");
    found.set(key, name);
  }
  return found;
}

const sourceOf = (run) => `${run.cell.commit.label}~m${run.cell.machine.index + 1}`;

/** Returns the configurations that two sources share, with their ratios: above 1, B is faster. */
export function pairs(model, state, a, b) {
  const of = new Map();
  for (const run of selected(model, { ...state, commit: [], machine: [] })) {
    if (!(value(model, run, state.measure) > 0)) continue;
    const source = sourceOf(run);
    if (source !== a && source !== b) continue;
    const key = `${run.cell.problem}~${run.contestant.key}`;
    if (!of.has(key)) of.set(key, {});
    of.get(key)[source] = run;
  }
  const both = [];
  let alone = 0;
  for (const one of of.values()) {
    if (one[a] && one[b]) both.push({ a: one[a], b: one[b], ratio: compare(model, one[b], one[a], state.measure) });
    else alone += 1;
  }
  return { both: both.filter((one) => one.ratio), alone };
}

export function versus(context) {
  const { model, state, set } = context;
  const known = sources(model);
  if (known.size < 2)
    return [
      empty(
        "Two commits or machines",
        "These results are of one commit on one machine. `kbvh merge A B --out C` adds results of others.",
      ),
    ];
  const keys = [...known.keys()];
  const a = known.has(state.a) ? state.a : keys[0];
  const b = known.has(state.b) ? state.b : keys.find((key) => key !== a);
  const options = Object.fromEntries(known);
  const chosen = make(
    "div",
    { class: "toolbar" },
    choice("A", options, a, (key) => set({ a: key })),
    choice("B", options, b, (key) => set({ b: key })),
    make("button", { type: "button", text: "Swap", click: () => set({ a: b, b: a }) }),
  );
  const { both, alone } = pairs(model, state, a, b);
  const title = `How many times as fast is B as A? ${sentence(MEASURES[state.measure].name)}`;
  if (!both.length)
    return [
      chosen,
      empty(
        title,
        "The two share no configuration in this selection: same scene by its hash, scalar, l, frames and settings.",
      ),
    ];
  const of = new Map();
  for (const one of both) {
    const { id } = one.b.contestant;
    if (!of.has(id)) of.set(id, []);
    of.get(id).push(one);
  }
  const verdicts = both.map((one) => decided(one.ratio));
  const [faster, slower] = [1, -1].map((side) => verdicts.filter((v) => v === side).length);
  const summary = make(
    "p",
    { class: "lead" },
    make("strong", {
      text: `B is faster in ${faster}, slower in ${slower} of ${plural(both.length, "configuration")}`,
    }),
    `; the other intervals include 1. Geometric mean: ${factor(geometricMean(both.map((one) => one.ratio.middle)))} times as fast.`,
    alone ? ` ${plural(alone, "configuration")} of only one of them ${alone === 1 ? "is" : "are"} left out.` : "",
  );
  return [
    chosen,
    summary,
    strategies(context, title, of, both),
    changes(context, both),
    context.legend([...of.keys()].filter(() => state.per === "best")),
  ];
}

function strategies({ model, state, choose }, title, of, both) {
  const axis = logAxis(
    both.map((one) => one.ratio.middle),
    { include: [1], least: 1.3 },
  );
  const order = [...of]
    .map(([id, list]) => ({ id, list, mean: geometricMean(list.map((one) => one.ratio.middle)) }))
    .sort((x, y) => y.mean - x.mean);
  const best = { ...state, per: "best" };
  const drawn = order.flatMap(({ id, list }) =>
    list.map((one) => {
      const [x, side] = axis.clip(one.ratio.middle);
      return { ...one, id, x, side, y: id, sure: decided(one.ratio), paint: paintOf(one.b.contestant) };
    }),
  );
  const label = new Map(order.map(({ id }) => [id, seriesOfName(model, best, id).label]));
  return figure({
    title,
    reading:
      "Each mark is one configuration; it is filled where the 95 % interval of the ratio excludes 1. To the right of 1, B is faster. The bar is the geometric mean of the strategy.",
    notes: axis.outside ? [`${plural(axis.outside, "point")} beyond the axis: arrows at its edge.`] : [],
    least: 340,
    plot: (width) => {
      const { left, cut } = rowLabels([...label.values()], width);
      return {
        height: 64 + 24 * order.length,
        marginLeft: left,
        marginRight: 24,
        marginTop: 30,
        marginBottom: 38,
        x: logScale(axis, width - left - 30, "B is this many times as fast →", { grid: true, axis: "both" }),
        y: {
          type: "point",
          domain: order.map(({ id }) => id),
          tickFormat: (id) => cut(label.get(id)),
          label: null,
          padding: 0.6,
        },
        marks: [
          Plot.ruleX([1], { stroke: "var(--ink)" }),
          Plot.dot(
            drawn.filter((p) => !p.side),
            {
              x: "x",
              y: "y",
              r: 4,
              stroke: "paint",
              strokeWidth: 1.3,
              fill: (p) => (p.sure ? p.paint : "var(--page)"),
              fillOpacity: 0.75,
            },
          ),
          Plot.dot(order, { x: (one) => axis.clip(one.mean)[0], y: "id", ...meanLook, rowLabels }),
          clippedMarks(drawn, "x"),
        ],
      };
    },
    points: drawn.map((p) => ({
      x: p.x,
      y: p.y,
      run: p.b,
      current: p.b.key === state.point,
      lines: [
        p.b.contestant.label,
        `${p.b.cell.shown}, ${p.b.cell.size}, l = ${p.b.cell.l}`,
        `B is ${ratioText(p.ratio)} times as fast`,
      ],
    })),
    choose,
    table: {
      head: ["strategy", "configurations", "geometric mean", "faster", "slower"],
      rows: order.map(({ id, list, mean }) => [
        label.get(id),
        String(list.length),
        factor(mean),
        String(list.filter((one) => decided(one.ratio) > 0).length),
        String(list.filter((one) => decided(one.ratio) < 0).length),
      ]),
    },
  });
}

/** The largest changes whose intervals exclude 1, one row each. */
function changes({ model, state, choose }, both) {
  const measure = MEASURES[state.measure];
  const sure = both
    .filter((one) => decided(one.ratio))
    .sort((x, y) => Math.abs(Math.log(y.ratio.middle)) - Math.abs(Math.log(x.ratio.middle)))
    .slice(0, 20);
  if (!sure.length)
    return empty("Largest changes", "No interval excludes 1: the two do not differ by more than their noise.");
  const axis = logAxis(
    sure.flatMap((one) => [one.ratio.low, one.ratio.high]),
    { include: [1], least: 1.3 },
  );
  const rows = sure.map((one, i) => ({
    ...one,
    y: String(i),
    x: axis.clip(one.ratio.middle)[0],
    side: axis.clip(one.ratio.middle)[1],
    low: axis.clip(one.ratio.low)[0],
    high: axis.clip(one.ratio.high)[0],
    paint: paintOf(one.b.contestant),
  }));
  const text = (one) => `${one.b.contestant.id}: ${one.b.cell.shown}, ${one.b.cell.size}, l = ${one.b.cell.l}`;
  return figure({
    title: `The ${sure.length === 1 ? "change" : `${sure.length} largest changes`} whose intervals exclude 1`,
    reading: "The line is the 95 % interval of the ratio (bootstrap over the rounds of both) or, with fewer than five repetitions, the range. Disturbed ratios are left out.",
    least: 340,
    plot: (width) => {
      const { left, cut } = rowLabels(rows.map(text), width, 0.5);
      return {
        height: 64 + 22 * rows.length,
        marginLeft: left,
        marginRight: 24,
        marginTop: 30,
        marginBottom: 38,
        x: logScale(axis, width - left - 30, "B is this many times as fast →", { grid: true, axis: "both" }),
        y: {
          type: "point",
          domain: rows.map((row) => row.y),
          tickFormat: (i) => cut(text(rows[i])),
          label: null,
          padding: 0.6,
        },
        marks: [
          Plot.ruleX([1], { stroke: "var(--ink)" }),
          Plot.ruleY(rows, { y: "y", x1: "low", x2: "high", stroke: "paint", strokeWidth: 1.8 }),
          ...rows
            .filter((row) => !row.side)
            .map((row) => Plot.dot([row], { x: "x", y: "y", ...dotLook(row.b.contestant, 4.5) })),
          clippedMarks(rows, "x"),
        ],
      };
    },
    points: rows.map((row) => ({
      x: row.x,
      y: row.y,
      run: row.b,
      current: row.b.key === state.point,
      lines: [
        row.b.contestant.label,
        row.b.cell.title,
        `A ${measure.format(value(model, row.a, state.measure))}, B ${measure.format(value(model, row.b, state.measure))}${measure.unit === "ms" ? " ms" : ""}`,
        `B is ${ratioText(row.ratio)} times as fast`,
      ],
    })),
    choose,
    table: {
      head: ["configuration", "A", "B", "B times as fast (95 %)"],
      rows: rows.map((row) => [
        text(row),
        measure.format(value(model, row.a, state.measure)),
        measure.format(value(model, row.b, state.measure)),
        ratioText(row.ratio),
      ]),
    },
  });
}
