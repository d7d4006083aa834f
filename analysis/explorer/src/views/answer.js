// Four questions, and what the results answer: a name, an interval and a curve.
import { ASKS, FRAMES, KNOWN, PAIRS, SIZES, classOf, countedCells, matches, nearest, ranked } from "../advice.js";
import { tableOf } from "../chart.js";
import { choice, make, symbol } from "../dom.js";
import { leading } from "../looks.js";
import { SIX, compare, decided, ratioText, value } from "../model.js";
import { span } from "../statistics.js";
import { factor, milliseconds, plural, sceneWords, sentence } from "../words.js";
import { errs } from "./errors.js";
import { sweepFigure, sweeps } from "./scaling.js";
import { keptCosts, unmeasured } from "./unmeasured.js";

/**
 * Returns what is asked: the choices of the state, or else the first that the results answer. A choice that was not measured stays the
 * choice: `cells` is empty then, `kept` has the cells that come with the project, and `near` the nearest ones of these results.
 */
export function asked(model, state) {
  const every = countedCells(model);
  const here = new Set(every.map(({ cell }) => cell.asks));
  const kinds = [...new Set([...Object.keys(ASKS), ...here])];
  const asks = kinds.includes(state.asks) ? state.asks : here.has(PAIRS) || !here.size ? PAIRS : [...here][0];
  const scenes = [...new Set(every.filter(({ cell }) => cell.asks === asks).map(({ cell }) => cell.scene))];
  const scene = scenes.includes(state.of) ? state.of : "";
  const own = every.filter(({ cell }) => cell.asks === asks && (!scene || cell.scene === scene));
  const known = (model.data.kept?.cells ?? []).filter((cell) => cell.asks === asks);
  const size = state.large in SIZES ? state.large : "any";
  const matching = own.filter(({ cell }) => matches(cell, size));
  // Positions that arrive frame by frame are keyframes; motion that is known has frames between its keyframes.
  const usual = Object.keys(FRAMES).filter((key) => matching.some(({ cell }) => matches(cell, "", key)));
  const frames = state.frames in FRAMES ? state.frames : state.know === "none" ? "1" : (usual.at(-1) ?? "10");
  const cells = matching.filter(({ cell }) => matches(cell, "", frames));
  const kept = cells.length || scene ? [] : known.filter((cell) => matches(cell, size, frames));
  const near = cells.length ? null : nearest(own, size, frames);
  return { every, here, kinds, asks, scenes, scene, own, known, size, matching, frames, cells, kept, near };
}

export function answer(context) {
  const { model, state } = context;
  const found = asked(model, state);
  if (!found.every.length && !model.data.kept)
    return [make("p", { class: "lead", text: "These results have no scene with a refit and another strategy: nothing can be compared." })];
  const ask = (card) => make("div", { class: "ask" }, questions(context, found), make("div", {}, card, onward(context)));
  if (found.cells.length) {
    const order = ranked(model, found.cells, state.know);
    return [ask(said(context, found, order)), curve(context, found, order), cost(context, found, order[0])].filter(Boolean);
  }
  const order = found.near ? ranked(model, found.near.cells, state.know) : [];
  const near = found.near && { ...found, ...found.near, matching: found.own.filter(({ cell }) => matches(cell, found.near.size)) };
  return [
    ask(unmeasured(context, found, order[0])),
    keptCosts(context, found),
    order.length > 0 && curve(context, near, order),
    order.length > 0 && cost(context, near, order[0]),
  ].filter(Boolean);
}

/** A question with a few answers: buttons, of which one is pressed; those that were not measured are dashed, and a line says so. */
function buttons(question, options, chosen, change, absent, reason, note) {
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
          class: absent?.(key) ? "unmeasured" : null,
          text: name,
          "aria-pressed": String(key === chosen),
          click: () => change(key),
        }),
      ),
    ),
    note && make("p", { class: "note", text: note }),
    reason && make("p", { class: "note reason", text: reason }),
  );
}

const names = (classes) => Object.fromEntries(Object.entries(classes).map(([key, one]) => [key, one.name]));

/** Says which options were not measured in these results, and of which the project has measurements; "" if all were. */
function reasonOf(options, absent, isKept, more = "") {
  const without = Object.keys(options).filter(absent);
  if (!without.length) return "";
  const [kept, open] = [without.filter(isKept), without.filter((key) => !isKept(key))].map((keys) => keys.map((key) => options[key]).join(", "));
  return [
    kept && `Not measured in these results, answered by the project's own measurements: ${kept}.`,
    open && `${kept ? "Measured in neither" : "Not measured in these results"}: ${open}.`,
    more,
  ]
    .filter(Boolean)
    .join(" ");
}

function questions({ model, state, set }, found) {
  const kinds = Object.fromEntries(found.kinds.map((kind) => [kind, ASKS[kind] ?? kind]));
  const scenes = { "": "any scene", ...Object.fromEntries(found.scenes.map((scene) => [scene, sceneWords(scene)])) };
  const known = found.scene ? [] : found.known;
  const question = (text, options, chosen, name, absent, isKept, more, note) =>
    buttons(text, options, chosen, (key) => set({ [name]: key }), absent, reasonOf(options, absent, isKept, more), note);
  const largest = found.own.map(({ cell }) => cell).reduce((most, cell) => (most && most.primitives >= cell.primitives ? most : cell), null);
  return make(
    "section",
    { class: "questions", "aria-label": "Questions" },
    buttons("1. What do you know of the future?", names(KNOWN), state.know, (know) => set({ know })),
    question(
      "2. How many frames from one keyframe to the next? (Positions only: 1)",
      names(FRAMES),
      found.frames,
      "frames",
      (key) => !found.matching.some(({ cell }) => matches(cell, "", key)),
      (key) => known.some((cell) => matches(cell, found.size, key)),
      "",
      state.frames in FRAMES ? "" : "Follows from question 1 until you choose.",
    ),
    question(
      "3. How many triangles, both bodies together?",
      names(SIZES),
      found.size,
      "large",
      (key) => key !== "any" && !found.own.some(({ cell }) => matches(cell, key)),
      (key) => known.some((cell) => matches(cell, key)),
      largest && `The largest scene here has ${largest.size} triangles, both bodies together.`,
    ),
    question(
      "4. What collides?",
      kinds,
      found.asks,
      "asks",
      (key) => !found.here.has(key),
      (key) => (model.data.kept?.cells ?? []).some((cell) => cell.asks === key),
    ),
    make("div", { class: "toolbar" }, choice("scene", scenes, found.scene, (of) => set({ of }))),
  );
}

/** Tells the speed of a strategy, as analysis/advice/advice.py does. */
export function speedText(one) {
  const missing = one.own.length < one.cells ? `, measured in ${one.own.length}` : "";
  const disturbed = one.disturbed ? ` (${doubtText(one)})` : "";
  if (one.contestant.baseline && !one.bestIn) {
    const span = one.low < one.high ? `${factor(one.low)} to ${factor(one.high)}` : factor(one.low);
    return `a refit, ${span} times as fast as the best one of the ${one.cells === 1 ? "cell" : "cells"}${missing}${disturbed}`;
  }
  if (one.contestant.baseline) return refitText(one, missing);
  const span = one.low < one.high ? `${factor(one.low)} to ${factor(one.high)}` : "";
  const kind = one.isInterval ? "95\u00a0% interval" : "range of its rounds";
  const of = span && one.cells === 1 ? `${kind} ${span}` : `${span} in ${plural(one.cells, "cell")}`.trim();
  return `${factor(one.speed)} times as fast as the best refit (${of}${missing}${one.disturbed ? `; ${doubtText(one)}` : ""})`;
}

/** Tells in how many cells a refit is the best one and how far behind it is in the others, each with what is doubtful there. */
function refitText(one, missing) {
  if (one.cells === 1) return `the best refit in the only cell${missing}${one.disturbed ? ` (${doubtText(one)})` : ""}`;
  const [best, behind] = [true, false].map((isBest) => one.doubtful.filter((cell) => cell.isBest === isBest));
  const said = `the best refit in ${one.bestIn} of ${plural(one.cells, "cell")}${missing}${best.length ? ` (${doubtText({ ...one, doubtful: best })})` : ""}`;
  const others = one.own.length - one.bestIn;
  if (!others) return said;
  const times = factor(one.low) === "1.00" ? "less than 1\u00a0% slower" : `${others > 1 ? "at worst " : ""}${factor(one.low)} times as fast`;
  return `${said}; in the other ${others === 1 ? "one" : others} ${times}${behind.length ? ` (${doubtText({ ...one, doubtful: behind })})` : ""}`;
}

/** Names the cells that were measured on a disturbed machine: with its ratio, or by itself where it is the best refit. */
function doubtText({ doubtful, cells }) {
  if (cells === 1) return "a doubtful run: the machine was disturbed";
  const named = doubtful.slice(0, 2).map(({ cell, speed, isBest }) => `${isBest ? "" : `${factor(speed)} on `}${cell.shown ?? cell.title}`);
  const more = doubtful.length > 2 ? `; and ${doubtful.length - 2} more` : "";
  return `doubtful, from a disturbed machine: ${named.join("; ")}${more}`;
}

/** Answers in words whether a strategy is surely faster than the best refit: by the cells in which it loses, or may lose. "" of a refit. */
export function sureText(model, one) {
  if (one.contestant.baseline) return "";
  const all = one.cells === 1 ? "the only cell" : `all ${one.own.length} cells`;
  const lost = one.own.filter(({ speeds }) => speeds.get(one.id) < 1);
  if (lost.length) return `Surely faster? No: ${lost.length} of ${plural(one.own.length, "cell")} ${lost.length === 1 ? "is" : "are"} slower.`;
  const open = one.own.filter(({ runs, refit }) => decided(compare(model, runs.get(one.id), refit, "with_motion")) !== 1);
  if (!open.length) return `Surely faster? Yes, in ${all}, each interval or range included.`;
  return `Surely faster? Not beyond doubt: ${one.own.length === open.length ? "no" : `in ${open.length} of ${plural(one.own.length, "cell")} no`} interval or range of an undisturbed run lies above 1.`;
}

/** Tells on how many cells a strategy beats the best refit, which refit that is, and where it loses; "" of one cell or of a best refit. */
export function winsText(one) {
  if (one.cells < 2 || one.contestant.baseline) return "";
  const refits = Map.groupBy(one.own, ({ refit }) => refit.contestant.title);
  const [title, most] = [...refits].sort((a, b) => b[1].length - a[1].length)[0];
  const lost = one.own.filter(({ speeds }) => speeds.get(one.id) < 1);
  const scenes = [...new Set(lost.map(({ cell }) => cell.shown))];
  const where = scenes.length && `; slower on ${scenes.slice(0, 3).join(", ")}${scenes.length > 3 ? ` and ${scenes.length - 3} more` : ""}`;
  const of = refits.size === 1 ? title : `${title} in ${most.length} of them`;
  return `It beats the best refit (${of}) in ${one.own.length - lost.length} of ${plural(one.own.length, "cell")}${where || ""}.`;
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
  return rangeText(one.own.map(({ cell }, i) => [value(model, runs[i], "with_motion"), cell]));
}

/** Tells times in ms of several cells from the shortest to the longest, each with the size of its scene. */
export function rangeText(times) {
  const [low, high] = [-1, 1].map((sign) => times.reduce((most, one) => (sign * (one[0] - most[0]) > 0 ? one : most)));
  const text = ([time, cell]) => `${milliseconds(time)} ms (${cell.size})`;
  return `${text(low)}${low === high ? "" : ` to ${text(high)}`} a frame`;
}

/** Says in a clause what a strategy does; "" if the page does not know. */
export function methodText(model, { id, contestant }) {
  const clause = model.data.methods?.[id];
  return clause ? `${sentence(contestant.title)} ${clause}.` : "";
}

/** Leads to the two other questions that the page answers. */
function onward({ model, set }) {
  const link = (view, text) => make("button", { type: "button", class: "quiet", text, click: () => set({ view }) });
  const parts = [
    model.data.claims.length > 0 && link("claims", "Does the paper hold?"),
    model.runs.some(errs) && link("errors", "What if errors are allowed?"),
  ].filter(Boolean);
  return parts.length > 0 && make("p", { class: "note onward" }, parts.map((part, i) => [i > 0 && " · ", part]));
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
      ? cell.title.replace(`${cell.shown}, ${cell.size}`, () => `${cell.shown} with ${cell.size} triangles`)
      : `${plural(best.cells, "cell")} of ${scenes.size === 1 ? cell.shown : plural(scenes.size, "scene")}`;
  return make(
    "section",
    { class: "answer", "aria-live": "polite" },
    make("p", { class: "take" }, "Take ", symbol(looksOf(order)[0]), make("strong", { text: best.contestant.title }), `: ${costText(model, best)}.`),
    make("p", { class: "speed", text: [`That is ${speedText(best)}.`, winsText(best), sureText(model, best)].filter(Boolean).join(" ") }),
    methodText(model, best) && make("p", { class: "method", text: methodText(model, best) }),
    make(
      "p",
      {},
      `Measured on one thread in ${of}, evaluation of positions included, sizes in triangles of both bodies together; ${PROMISES[best.contestant.guarantee]}. It is called `,
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

/** Returns the best six as their lines look: the first stands out. */
const looksOf = (order) => leading(order.slice(0, SIX).map((one) => one.contestant));

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
  const looks = looksOf(order);
  const entries = order.slice(0, SIX).map((one, i) => [looks[i], one.contestant.title, speedText(one)]);
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
    .toSorted((a, b) => a.cell.primitives - b.cell.primitives || a.cell.place - b.cell.place)
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
    make("p", { class: "note", text: "Each line is a cell: one scene at one size (triangles of both bodies together), with l frames from a keyframe to the next." }),
    make("div", { class: "scroll", tabindex: 0 }, tableOf(["scene", `${best.contestant.title}, ms`, "best refit", "ms", "times as fast"], rows)),
  );
}
