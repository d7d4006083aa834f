// The panel that shows where a point comes from.
import { command } from "./command.js";
import { tableOf } from "./chart.js";
import { copy, make, symbol } from "./dom.js";
import { MEASURES, compare, ratioText, reference, referenceName, value } from "./model.js";
import { bytes, count, milliseconds, percent, significant } from "./words.js";

const PHASES = {
  motion: "motion",
  update: "update",
  traversal: "traversal",
  triangle_tests: "triangle tests",
  plan_changes: "changes",
};

/** Fills the panel with a run. */
export function details(model, state, run, close) {
  const { cell, contestant } = run;
  const { text, why } = command(run);
  const button = make("button", { type: "button", text: "Copy the command", click: () => copy(text, button) });
  const settings = Object.entries({ ...contestant.params, ...(contestant.builder ?? {}) });
  const base = reference(model, state, cell, run);
  const facts = [
    [
      "Scene",
      `${cell.name}, ${cell.size} triangles (both bodies), ${cell.scalar}, l = ${cell.l}, ${cell.frames} ${cell.continuous ? "intervals" : "frames"}`,
    ],
    ["Guarantee", contestant.guarantee.replace("_", " ")],
    ["Settings", settings.map(([name, own]) => `${name.replaceAll("_", " ")} ${own}`).join(", ") || "none"],
    MEASURES[state.measure] && [
      MEASURES[state.measure].name,
      `${MEASURES[state.measure].format(value(model, run, state.measure))} ${MEASURES[state.measure].unit === "ms" ? "ms" : ""}`,
    ],
    base &&
      base !== run && [
        `Against ${referenceName(model, state)}`,
        `${ratioText(compare(model, run, base, state.measure))} times as fast, against ${base.contestant.label}`,
      ],
    run.p50 !== null && [
      "Frames, without motion",
      `mean ${milliseconds(value(model, run, "without_motion"))} ms; half of them take more than ${milliseconds(run.p50)} ms, one in a hundred more than ${milliseconds(run.p99)} ms; the worst takes ${milliseconds(run.worst)} ms`,
    ],
    [
      "Answers",
      `${count(run.pairs)} pairs, ${count(run.missed)} missed, ${count(run.extra)} extra; compared on ${run.verified_frames} frames`,
    ],
    [
      "Boxes",
      run.looseness === null
        ? "not visible"
        : `protrusion ${significant(run.protrusion, 2)}, looseness ${percent(run.looseness)}`,
    ],
    ["Memory", `${bytes(run.bytes)}${run.build_ms === null ? "" : `, built in ${milliseconds(run.build_ms)} ms`}`],
    ["Machine while measured", run.disturbed ? `disturbed: ${run.disturbed}` : "quiet, as far as recorded"],
    ["Measured", `${run.when.replace("T", " ").replace("Z", " UTC")}, commit ${cell.commit.label}`],
    [
      "Machine",
      Object.entries(cell.machine.facts)
        .map(([name, fact]) => (/^(cores|memory)/.test(name) ? `${name} ${fact}` : fact))
        .join(" · "),
    ],
    run.plan.name && ["Study", run.plan.name],
    contestant.citation && ["After", contestant.citation],
  ].filter(Boolean);
  return [
    make(
      "header",
      {},
      make("h2", { id: "details-name" }, symbol(contestant), contestant.label),
      make("button", { type: "button", class: "quiet", "aria-label": "close", text: "✕", click: close }),
    ),
    run.refused && make("p", { class: "refused", text: `No time: ${run.refused}` }),
    make(
      "dl",
      {},
      facts.map(([term, fact]) => make("div", {}, make("dt", { text: term }), make("dd", { text: fact }))),
    ),
    make("h3", { text: "Make it again" }),
    text
      ? make("pre", { class: "command", tabindex: 0 }, make("code", { text }))
      : make("p", { class: "note", text: why }),
    text && button,
    run.times.length > 0 && make("h3", { text: "Repetitions, ms per frame" }),
    run.times.length > 0 &&
      make(
        "div",
        { class: "scroll" },
        tableOf(
          Object.values(PHASES),
          run.times.map((phases) => Object.keys(PHASES).map((phase) => milliseconds(phases[model.place[phase]]))),
        ),
      ),
  ].filter(Boolean);
}
