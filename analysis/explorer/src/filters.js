// The filters: one group a facet, with the numbers of runs that each value would leave.
import { make, symbol } from "./dom.js";
import { facetOf, selected } from "./model.js";
import { sceneWords } from "./words.js";

const NAMES = {
  plan: "Study",
  scene: "Scene",
  size: "Triangles (both bodies)",
  l: "l (frames per keyframe)",
  scalar: "Scalar",
  machine: "Machine",
  commit: "Commit",
  strategy: "Strategy",
};
const NUMERIC = ["size", "l"];

export function filters({ model, state, set, close }) {
  const groups = Object.keys(NAMES)
    .map((facet) => group(model, state, set, facet))
    .filter(Boolean);
  const active = Object.keys(NAMES).filter((facet) => state[facet].length);
  return [
    make(
      "div",
      { class: "filters-head" },
      make("h2", { text: "Filter" }),
      active.length > 0 &&
        make("button", {
          type: "button",
          class: "quiet",
          text: "Clear all",
          click: () => set(Object.fromEntries(active.map((facet) => [facet, []]))),
        }),
      make("button", { type: "button", class: "close-filters", text: "Done", click: close }),
    ),
    ...groups,
  ];
}

function group(model, state, set, facet) {
  const of = facetOf[facet];
  const counts = new Map();
  for (const run of model.runs) if (state.contestants === "all" || run.contestant.usual) counts.set(of(run), 0);
  for (const value of state[facet]) if (!counts.has(value)) counts.set(value, 0); // a link may name what is not here
  if (counts.size < 2 && !state[facet].length) return null;
  for (const run of selected(model, state, facet)) counts.set(of(run), (counts.get(of(run)) ?? 0) + 1);
  let values = [...counts.keys()];
  if (NUMERIC.includes(facet)) values.sort((a, b) => a - b);
  if (facet === "strategy")
    values.sort((a, b) => family(model, a).localeCompare(family(model, b)) || title(model, a).localeCompare(title(model, b)));
  const chosen = new Set(state[facet]);
  const toggle = (value, on) => {
    const next = new Set(chosen);
    if (on) next.add(value);
    else next.delete(value);
    set({ [facet]: values.filter((one) => next.has(one)) });
  };
  const box = (value) => {
    const contestant = facet === "strategy" && model.contestants.find((one) => one.id === value);
    return make(
      "label",
      { class: counts.get(value) ? null : "absent", title: contestant ? contestant.id : null },
      make("input", {
        type: "checkbox",
        name: facet,
        value,
        checked: chosen.has(value),
        change: (event) => toggle(value, event.target.checked),
      }),
      contestant && symbol(contestant),
      make("span", {
        class: "value",
        text: NUMERIC.includes(facet)
          ? Number(value).toLocaleString("en").replaceAll(",", "\u202f")
          : contestant
            ? contestant.title
            : facet === "scene"
              ? sceneWords(value)
              : value,
      }),
      make("span", { class: "count", text: counts.get(value) }),
    );
  };
  return make(
    "details",
    { class: "facet", "data-facet": facet, open: facet === "scene" || facet === "strategy" || chosen.size > 0 },
    make("summary", {}, NAMES[facet], chosen.size > 0 && make("span", { class: "chosen-count", text: chosen.size })),
    make(
      "fieldset",
      {},
      make("legend", { class: "hidden", text: NAMES[facet] }),
      values.map(box),
      chosen.size > 0 &&
        make("button", { type: "button", class: "quiet", text: "Clear", click: () => set({ [facet]: [] }) }),
    ),
  );
}

function title(model, id) {
  return model.contestants.find((one) => one.id === id)?.title ?? id;
}

function family(model, id) {
  return model.contestants.find((one) => one.id === id)?.family ?? "";
}
