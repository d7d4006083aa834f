// Three questions, and what the results answer: a name, an interval and a curve.
import { FRAMES, KNOWN, PAIRS, SIZES, classOf, countedCells, ranked } from "../advice.js";
import { tableOf } from "../chart.js";
import { choice, make, symbol } from "../dom.js";
import { SIX, compare, ratioText, value } from "../model.js";
import { span } from "../statistics.js";
import { factor, milliseconds, plural } from "../words.js";
import { sweepFigure, sweeps } from "./scaling.js";

/** Returns the answers to the questions: those of the state, or else the first that have cells. */
export function asked(model, state) {
  const every = countedCells(model);
  const kinds = [...new Set(every.map(({ cell }) => cell.asks))].sort((a, b) => (b === PAIRS) - (a === PAIRS));
  const asks = kinds.includes(state.asks) ? state.asks : kinds[0];
  const scenes = [...new Set(every.filter(({ cell }) => cell.asks === asks).map(({ cell }) => cell.scene))];
  const scene = scenes.includes(state.of) ? state.of : "";
  const sized = every.filter(({ cell }) => cell.asks === asks && (!scene || cell.scene === scene));
  const sizes = new Set(sized.map(({ cell }) => classOf(SIZES, cell.primitives)));
  const size = sizes.has(state.large) ? state.large : "any";
  const matching = sized.filter(({ cell }) => size === "any" || classOf(SIZES, cell.primitives) === size);
  const counts = Object.fromEntries(
    Object.keys(FRAMES).map((key) => [key, matching.filter(({ cell }) => classOf(FRAMES, cell.l) === key).length]),
  );
  // Positions that arrive frame by frame are keyframes; motion that is known has frames between its keyframes.
  const classes = Object.keys(FRAMES).filter((key) => counts[key]);
  const frames = counts[state.frames] ? state.frames : state.know === "none" ? classes[0] : classes.at(-1);
  return {
    ...{ kinds, asks, scenes, scene, sizes, size, counts, frames, matching },
    cells: matching.filter(({ cell }) => classOf(FRAMES, cell.l) === frames),
  };
}

export function answer(context) {
  const { model, state } = context;
  const found = asked(model, state);
  if (!found.cells.length)
    return [make("p", { class: "lead", text: "These results have no scene with a refit and another strategy: nothing can be compared." })];
  const order = ranked(model, found.cells, state.know);
  return [
    make("div", { class: "ask" }, questions(context, found), said(context, found, order)),
    curve(context, found, order),
    cost(context, found, order[0]),
  ].filter(Boolean);
}

/** A question with a few answers: buttons, of which one is pressed. */
function buttons(question, options, chosen, change, absent = () => false) {
  return make(
    "fieldset",
    { class: "question-of" },
    make("legend", { text: question }),
    make(
      "div",
      { class: "segments" },
      Object.entries(options).map(([key, name]) =>
        make("button", {
          type: "button",
          text: name,
          "aria-pressed": String(key === chosen),
          disabled: absent(key),
          title: absent(key) ? "not measured in these results" : null,
          click: () => change(key),
        }),
      ),
    ),
  );
}

const names = (classes) => Object.fromEntries(Object.entries(classes).map(([key, one]) => [key, one.name]));

/** Questions that users have, by their names as `found.kinds` has them. */
const COMMON = ["pairs within a body, too", "rays"];

function questions({ model, state, set }, found) {
  const absent = COMMON.filter((kind) => !found.kinds.includes(kind));
  const kinds = Object.fromEntries(found.kinds.map((kind) => [kind, kind]));
  const scenes = { "": "any scene", ...Object.fromEntries(found.scenes.map((scene) => [scene, scene])) };
  return make(
    "section",
    { class: "questions", "aria-label": "Questions" },
    buttons("1. What do you know of the future?", names(KNOWN), state.know, (know) => set({ know })),
    buttons("2. Frames a keyframe? (Positions only: 1)", names(FRAMES), found.frames, (frames) => set({ frames }), (key) => !found.counts[key]),
    make(
      "div",
      {},
      buttons("3. How large, and whole or with itself?", names(SIZES), found.size, (large) => set({ large }), (key) => key !== "any" && !found.sizes.has(key)),
      make(
        "div",
        { class: "toolbar" },
        choice("asked for", kinds, found.asks, (asks) => set({ asks })),
        choice("scene", scenes, found.scene, (of) => set({ of })),
      ),
      absent.length > 0 && make("p", { class: "note" }, `Not measured in these results: ${absent.join(", ")}.`, model.data.report && [" ", make("a", { href: model.data.report, text: "The report" }), " says what is known of them."]),
    ),
  );
}

/** Tells the speed of a strategy, as analysis/advice/advice.py does. */
export function speedText(one) {
  const missing = one.own.length < one.cells ? `, measured in ${one.own.length}` : "";
  const disturbed = one.disturbed ? " (the machine was disturbed)" : "";
  if (one.contestant.baseline && !one.bestIn) {
    const span = one.low < one.high ? `${factor(one.low)} to ${factor(one.high)}` : factor(one.low);
    return `a refit, ${span} times as fast as the best one of the ${one.cells === 1 ? "cell" : "cells"}${missing}${disturbed}`;
  }
  if (one.contestant.baseline) {
    const where = one.cells === 1 ? "in the only cell" : `in ${one.bestIn} of ${plural(one.cells, "cell")}`;
    const behind = factor(one.low) === "1.00" ? "less than 1\u00a0% slower" : `at worst ${factor(one.low)} times as fast`;
    return `the best refit ${where}${one.bestIn < one.cells ? `; elsewhere ${behind}` : ""}${missing}${disturbed}`;
  }
  const span = one.low < one.high ? `${factor(one.low)} to ${factor(one.high)}` : "";
  const kind = one.isInterval ? "95\u00a0% interval" : "range of its rounds";
  const of = span && one.cells === 1 ? `${kind} ${span}` : `${span} in ${plural(one.cells, "cell")}`.trim();
  return `${factor(one.speed)} times as fast as the best refit (${of}${missing}${one.disturbed ? "; the machine was disturbed" : ""})`;
}

/** What a guarantee promises of the answers. */
const PROMISES = { exact: "its answers are exact", candidate_superset: "it misses nothing, and may report some pairs too many" };

/** Tells what a strategy costs: in one cell with the ends of its time, in several from the cheapest to the most expensive one. */
export function costText(model, one) {
  const runs = one.own.map(({ runs }) => runs.get(one.id));
  if (one.cells === 1) {
    const { middle, low, high, isInterval } = span(runs[0], model.place, "with_motion");
    const [at, from, to] = [middle, low, high].map(milliseconds);
    return from === to ? `${at} ms a frame` : `${at} ms a frame (${isInterval ? "95\u00a0% interval" : "range of its rounds"} ${from} to ${to})`;
  }
  const times = runs.map((run) => value(model, run, "with_motion"));
  const [low, high] = [Math.min(...times), Math.max(...times)].map(milliseconds);
  return `${low === high ? low : `${low} to ${high}`} ms a frame`;
}

function said({ model, state, set }, found, order) {
  const best = order[0];
  if (!best) return make("section", { class: "answer" }, make("p", { text: "No strategy was measured in half of these cells." }));
  const more = Object.keys(KNOWN)
    .slice(Object.keys(KNOWN).indexOf(state.know) + 1)
    .map((known) => [known, ranked(model, found.cells, known)[0]])
    .find(([, one]) => one.id !== best.id);
  const scenes = new Set(found.cells.map(({ cell }) => cell.scene));
  const { cell } = found.cells[0];
  const of =
    best.cells === 1
      ? cell.title.replace(`${cell.scene}, ${cell.size}`, () => `${cell.scene} with ${cell.size} primitives`)
      : `${plural(best.cells, "cell")} of ${scenes.size === 1 ? cell.scene : plural(scenes.size, "scene")}`;
  return make(
    "section",
    { class: "answer", "aria-live": "polite" },
    make("p", { class: "take" }, "Take ", symbol(best.contestant), make("strong", { text: best.contestant.title }), `: ${costText(model, best)}.`),
    make("p", { class: "speed", text: `That is ${speedText(best)}.` }),
    make(
      "p",
      {},
      `Measured on one thread in ${of}, positions included; ${PROMISES[best.contestant.guarantee]}. It is called `,
      make("code", { text: best.id }),
      " on the command line and in code.",
    ),
    order[1] && make("p", { class: "note", text: `Next: ${order[1].contestant.title}, ${costText(model, order[1])}; ${speedText(order[1])}.` }),
    more &&
      make(
        "p",
        { class: "note" },
        make("button", { type: "button", class: "quiet", text: `If ${KNOWN[more[0]].words}`, click: () => set({ know: more[0] }) }),
        ` take ${more[1].contestant.title}: ${costText(model, more[1])}; ${speedText(more[1])}.`,
      ),
  );
}

/** The time of the six best and of the best refit over l or n, on the scene with the longest sweep. */
function curve(context, found, order) {
  const { model, state } = context;
  const chosen = order.slice(0, SIX).map((one) => one.id);
  const allowed = new Set(order.map((one) => one.id));
  const cells = new Map(
    found.matching.map(({ cell, runs }) => [cell, new Map([...runs].filter(([id]) => allowed.has(id)))]),
  );
  const cellsOfL = new Map([...cells].filter(([cell]) => classOf(FRAMES, cell.l) === found.frames));
  const sweep = sweeps(cells, "l", ["primitives"])[0];
  const other = sweeps(cellsOfL, "primitives", ["l"])[0];
  const [shown, field] = sweep ? [sweep, "l"] : [other, "primitives"];
  const own = { ...context, state: { ...state, measure: "with_motion", per: "best" } };
  const entries = order.slice(0, SIX).map((one) => [one.contestant, one.contestant.title, speedText(one)]);
  const legend = context.legendList(entries);
  const rest = order.length - chosen.length;
  const more = rest > 0 && context.othersButton(rest);
  if (!shown) return make("section", {}, make("h2", { text: "The best six" }), legend);
  return make(
    "section",
    { class: "beside-legend" },
    make("div", {}, sweepFigure(own, shown, field, new Set(chosen))),
    make("div", {}, legend, more),
  );
}

/** What it costs in every cell of the situation. */
function cost({ model, choose }, found, best) {
  if (!best) return null;
  const rows = found.cells
    .toSorted((a, b) => a.cell.place - b.cell.place)
    .map(({ cell, refit, runs }) => {
      const run = runs.get(best.id);
      const time = (one) => milliseconds(value(model, one, "with_motion"));
      if (!run) return [cell.title, "–", refit.contestant.title, time(refit), "–"];
      const link = make("button", { type: "button", class: "name", text: time(run), title: "where it comes from" });
      link.addEventListener("click", () => choose(run, link));
      return [
        cell.title,
        link,
        refit.contestant.title,
        time(refit),
        run === refit ? "the best refit" : ratioText(compare(model, run, refit, "with_motion")),
      ];
    });
  return make(
    "section",
    {},
    make("h2", { text: "What it costs, scene by scene" }),
    make("p", { class: "note", text: "Each line is a cell: one scene at one size, with l frames from a keyframe to the next." }),
    make("div", { class: "scroll", tabindex: 0 }, tableOf(["scene", `${best.contestant.title}, ms`, "best refit", "ms", "times as fast"], rows)),
  );
}
