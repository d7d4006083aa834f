// How often each strategy is within a factor of the best, and every cell in one picture.
import * as Plot from "@observablehq/plot";
import { dotLook, figure, lineLook, logScale } from "../chart.js";
import { make, symbol } from "../dom.js";
import {
  MEASURES,
  SIX,
  compare,
  decided,
  entrants,
  ratioText,
  reference,
  referenceName,
  seriesOfName,
  value,
} from "../model.js";
import { geometricMean, median, profiles, quantile, within } from "../statistics.js";
import { factor, percent, plural, sentence } from "../words.js";

const SHARES = [1, 1.25, 2];

export function overview(context) {
  const cells = entrants(context.model, context.state);
  const found = profiled(context, cells);
  return [
    make("div", { class: "beside" }, [profileFigure(context, found), ranking(context, found)].filter(Boolean)),
    matrix(context, cells),
  ];
}

/** Returns the profiles with their series. */
export function profiled({ model, state }, cells = entrants(model, state)) {
  const listed = [...cells.values()];
  const values = listed.map(
    (series) => new Map([...series].map(([name, run]) => [name, value(model, run, state.measure)])),
  );
  return profiles(values, state.cells).map((profile) => ({
    ...profile,
    series: seriesOfName(model, state, profile.name),
    runs: profile.at.map((at) => listed[at].get(profile.name)),
  }));
}

const BASIS = {
  own: "Each line counts the cells in which its strategy was measured.",
  all: "A cell without a measurement of a strategy counts as never within a factor.",
  common: "Only cells in which all of them were measured count.",
};

function profileFigure({ model, state, choose }, found) {
  const measure = MEASURES[state.measure];
  const title = `How often is each strategy within a factor of the best? ${sentence(measure.name)}`;
  if (!found.length)
    return empty(
      title,
      state.cells === "common"
        ? "No cell has all of the selected contestants."
        : "No cell of this selection has two contestants with a time.",
    );
  const cells = found[0].cells;
  const kept = state.lines === "all" ? found : found.slice(0, SIX);
  const all = kept.flatMap((one) => one.factors).sort((a, b) => a - b);
  const top = [2, 3, 5, 10, 20, 50, 100].find((t) => t >= quantile(all, 0.85)) ?? 100;
  const points = [];
  const lines = kept.map((one, index) => {
    const share = (x) => 100 * within(one, x);
    const steps = [{ x: 1, y: share(1) }];
    for (const f of one.factors) if (f > 1 && f <= top) steps.push({ x: f, y: share(f) });
    steps.push({ x: top, y: steps.at(-1).y });
    // Each step is a cell. A few on each line have markers, at other places than its neighbours'.
    one.factors.forEach((x, i) => {
      if (x <= top)
        points.push({
          x,
          y: share(x),
          run: one.runs[i],
          current: one.runs[i].key === state.point,
          lines: [
            one.series.label,
            `within ${factor(x)} times the best in ${percent(within(one, x))} of ${one.of} cells`,
            `this step: ${one.runs[i].cell.title}`,
          ],
        });
    });
    const marks = [0, 1, 2]
      .map((k) => top ** ((k + ((index * 7) % kept.length) / kept.length) / 3))
      .map((x) => ({ x, y: share(x) }))
      .filter((mark) => mark.y > 0);
    return { one, steps, marks, strong: index < SIX };
  });
  return figure({
    title,
    reading:
      `Where a line is at 60 % above 1.25, the strategy takes at most 1.25 times as long as the fastest one in 60 % of the cells. A line that begins high is often the fastest; a line that has risen far left is seldom much slower. ` +
      `${plural(cells, "cell")}: scenes at their sizes, l and scalars${model.several.machines || model.several.commits ? ", by machine and commit" : ""}. ${BASIS[state.cells]}`,
    plot: (width) => ({
      height: Math.max(300, Math.min(440, width * 0.75)),
      marginLeft: 52,
      marginRight: 20,
      marginBottom: 42,
      insetTop: 6,
      x: logScale({ domain: [1, top] }, width - 80, "within this factor of the best →", { tickFormat: (v) => `${v}×` }),
      y: { domain: [0, 100], label: "↑ share of cells, %", grid: true, ticks: 5 },
      marks: [
        Plot.ruleY([0], { stroke: "var(--soft)" }),
        ...lines.toReversed().flatMap(({ one, steps, marks, strong }) => [
          Plot.line(steps, {
            x: "x",
            y: "y",
            curve: "step-after",
            ...lineLook(one.series.contestant, strong ? 2 : 1.1),
            strokeOpacity: strong ? 1 : 0.35,
          }),
          Plot.dot(strong ? marks : [], { x: "x", y: "y", ...dotLook(one.series.contestant, 4.5) }),
        ]),
      ],
    }),
    points,
    choose,
    table: {
      head: ["strategy", ...SHARES.map((s) => (s === 1 ? "best in" : `within ${s}×`)), "median factor", "cells"],
      rows: found.map((one) => row(one)),
    },
  });
}

function row(one) {
  return [
    one.series.label,
    ...SHARES.map((share) => percent(within(one, share))),
    factor(median(one.factors)),
    `${one.factors.length} of ${one.cells}`,
  ];
}

/** The legend of the profile, in order: the strategies, and what their lines say in numbers. */
function ranking({ state, set, othersButton }, found) {
  if (!found.length) return null;
  const bar = (share) => make("td", { class: "n bar", style: `--share:${share}`, text: percent(share) });
  const line = (one) =>
    make(
      "tr",
      { class: one.factors.length * 2 < one.cells && state.cells === "own" ? "few" : null },
      make(
        "th",
        { scope: "row" },
        make(
          "button",
          {
            type: "button",
            class: "name",
            title: "compare the others with this one",
            click: () => set({ against: one.name }),
          },
          symbol(one.series.contestant),
          make("span", { text: one.series.label }),
        ),
      ),
      SHARES.map((share) => bar(within(one, share))),
      make("td", { class: "n", text: factor(median(one.factors)) }),
      make("td", { class: "n", text: `${one.factors.length}` }),
    );
  const body = make("tbody", {}, (state.lines === "all" ? found : found.slice(0, SIX)).map(line));
  const more = found.length > SIX && othersButton(found.length - SIX);
  return make(
    "section",
    { class: "ranking" },
    make(
      "div",
      { class: "scroll", tabindex: 0 },
      make(
        "table",
        {},
        make("caption", {
          text: "Ordered by the mean share of the best's speed. Pale: measured in fewer than half of the cells.",
        }),
        make(
          "thead",
          {},
          make(
            "tr",
            {},
            ["strategy", "best in", "within 1.25×", "within 2×", "median factor", "cells"].map((text, i) =>
              make("th", { scope: "col", class: i ? "n" : null, text }),
            ),
          ),
        ),
        body,
      ),
    ),
    more,
  );
}

/** Every cell and strategy as a coloured number. */
function matrix({ model, state, set, choose }, cells) {
  const columns = new Map();
  const rows = [...cells].map(([cell, series]) => {
    const found = new Map();
    for (const [name, run] of series) {
      const ratio = compare(model, run, reference(model, state, cell, run), state.measure);
      if (!ratio) continue;
      found.set(name, { run, ratio });
      if (!columns.has(name)) columns.set(name, []);
      columns.get(name).push(ratio.middle);
    }
    return { cell, found };
  });
  const against = referenceName(model, state);
  const title = `Every cell: how many times as fast as ${against}`;
  const names = [...columns].sort((a, b) => median(b[1]) - median(a[1])).map(([name]) => name);
  if (!names.length) return empty(title, `${against} has no time in this selection; choose another to compare with.`);
  const head = make(
    "tr",
    {},
    make("th", { scope: "col", class: "corner", text: "scene" }),
    names.map((name) => {
      const { label, contestant } = seriesOfName(model, state, name);
      return make(
        "th",
        { scope: "col", class: "tall" },
        make(
          "button",
          {
            type: "button",
            class: "name",
            title: `compare the others with ${label}`,
            click: () => set({ against: name }),
          },
          symbol(contestant),
          make("span", { text: label }),
        ),
      );
    }),
  );
  let last = "";
  const body = rows.map(({ cell, found }) => {
    const first = cell.scene !== last;
    last = cell.scene;
    return make(
      "tr",
      { class: first ? "first" : null },
      make(
        "th",
        { scope: "row", title: cell.title },
        make("span", { class: "scene", text: cell.shown }),
        make("span", { class: "rest", text: cell.title.slice(cell.shown.length + 2) }),
      ),
      names.map((name) => {
        const one = found.get(name);
        if (!one) return make("td", { class: "none", "aria-label": "not measured", text: "·" });
        const strength = Math.max(-1, Math.min(1, Math.log2(one.ratio.middle) / 3));
        const said = `${seriesOfName(model, state, name).label}, ${cell.title}: ${ratioText(one.ratio)}`;
        return make("td", {
          tabindex: -1,
          "data-run": one.run.index,
          title: said,
          "aria-label": said,
          class: `${decided(one.ratio) ? "sure" : ""} ${one.run.key === state.point ? "chosen" : ""}`,
          style: `--strength:${Math.round(Math.abs(strength) * 62)}%;--tone:var(--${strength > 0 ? "faster" : "slower"})`,
          text: factor(one.ratio.middle),
        });
      }),
    );
  });
  const summary = make(
    "tr",
    { class: "summary" },
    make("th", { scope: "row", text: "geometric mean" }),
    names.map((name) => make("td", { text: factor(geometricMean(columns.get(name))) })),
  );
  const grid = make(
    "table",
    { class: "matrix", role: "grid", "aria-label": title },
    make("thead", {}, head),
    make("tbody", {}, body),
    make("tfoot", {}, summary),
  );
  walk(grid, (index) => choose(model.runs[index], grid));
  return make(
    "figure",
    {},
    make(
      "figcaption",
      {},
      make("h3", { text: title }),
      make(
        "p",
        { class: "reading" },
        make("span", { class: "swatch faster", text: "blue" }),
        " is faster, ",
        make("span", { class: "swatch slower", text: "orange" }),
        " slower; bold where the 95 % interval excludes 1. Choose a number to see its measurement, or a name to compare the others with it. Each geometric mean is over the cells in which the strategy was measured.",
      ),
    ),
    make("div", { class: "scroll matrix-scroll", tabindex: 0 }, grid),
  );
}

/** Lets the pointer and the arrow keys choose cells of a grid. */
function walk(grid, choose) {
  const cells = () => [...grid.querySelectorAll("td[data-run]")];
  const first = cells()[0];
  if (first) first.tabIndex = 0;
  grid.addEventListener("click", (event) => {
    const cell = event.target.closest("td[data-run]");
    if (cell) choose(Number(cell.dataset.run));
  });
  grid.addEventListener("keydown", (event) => {
    const cell = event.target.closest("td[data-run]");
    if (!cell) return;
    if (event.key === "Enter") return choose(Number(cell.dataset.run));
    const step = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowDown: [0, 1], ArrowUp: [0, -1] }[event.key];
    if (!step) return;
    event.preventDefault();
    const table = [...grid.tBodies[0].rows];
    let [x, y] = [cell.cellIndex, table.indexOf(cell.parentElement)];
    do {
      x += step[0];
      y += step[1];
    } while (table[y]?.cells[x] && !table[y].cells[x].dataset.run);
    const next = table[y]?.cells[x];
    if (!next?.dataset.run) return;
    cell.tabIndex = -1;
    next.tabIndex = 0;
    next.focus();
  });
}

export function empty(title, why) {
  return make(
    "figure",
    { class: "empty" },
    make("figcaption", {}, make("h3", { text: title })),
    make("p", { class: "note", text: why }),
  );
}
