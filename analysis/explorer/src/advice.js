// Which strategy for what: the rule of analysis/advice/advice.py, which words it; a test compares both.
import { bestRefit, compare, value } from "./model.js";
import { geometricMean, quotient } from "./statistics.js";

/** What may be known of the future, and the foresight of strategies that need to know no more. */
export const KNOWN = {
  none: { name: "Nothing: positions only", words: "nothing is known", allowed: ["", "none"] },
  next: {
    name: "The next keyframe",
    words: "the next keyframe is known",
    allowed: ["", "none", "step bound", "next keyframe"],
  },
  clip: {
    name: "The whole clip",
    words: "the whole clip is known",
    allowed: ["", "none", "step bound", "next keyframe", "whole clip"],
  },
};

/** Classes of l, with their first l and the first beyond. */
export const FRAMES = {
  1: { name: "1", words: "a keyframe at every frame", from: 0, to: 2 },
  2: { name: "2 to 9", words: "2 to 9 frames a keyframe", from: 2, to: 10 },
  10: { name: "10 and more", words: "10 frames a keyframe and more", from: 10, to: Infinity },
};

/** Classes of sizes, in primitives. */
export const SIZES = {
  any: { name: "Any size", from: 0, to: Infinity },
  small: { name: "below 10k", from: 0, to: 1e4 },
  medium: { name: "10k to 100k", from: 1e4, to: 1e5 },
  large: { name: "100k and more", from: 1e5, to: Infinity },
};

export const PAIRS = "pairs of two bodies";

/** Questions that every page has, by their names in cells, as users call them. */
export const ASKS = { [PAIRS]: "two bodies", "pairs within a body, too": "one body with itself, too", rays: "rays with bodies" };

export const classOf = (classes, number) =>
  Object.keys(classes).find((key) => key !== "any" && classes[key].from <= number && number < classes[key].to);

/**
 * Returns the cells that count, each with its best refit and, by strategy, its fastest run and its speed over that refit. Of runs of one
 * contestant the newest counts, also if it failed, as in the report; of several measurements of one cell, `countedOnce`.
 */
export function countedCells(model) {
  if (model.counted) return model.counted;
  const asked = ({ cell }) => [cell.problem, cell.machine.index, cell.asks].join("~");
  const newest = new Set(new Map(model.runs.map((run) => [`${asked(run)}~${run.contestant.index}`, run])).values());
  const found = model.cells.flatMap((cell) => {
    const runs = new Map();
    const usual = cell.runs.filter((run) => run.contestant.usual && newest.has(run));
    for (const run of usual) {
      const time = value(model, run, "with_motion");
      const known = runs.get(run.contestant.id);
      if (time !== null && (!known || time < value(model, known, "with_motion"))) runs.set(run.contestant.id, run);
    }
    const refit = bestRefit(model, usual);
    if (!refit || runs.size < 2) return [];
    const speeds = new Map([...runs].map(([id, run]) => [id, quotient(run, refit, model.place, "with_motion")]));
    return [{ cell, refit, runs, speeds }];
  });
  model.counted = countedOnce(found);
  return model.counted;
}

/**
 * Returns every cell once: of a cell that several plans measured, for example in clips of different lengths, the measurement with the most
 * strategies; of equal ones the newest. The rule of `counted` in analysis/advice/advice.py.
 */
export function countedOnce(every) {
  const chosen = new Map();
  const last = ({ runs }) => Math.max(...[...runs.values()].map((run) => run.index));
  for (const one of every) {
    const { cell } = one;
    const identity = [cell.shown, cell.primitives, cell.scalar, cell.l, cell.asks, cell.machine.index].join("~");
    const known = chosen.get(identity);
    const more = known ? one.runs.size - known.runs.size || last(one) - last(known) : 1;
    if (more >= 0) chosen.set(identity, one);
  }
  return [...chosen.values()];
}

/** Ranks the strategies that need to know no more than `known`, the best first: the rule takes the first. */
export function ranked(model, cells, known) {
  const found = [];
  for (const id of [...new Set(model.contestants.map((one) => one.id))].sort()) {
    const contestant = model.contestants.find((one) => one.id === id);
    if (!KNOWN[known].allowed.includes(contestant.foresight)) continue;
    const own = cells.filter((one) => one.speeds.has(id));
    if (!own.length || 2 * own.length < cells.length) continue;
    const speeds = own.map((one) => one.speeds.get(id));
    const low = Math.min(...speeds);
    const speed = geometricMean([...speeds, ...Array(cells.length - own.length).fill(low)]);
    found.push({ id, contestant, speed, low, high: Math.max(...speeds), own, cells: cells.length });
  }
  found.sort((a, b) => b.speed - a.speed); // stable: equal ones by id
  if (cells.length === 1)
    for (const one of found) {
      const ratio = compare(model, cells[0].runs.get(one.id), cells[0].refit, "with_motion");
      if (ratio) Object.assign(one, { low: ratio.low, high: ratio.high, isInterval: ratio.isInterval });
    }
  for (const one of found) {
    one.bestIn = one.own.filter(({ refit, runs }) => runs.get(one.id) === refit).length;
    one.doubtful = one.own
      .filter(({ refit, runs }) => runs.get(one.id).disturbed || refit.disturbed)
      .map(({ cell, refit, runs, speeds }) => ({ cell, speed: speeds.get(one.id), isBest: runs.get(one.id) === refit }));
    one.disturbed = one.doubtful.length > 0;
  }
  return found;
}

/** Returns what the rule takes in every situation, as analysis/advice/advice.py lists them. */
export function situations(model) {
  const cells = countedCells(model);
  const kinds = [...new Set(cells.map(({ cell }) => cell.asks))];
  return kinds.flatMap((asks) =>
    Object.keys(FRAMES).flatMap((frames) => {
      const own = cells.filter(({ cell }) => cell.asks === asks && classOf(FRAMES, cell.l) === frames);
      if (!own.length) return [];
      const advice = Object.keys(KNOWN).map((known) => ranked(model, own, known)[0] ?? null);
      return [{ asks, frames: FRAMES[frames].words, cells: own.length, advice }];
    }),
  );
}

/** Ranks the strategies by cells that come with the project (`kept` of the data), by the same rule. */
export function rankedKept(kept, cells, known) {
  const found = [];
  for (const id of Object.keys(kept.strategies).sort()) {
    const [title, foresight, baseline] = kept.strategies[id];
    const own = cells.filter((cell) => id in cell.speeds);
    if (!KNOWN[known].allowed.includes(foresight) || !own.length || 2 * own.length < cells.length) continue;
    const speeds = own.map((cell) => cell.speeds[id]);
    const low = Math.min(...speeds);
    found.push({
      ...{ id, contestant: { title, baseline }, low, high: Math.max(...speeds), own, cells: cells.length },
      speed: geometricMean([...speeds, ...Array(cells.length - own.length).fill(low)]),
      bestIn: own.filter((cell) => cell.refit === id).length,
      doubtful: own.filter((cell) => cell.doubtful.includes(id)).map((cell) => ({ cell, speed: cell.speeds[id], isBest: cell.refit === id })),
      disturbed: own.some((cell) => cell.doubtful.includes(id)),
    });
  }
  if (cells.length === 1)
    for (const one of found) {
      const [low, high, isInterval] = cells[0].spans[one.id] ?? [];
      if (low < high) Object.assign(one, { low, high, isInterval });
    }
  return found.sort((a, b) => b.speed - a.speed);
}

/** Whether a cell (of the results or kept) has a size and an l of these classes; "" passes all. */
export const matches = (cell, size, frames) =>
  (!size || size === "any" || classOf(SIZES, cell.primitives) === size) && (!frames || classOf(FRAMES, cell.l) === frames);

/** Returns the cells of the classes that are nearest to those asked for, l before the size: {size, frames, cells}; null without cells. */
export function nearest(every, size, frames) {
  const [sizes, classes] = [Object.keys(SIZES).filter((key) => key !== "any"), Object.keys(FRAMES)];
  const away = (list, one, other) => (one === "any" ? 0 : Math.abs(list.indexOf(one) - list.indexOf(other)));
  let best = null;
  for (const own of classes)
    for (const of of size === "any" ? ["any"] : sizes) {
      const cells = every.filter(({ cell }) => matches(cell, of, own));
      const distance = 10 * away(classes, frames, own) + away(sizes, size, of);
      if (cells.length && (!best || distance < best.distance)) best = { size: of, frames: own, cells, distance };
    }
  return best;
}
