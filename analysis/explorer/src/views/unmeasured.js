// What the page says to a choice that the results have no measurements of: that they have none, what the project has measured, what is near.
import { ASKS, FRAMES, KNOWN, SIZES, nearest, rankedKept } from "../advice.js";
import { tableOf } from "../chart.js";
import { make } from "../dom.js";
import { factor, milliseconds, plural, sceneWords, sentence, significant } from "../words.js";
import { costText, methodText, rangeText, speedText } from "./answer.js";

/** Names classes of l and of sizes. */
function situation(frames, size) {
  const words = frames === "1" ? "positions only (a keyframe at every frame)" : FRAMES[frames].words;
  return size === "any" ? words : `${words}, ${SIZES[size].name} triangles`;
}

/** The answer card of a choice without measurements; `best` is what the rule takes in the nearest cells of these results. */
export function unmeasured({ model, state, set }, found, best) {
  const { kept } = model.data;
  const [own, next] = found.kept.length ? rankedKept(kept, found.kept, state.know) : [];
  const largest = found.own.map(({ cell }) => cell).reduce((most, cell) => (most && most.primitives >= cell.primitives ? most : cell), null);
  const above = largest && found.size !== "any" && SIZES[found.size].from > largest.primitives ? ` Nothing above ${largest.size} was.` : "";
  const known = !own && !found.scene ? nearest(found.known.map((cell) => ({ cell })), found.size, found.frames) : null;
  const other = known && !(best && known.frames === found.near.frames && known.size === found.near.size) ? known : null;
  const lead = ({ frames, size }) =>
    make("button", { type: "button", class: "quiet", text: situation(frames, size), click: () => set({ frames, large: size }) });
  const refits = found.frames === "1" && best?.contestant.baseline && found.near.frames !== "1";
  const scene = found.scene ? `${sceneWords(found.scene)}, ` : "";
  return make(
    "section",
    { class: "answer", "aria-live": "polite" },
    make("p", { class: "absent-here" }, make("strong", { text: "Not measured in these results: " }), `${ASKS[found.asks] ?? found.asks}, ${scene}${situation(found.frames, found.size)}.${above}`),
    own && [
      make("p", { class: "take" }, "Take ", make("strong", { text: own.contestant.title }), `: ${keptCost(own)}.`),
      make("p", { class: "speed", text: [`That is ${speedText(own)}.`, keptWins(own)].filter(Boolean).join(" ") }),
      methodText(model, own) && make("p", { class: "method", text: methodText(model, own) }),
      make("p", {}, "By the project's own measurements, not by these results. It is called ", make("code", { text: own.id }), " on the command line and in code."),
      next && make("p", { class: "note", text: `Next: ${next.contestant.title}, ${keptCost(next)}; ${speedText(next)}.` }),
      make("p", { class: "note", text: `Measured: ${kept.told}.` }),
    ],
    refits &&
      !own &&
      make("p", { class: "take" }, "Take ", make("strong", { text: best.contestant.title }), ": a refit uses no keyframes. Its time with positions only is not known."),
    best &&
      make(
        "p",
        { class: own ? "note nearest" : "nearest" },
        "Nearest in these results: ",
        lead(found.near),
        `. There, where ${KNOWN[state.know].words}, take ${best.contestant.title}: ${costText(model, best)}${best.cells === 1 ? ` on ${best.own[0].cell.title}` : ""}; ${speedText(best)}.`,
      ),
    other && make("p", { class: "kept-near" }, "The project's own measurements have it with ", lead(other), "."),
    !own && !best && !other && make("p", { text: "Nothing near it was measured, either." }),
  );
}

/** Tells what a strategy costs in the project's cells, in several of them also per triangle: for sizes between those that were measured. */
function keptCost(one) {
  const text = rangeText(one.own.map((cell) => [cell.times[one.id], cell]));
  const rates = one.own.map((cell) => (1e6 * cell.times[one.id]) / cell.primitives);
  const [low, high] = [Math.min(...rates), Math.max(...rates)].map((rate) => significant(rate, 2));
  return low === high ? text : `${text}, ${low} to ${high} ns a triangle`;
}

/** Tells in how many of the project's cells a strategy beats the best refit, where it is slowest, and whether that is sure; "" of a refit. */
function keptWins(one) {
  if (one.contestant.baseline) return "";
  const lost = one.own.filter((cell) => cell.speeds[one.id] < 1);
  const slowest = one.own.reduce((most, cell) => (cell.speeds[one.id] < most.speeds[one.id] ? cell : most));
  const sure = one.own.every((cell) => cell.spans[one.id]?.[0] > 1 && !cell.doubtful.includes(one.id));
  const verdict = lost.length ? "no" : sure ? "yes, in each of them with its whole interval" : "not beyond doubt";
  return `Faster in ${one.own.length - lost.length} of ${plural(one.own.length, "cell")}, slowest on ${slowest.title} (${factor(slowest.speeds[one.id])}). Surely faster? ${sentence(verdict)}.`;
}

/** What the project's choice costs in each cell that comes with the project. */
export function keptCosts({ model, state }, found) {
  if (!found.kept.length) return null;
  const { kept } = model.data;
  const best = rankedKept(kept, found.kept, state.know)[0];
  if (!best) return null;
  const ms = (cell, id) => (id in cell.times ? milliseconds(cell.times[id]) : "–");
  const ratioOf = (cell, id) => {
    if (!(id in cell.speeds)) return "–";
    const [low, high] = cell.spans[id] ?? [];
    return `${factor(cell.speeds[id])}${cell.doubtful.includes(id) ? "?" : ""}${low < high ? ` (${factor(low)}–${factor(high)})` : ""}`;
  };
  const rows = found.kept.toSorted((a, b) => a.primitives - b.primitives || a.l - b.l).map((cell) => [
    cell.title,
    ms(cell, best.id),
    kept.strategies[cell.refit]?.[0] ?? cell.refit,
    ms(cell, cell.refit),
    best.id === cell.refit ? "the best refit" : ratioOf(cell, best.id),
  ]);
  return make(
    "section",
    {},
    make("h2", { text: "What it costs in the project's own measurements" }),
    make("p", { class: "note", text: sentence(`${plural(rows.length, "cell")}: a cell is one scene at one size, with l frames from a keyframe to the next; sizes are triangles of both bodies together. In parentheses: the 95\u00a0% interval. ?: measured while the machine was disturbed.`) }),
    make("div", { class: "scroll", tabindex: 0 }, tableOf(["scene", `${best.contestant.title}, ms`, "best refit", "ms", "times as fast"], rows)),
  );
}
