// The results as objects, and the choices of the page applied to them.
import { SCOPES, ratio, span, timeOf } from "./statistics.js";
import { factor, milliseconds, bytes, count, sceneWords } from "./words.js";

/** What can be measured: times with repetitions, times of single frames, and numbers without a clock. */
export const MEASURES = {
  with_motion: { name: "total time, with motion", unit: "ms", format: milliseconds },
  without_motion: { name: "total time, without motion", unit: "ms", format: milliseconds },
  update: { name: "update", unit: "ms", format: milliseconds },
  query: { name: "query", unit: "ms", format: milliseconds },
  p99: { name: "99th percentile of frames", unit: "ms", format: milliseconds, column: "p99" },
  worst: { name: "worst frame", unit: "ms", format: milliseconds, column: "worst" },
  memory: { name: "memory", unit: "bytes", format: bytes, column: "bytes" },
  certificates_failed: { name: "events per frame", unit: "", format: count, column: "certificates_failed" },
  values_written: { name: "values written per frame", unit: "", format: count, column: "values_written" },
  nodes_visited: { name: "nodes visited per frame", unit: "", format: count, column: "nodes_visited" },
  box_tests: { name: "box tests per frame", unit: "", format: count, column: "box_tests" },
  triangle_tests: { name: "triangle tests per frame", unit: "", format: count, column: "triangle_tests" },
};

/** Lines of a figure before the others, which are drawn pale on demand. */
export const SIX = 6;

/** Turns the data of the page into cells, contestants and runs that refer to each other. */
export function model(data) {
  const machines = data.machines.map((machine, index) => ({ ...machine, index }));
  const commits = data.commits.map((one, index) => ({
    ...one,
    index,
    label: (one.commit || "unknown").slice(0, 10) + (one.dirty ? "*" : ""),
  }));
  const contestants = data.contestants.map((one, index) => ({ ...one, index, key: tag(one) }));
  const cells = data.cells.map((one, index) => {
    const cell = { ...one, index, machine: machines[one.machine], commit: commits[one.commit], runs: [] };
    cell.shown = sceneWords(cell.scene);
    cell.key = [cell.name, cell.hash.slice(0, 6), cell.scalar, cell.l];
    if (machines.length > 1) cell.key.push(`m${cell.machine.index + 1}`);
    if (commits.length > 1) cell.key.push(cell.commit.label);
    cell.key = cell.key.join("~");
    cell.problem = [cell.name, cell.hash, cell.primitives, cell.scalar, cell.l, cell.frames].join("~");
    return cell;
  });
  const columns = data.runs;
  const names = Object.keys(columns).filter((name) => !["cell", "contestant"].includes(name));
  const place = Object.fromEntries(data.phases.map((phase, i) => [phase, i]));
  const runs = columns.cell.map((cell, index) => {
    const run = { index, cell: cells[cell], contestant: contestants[columns.contestant[index]], medians: {} };
    for (const name of names) run[name] = columns[name][index];
    if (typeof run.draws === "function") makeOnce(run, "draws", run.draws);
    run.plan = data.plans[run.plan];
    run.key = `${run.cell.key}~${run.contestant.key}`;
    cells[cell].runs.push(run);
    return run;
  });
  const several = {
    machines: machines.length > 1,
    commits: commits.length > 1,
    scalars: new Set(cells.map((c) => c.scalar)).size > 1,
  };
  for (const cell of cells) cell.title = title(cell, several);
  const scenes = [...new Set(cells.map((cell) => cell.scene))];
  const order = [...cells].sort(
    (a, b) =>
      scenes.indexOf(a.scene) - scenes.indexOf(b.scene) ||
      a.primitives - b.primitives ||
      (a.scalar < b.scalar ? 1 : a.scalar > b.scalar ? -1 : 0) ||
      a.l - b.l ||
      a.commit.index - b.commit.index ||
      a.machine.index - b.machine.index,
  );
  order.forEach((cell, place) => (cell.place = place));
  return { data, machines, commits, contestants, cells, runs, place, several };
}

/** Makes a property that is computed when it is first read. */
function makeOnce(object, name, make) {
  Object.defineProperty(object, name, {
    configurable: true,
    get: () => {
      const value = make();
      Object.defineProperty(object, name, { value });
      return value;
    },
  });
}

/** Names a contestant in links: its id and non-default settings, and its tree. */
function tag({ tag: label, builder }) {
  return builder ? `${label}/${builder.method}${builder.width}-${builder.leaf_size}` : label;
}

function title(cell, several) {
  const parts = [cell.shown, cell.size];
  if (several.scalars) parts.push(cell.scalar);
  parts.push(`l = ${cell.l}`);
  if (several.commits) parts.push(cell.commit.label);
  if (several.machines) parts.push(cell.machine.label);
  return parts.join(", ");
}

/**
 * Returns the ends of a run's `value`: {low, high, isInterval}, by the same estimator, so that they enclose it; both are the value itself
 * for measures without repetitions.
 */
export function endsOf(model, run, measure) {
  if (measure in SCOPES && run.times.length) return span(run, model.place, measure);
  const own = value(model, run, measure);
  return { low: own, high: own, isInterval: false };
}

/** Returns a run's value of a measure: by medians over repetitions where there are any; null if unknown. */
export function value(model, run, measure) {
  const { column } = MEASURES[measure];
  if (column) return run.refused ? null : run[column];
  return (run.medians[measure] ??= run.times.length ? timeOf(run, model.place, measure) : null);
}

/** Returns how many times better a run is than another in a measure; equal ends where there are no repetitions. */
export function compare(model, run, reference, measure) {
  if (!reference) return null;
  if (measure in SCOPES)
    return ratio(run, reference, model.place, measure);
  const own = value(model, run, measure);
  const other = value(model, reference, measure);
  if (!(own > 0) || other === null) return null;
  const middle = other / own;
  return { middle, low: middle, high: middle, paired: true, isInterval: false, disturbed: false };
}

/** Returns the values that a facet has, of a run. */
export const facetOf = {
  plan: (run) => run.plan.name || "unnamed",
  scene: (run) => run.cell.scene,
  size: (run) => String(run.cell.primitives),
  l: (run) => String(run.cell.l),
  scalar: (run) => run.cell.scalar,
  machine: (run) => run.cell.machine.label,
  commit: (run) => run.cell.commit.label,
  strategy: (run) => run.contestant.id,
};

/** Returns the runs that the filters of a state let pass. */
export function selected(model, state, except = "") {
  const active = Object.keys(facetOf)
    .filter((name) => name !== except && state[name].length)
    .map((name) => [facetOf[name], new Set(state[name])]);
  return model.runs.filter(
    (run) =>
      (state.contestants === "all" || run.contestant.usual) && active.every(([of, wanted]) => wanted.has(of(run))),
  );
}

/**
 * Returns the cells of the selected runs, each with its entrants: a map from series to run. A series is a strategy with its
 * fastest setting, or one setting.
 */
export function entrants(model, state, measure = state.measure) {
  const found = new Map();
  for (const run of selected(model, state)) {
    const own = value(model, run, measure);
    if (!(own > 0)) continue;
    if (!found.has(run.cell)) found.set(run.cell, new Map());
    const series = found.get(run.cell);
    const name = seriesOf(run, state);
    const known = series.get(name);
    if (!known || own < value(model, known, measure)) series.set(name, run);
  }
  return new Map([...found].sort((a, b) => a[0].place - b[0].place));
}

export function seriesOf(run, state) {
  return state.per === "each" ? run.contestant.key : run.contestant.id;
}

/** Returns what a series is called and looks like: {name, label, contestant}. */
export function seriesOfName(model, state, name) {
  const mine = model.contestants.filter((one) => (state.per === "each" ? one.key : one.id) === name);
  const first = mine[0];
  return { name, contestant: first, label: state.per === "each" ? first.label : first.title };
}

/** Returns the time of a run's whole clip, by which the best refit is chosen: `clip_total` of analysis/ratios/ratios.py. */
export function clipTotal(model, run) {
  return value(model, run, "with_motion");
}

/** Returns the best refit among runs, the verified baseline with the smallest `clipTotal`: one for every measure; or null. */
export function bestRefit(model, runs) {
  return runs
    .filter((one) => one.contestant.baseline && one.contestant.guarantee !== "approximate" && clipTotal(model, one) !== null)
    .reduce((best, one) => (best && clipTotal(model, best) <= clipTotal(model, one) ? best : one), null);
}

/** Returns the run that others of a cell are compared with: by `against` of the state. */
export function reference(model, state, cell, run, measure = state.measure) {
  const against = state.against;
  const timed = cell.runs.filter((one) => value(model, one, measure) > 0);
  const fastest = (list) =>
    list.reduce((best, one) => (best && value(model, best, measure) <= value(model, one, measure) ? best : one), null);
  if (against === "baseline") return bestRefit(model, cell.runs);
  if (against === "fastest") return fastest(timed.filter((one) => one.contestant.usual));
  if (against === "tree") {
    const tree = JSON.stringify(run?.contestant.builder ?? null);
    const same = cell.runs.filter((one) => JSON.stringify(one.contestant.builder) === tree);
    return tree === "null" ? null : bestRefit(model, same);
  }
  return fastest(timed.filter((one) => one.contestant.id === against || one.contestant.key === against));
}

/** Says what a state compares with. */
export function referenceName(model, state) {
  const fixed = {
    baseline: "the best refit",
    fastest: "the fastest of the cell",
    tree: "the best refit of the same tree",
  };
  if (fixed[state.against]) return fixed[state.against];
  const known = model.contestants.find((one) => one.id === state.against || one.key === state.against);
  return known ? (known.id === state.against ? known.title : known.label) : state.against;
}

/** Formats a ratio: with its (interval) or its [range over fewer than five repetitions], and ? where the machine was disturbed. */
export function ratioText(found) {
  if (!found) return "–";
  const ends = `${factor(found.low)}–${factor(found.high)}`;
  const within = found.low === found.high ? "" : found.isInterval ? ` (${ends})` : ` [${ends}]`;
  return (found.paired ? "" : "~ ") + factor(found.middle) + (found.disturbed ? "?" : "") + within;
}

/** Returns 1 if a ratio's interval or range lies above 1, -1 if below, 0 if it has 1, is disturbed, or is of one repetition. */
export function decided(found) {
  if (!found || found.low === found.high || found.disturbed) return 0;
  return found.low > 1 ? 1 : found.high < 1 ? -1 : 0;
}
