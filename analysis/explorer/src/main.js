// The page: header, filters, views, the panel of a point; redrawn from the state, which the link holds.
import "./style.css";
import { forget } from "./chart.js";
import { command } from "./command.js";
import { details } from "./details.js";
import { choice, copy, hintScrolling, make, paints, symbol } from "./dom.js";
import { filters } from "./filters.js";
import { MEASURES, compare, entrants, model as modelOf, reference, seriesOfName, selected } from "./model.js";
import { dataOf } from "./records.js";
import { FACETS, decode, encode, initial } from "./state.js";
import * as statistics from "./statistics.js";
import { FRAMES, classOf, situations } from "./advice.js";
import { answer } from "./views/answer.js";
import { ORDERS, claims } from "./views/claims.js";
import { errors, errs } from "./views/errors.js";
import { frames } from "./views/frames.js";
import { overview, profiled } from "./views/overview.js";
import { pairwise } from "./views/pairwise.js";
import { runs } from "./views/runs.js";
import { scaling } from "./views/scaling.js";
import { pairs, sources, versus } from "./views/versus.js";
import { plural } from "./words.js";

const QUESTION = "Which BVH update to take?";
const begun = performance.now();
const given = JSON.parse(document.getElementById("data").textContent);
let model = modelOf(given);
let state = decode(location.hash);

const VIEWS = {
  answer: { name: "Answer", draw: answer, uses: [] },
  overview: { name: "Overview", draw: overview, uses: ["measure", "against", "per", "contestants", "cells"] },
  pairwise: { name: "Ratios", draw: pairwise, uses: ["measure", "against", "per", "contestants"] },
  errors: { name: "Time and error", draw: errors, uses: ["measure", "cell"] },
  scaling: { name: "Over l and n", draw: scaling, uses: ["measure", "per", "contestants"] },
  frames: { name: "Frames over time", draw: frames, uses: ["cell", "per", "contestants"] },
  versus: { name: "A against B", draw: versus, uses: ["measure", "contestants"], shown: () => sources(model).size > 1 },
  claims: { name: "The paper's claims", draw: claims, uses: ["claims"], shown: () => model.data.claims.length > 0 },
  runs: { name: "All runs", draw: runs, uses: ["measure", "against", "contestants"] },
};
let views = [];

const host = {
  filters: make("aside", { id: "filters", "aria-label": "Filters" }),
  tabs: make("div", { role: "tablist", "aria-label": "Views" }),
  tools: make("div", { class: "toolbar", "aria-label": "What is shown" }),
  view: make("div", { id: "view", role: "tabpanel", tabindex: -1 }),
  panel: make("aside", { id: "details", "aria-labelledby": "details-name", tabindex: -1, hidden: true }),
  said: make("p", { class: "hidden", role: "status" }),
  problem: make("p", { class: "refused problem", role: "alert", hidden: true }),
};

/** Changes the state, the link and the page. */
function set(patch) {
  const before = state;
  state = { ...state, ...patch };
  const link = `#${encode(state)}`;
  const jumps = state.view !== before.view;
  history[jumps ? "pushState" : "replaceState"](null, "", link === "#" ? location.pathname + location.search : link);
  draw(Object.keys(patch));
}

function choose(run, from) {
  host.back = from;
  set({ point: run.key });
  host.panel.focus({ preventScroll: true });
}

function close() {
  set({ point: "" });
  host.back?.focus?.({ preventScroll: true });
}

/** The cell of views that show one: the chosen one, or the one with most entrants; of time against error, with most that err. */
function currentCell() {
  const cells = entrants(model, { ...state, contestants: state.view === "errors" ? "all" : state.contestants });
  const erring = (cell) => (state.view === "errors" ? cell.runs.filter(errs).length : 0);
  const order = [...cells].sort((a, b) => erring(b[0]) - erring(a[0]) || b[1].size - a[1].size || b[0].primitives - a[0].primitives);
  const names = new Map(order.map(([cell]) => [cell, state.view === "errors" && !erring(cell) ? `${cell.title}: exact contestants only` : cell.title]));
  return { cells: state.view === "errors" ? new Map(order) : cells, cell: order.find(([cell]) => cell.key === state.cell)?.[0] ?? order[0]?.[0], names };
}

function tools(uses, current) {
  const strategies = Object.fromEntries(
    [...new Map(model.contestants.map((one) => [one.id, one.title]))].sort((a, b) => a[1].localeCompare(b[1])),
  );
  const settings = Object.fromEntries(
    model.contestants
      .filter((one) => model.contestants.filter((other) => other.id === one.id).length > 1)
      .map((one) => [one.key, one.label])
      .sort((a, b) => a[1].localeCompare(b[1])),
  );
  const against = {
    usual: undefined,
    "In each cell": { baseline: "the best refit", tree: "the refit of the same tree", fastest: "the fastest" },
    "A strategy, at its fastest": strategies,
    "One setting": settings,
  };
  delete against.usual;
  if (!Object.keys(settings).length) delete against["One setting"];
  const words = Object.fromEntries(Object.entries(MEASURES).map(([name, measure]) => [name, measure.name]));
  const all = {
    cell: () =>
      current &&
      choice(
        "Cell",
        Object.fromEntries([...current.cells.keys()].map((cell) => [cell.key, current.names.get(cell)])),
        current.cell?.key,
        (cell) => set({ cell }),
      ),
    measure: () => choice("Measure", words, state.measure, (measure) => set({ measure })),
    against: () => choice("Compared with", against, state.against, (name) => set({ against: name })),
    per: () =>
      choice("Settings", { best: "each strategy's fastest", each: "every setting" }, state.per, (per) => set({ per })),
    contestants: () =>
      choice("Contestants", { usual: "guaranteed, one thread", all: "all" }, state.contestants, (contestants) =>
        set({ contestants }),
      ),
    cells: () =>
      choice(
        "Cells",
        { own: "those of each strategy", all: "all; absent is never", common: "common to all" },
        state.cells,
        (cells) => set({ cells }),
      ),
    claims: () => choice("Order of the claims", ORDERS, state.claims, (order) => set({ claims: order })),
  };
  host.tools.replaceChildren(...uses.map((name) => all[name]()).filter(Boolean));
}

/** A legend of series or strategies, with a button for lines that are not drawn; or of runs; or of entries. `looks` changes the contestants' looks. */
function legend(names, others = 0, looks = (contestants) => contestants) {
  const named = (name) =>
    seriesOfName(model, { per: model.contestants.some((one) => one.id === name) ? "best" : "each" }, name);
  const series = names.map(named);
  const shown = looks(series.map((one) => one.contestant));
  const list = legendList(series.map(({ label }, i) => [shown[i], label]));
  return list && make("div", { class: "legend-box" }, list, others > 0 && othersButton(others));
}
function legendOf(list) {
  return legendList([
    ...new Map(list.map((run) => [run.contestant.key, [run.contestant, run.contestant.label]])).values(),
  ]);
}
function legendList(entries) {
  return (
    entries.length > 0 &&
    make(
      "ul",
      { class: "legend", "aria-label": "Legend" },
      entries.map(([contestant, label, told]) =>
        make("li", {}, symbol(contestant), make("span", {}, label, told && make("small", { text: told }))),
      ),
    )
  );
}

/** Shows or hides the lines beyond the best six. */
function othersButton(count) {
  const all = state.lines === "all";
  return make("button", {
    type: "button",
    class: "others",
    text: all ? "Only the best six" : `The other ${count}, too`,
    click: () => set({ lines: all ? "six" : "all" }),
  });
}

/** Puts a view's legend next to its figures. */
function besideLegend(parts) {
  const legend = parts.find((one) => one.classList.contains("legend") || one.classList.contains("legend-box"));
  if (!legend) return parts;
  const top = parts.filter((one) => one.classList.contains("bargain")); // what the figures say, before the legend in a narrow window
  const figures = parts.filter((one) => one !== legend && !top.includes(one));
  return [...top, make("div", { class: "beside-legend" }, make("div", {}, figures), legend)];
}

function drawView() {
  const [name, view] = views.find(([key]) => key === state.view) ?? views[0];
  const current = view.uses.includes("cell") ? currentCell() : null;
  for (const tab of host.tabs.children) {
    const mine = tab.dataset.view === name;
    tab.setAttribute("aria-selected", mine);
    tab.tabIndex = mine ? 0 : -1;
  }
  tools(view.uses, current);
  host.view.setAttribute("aria-label", view.name);
  const mixed = ["overview", "pairwise"].includes(name) && new Set(model.cells.map((cell) => `${cell.asks}, ${classOf(FRAMES, cell.l)}`)).size > 1;
  const context = { model, state, set, choose, legend, legendList, legendOf, othersButton, cell: current?.cell };
  const count = selected(model, state).length;
  const nothing = count === 0 && !["answer", "claims"].includes(name);
  document.body.classList.toggle("answering", name === "answer");
  document.body.classList.toggle("unfiltered", ["answer", "claims"].includes(name));
  host.view.replaceChildren(
    ...(nothing
      ? [make("p", { class: "lead", text: "No run passes these filters." })]
      : [mixed && mixture(), ...besideLegend(view.draw(context).filter(Boolean))].filter(Boolean)),
  );
  hintScrolling(host.view);
  hintScrolling(host.tabs.parentElement.parentElement);
  const tab = host.tabs.querySelector('[aria-selected="true"]');
  if (tab) host.tabs.scrollLeft = tab.offsetLeft - 40; // the tabs are a row that scrolls in a narrow window
  host.said.textContent = `${view.name}: ${plural(count, "run")}`;
  forget();
}

/** Says that a view is about all situations, and leads to the one of the reader. */
function mixture() {
  return make(
    "p",
    { class: "lead mixture" },
    "This view mixes all situations of these results: sizes, frames a keyframe, pairs of two bodies and within one, and what is known of the future. For a single situation, ",
    make("button", { type: "button", class: "quiet", text: "see the answer", click: () => set({ view: "answer" }) }),
    " or use the filters.",
  );
}

function drawPanel() {
  const run = state.point && model.runs.find((one) => one.key === state.point);
  host.panel.hidden = !run;
  document.body.classList.toggle("has-details", Boolean(run));
  if (run) host.panel.replaceChildren(...details(model, state, run, close));
}

function drawFilters() {
  const open = new Map([...host.filters.querySelectorAll("details")].map((one) => [one.dataset.facet, one.open]));
  const focused = document.activeElement?.closest?.("#filters input");
  host.filters.replaceChildren(...filters({ model, state, set, close: () => showFilters(false) }));
  for (const one of host.filters.querySelectorAll("details"))
    if (open.has(one.dataset.facet)) one.open = open.get(one.dataset.facet);
  if (focused)
    host.filters.querySelector(`input[name="${focused.name}"][value="${CSS.escape(focused.value)}"]`)?.focus();
  const active = FACETS.filter((facet) => state[facet].length).length;
  host.open.textContent = active ? `Filters (${active})` : "Filters";
}

/** Opens or closes the filters, where the window is too narrow for them to stay. */
function showFilters(open) {
  document.body.classList.toggle("filters-open", open);
  host.open.setAttribute("aria-expanded", open);
  (open ? host.filters.querySelector("input, summary") : host.open)?.focus({ preventScroll: true });
}

/** Redraws what depends on the changed parts of the state. */
function draw(changed) {
  const only = (...names) => changed?.length && changed.every((name) => names.includes(name));
  if (!only("point", "sort", "view", "a", "b", "cell", "against", "measure", "claims")) drawFilters();
  drawPanel();
  if (only("point")) markChosen();
  else {
    const top = changed?.includes("view");
    const focus = host.tools.contains(document.activeElement)
      ? [...host.tools.querySelectorAll("select")].indexOf(document.activeElement)
      : -1;
    drawView();
    if (focus >= 0) host.tools.querySelectorAll("select")[focus]?.focus();
    if (top && scrollY > host.tabs.offsetTop) scrollTo({ top: host.tabs.offsetTop - 8 });
  }
}

function markChosen() {
  for (const cell of host.view.querySelectorAll("[data-run]"))
    cell.classList.toggle("chosen", model.runs[cell.dataset.run].key === state.point);
}

/** Returns a description without the marks of code, which plans have. */
const plain = (text) => text.replaceAll("`", "");

function header() {
  const { data } = model;
  const named = data.plans.filter((plan) => plan.name);
  // A page asks its question; what the study was made for, and its numbers, fold out.
  const names = named.map((plan) => plan.name);
  const study = names.length > 3 ? plural(names.length, "study").replace("studys", "studies") : names.join(" · ");
  const about =
    named.length === 1
      ? [make("p", { class: "question", text: plain(named[0].description) })]
      : named.map((plan) =>
          make("p", { class: "question" }, make("strong", { text: `${plan.name}.` }), ` ${plain(plan.description)}`),
        );
  const usual = model.runs.filter((run) => run.contestant.usual).length;
  const facts = [
    plural(model.runs.length, "run") + (usual < model.runs.length ? ` (${usual} of them guaranteed and on one thread)` : ""),
    plural(model.cells.length, "cell"),
    plural(new Set(model.cells.map((cell) => cell.scene)).size, "scene"),
    plural(new Set(model.contestants.map((one) => one.id)).size, "strategy").replace("strategys", "strategies"),
    model.commits.length === 1 ? `commit ${model.commits[0].label}` : plural(model.commits.length, "commit"),
    model.machines.length === 1 ? model.machines[0].label : plural(model.machines.length, "machine"),
  ];
  const picker = make("input", {
    type: "file",
    class: "hidden",
    accept: ".jsonl,.json",
    multiple: true,
    tabindex: -1,
    "aria-label": "files of results",
    change: () => read(picker.files),
  });
  const share = make("button", {
    type: "button",
    text: "Copy the link",
    title: "The link has the filters, the view and the chosen point",
    click: () => copy(location.href, share),
  });
  const theme = make("button", {
    type: "button",
    id: "theme",
    click: () => scheme(document.documentElement.dataset.scheme === "dark" ? "light" : "dark"),
  });
  host.theme = theme;
  return make(
    "header",
    { class: "page" },
    make(
      "div",
      { class: "title" },
      make("h1", { text: data.title || QUESTION }),
      make(
        "div",
        { class: "actions" },
        data.report && make("a", { href: data.report, text: "Report" }),
        make("button", {
          type: "button",
          text: "Open results…",
          title: "Reads results.jsonl files in this page, without sending them anywhere; they can be dropped on it, too",
          click: () => picker.click(),
        }),
        picker,
        share,
        theme,
      ),
    ),
    make(
      "details",
      { class: "notes" },
      make("summary", { text: ["How this study was made", study, ...facts.slice(0, 4)].filter(Boolean).join(" · ") }),
      about,
      make("p", { class: "facts", text: facts.slice(4).join(" · ") }),
    ),
    data.notes.length > 0 &&
      make(
        "details",
        { class: "notes" },
        make("summary", { text: plural(data.notes.length, "note") + " on the input" }),
        make(
          "ul",
          {},
          data.notes.map((text) => make("li", { text })),
        ),
      ),
  );
}

/** Chooses a colour scheme; by default, the system's. */
function scheme(name) {
  document.documentElement.dataset.scheme = name;
  host.theme.textContent = name === "dark" ? "Light" : "Dark";
  host.theme.setAttribute("aria-label", `switch to the ${name === "dark" ? "light" : "dark"} scheme`);
}

/** Makes the page again, from files of results. */
async function read(files) {
  if (!files.length) return;
  const names = [...files].map((file) => file.name).join(", ");
  host.said.textContent = `Reading ${names}`;
  try {
    const texts = await Promise.all([...files].map((file) => file.text()));
    model = modelOf({ ...dataOf(texts.join("\n"), names, given.palette), kept: given.kept, methods: given.methods });
  } catch (problem) {
    host.problem.textContent = `${names} cannot be shown: ${problem.message}`;
    host.problem.hidden = false;
    return;
  }
  state = initial();
  history.replaceState(null, "", location.pathname + location.search);
  for (const old of document.querySelectorAll("body > :not(script), head > style.contestants")) old.remove();
  build();
  draw();
  host.said.textContent = `${names}: ${plural(model.runs.length, "run")}`;
}

function build() {
  views = Object.entries(VIEWS).filter(([, { shown }]) => !shown || shown());
  host.tabs.replaceChildren();
  host.problem.hidden = true;
  document.head.append(
    make("style", {
      class: "contestants",
      text: `:root{${paints(model.contestants, "light")}}@media screen{:root[data-scheme=dark]{${paints(model.contestants, "dark")}}}`,
    }),
  );
  host.open = make("button", {
    type: "button",
    id: "open-filters",
    "aria-controls": "filters",
    "aria-expanded": "false",
    click: () => showFilters(!document.body.classList.contains("filters-open")),
  });
  host.tabs.append(
    ...views.map(([key, { name }]) =>
      make("button", {
        type: "button",
        role: "tab",
        "data-view": key,
        "aria-controls": "view",
        "data-name": name,
        text: name,
        click: () => set({ view: key }),
      }),
    ),
  );
  document.body.prepend(
    make("a", {
      class: "skip",
      href: "#view",
      text: "Skip to the figures",
      click: (event) => {
        event.preventDefault();
        host.view.focus();
      },
    }),
    header(),
    make("nav", { class: "views" }, host.open, host.tabs),
    host.problem,
    make(
      "div",
      { class: "layout" },
      host.filters,
      make("main", {}, host.tools, host.view),
      host.panel,
    ),
    make(
      "footer",
      {},
      make("p", {
        text: `From ${model.data.source}. Sizes are triangles of both bodies together. Times are ms per frame of whole clips: the mean over frames of each frame's median over the rounds. Intervals are bootstraps over whole rounds; with fewer than five rounds, they are ranges.`,
      }),
    ),
    host.said,
  );
  scheme(document.documentElement.dataset.scheme ?? (dark.matches ? "dark" : "light"));
}

/** Adds the listeners that outlive a change of the results. */
function listen() {
  host.filters.addEventListener("keydown", (event) => event.key === "Escape" && showFilters(false));
  host.tabs.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const at = views.findIndex(([key]) => key === document.activeElement.dataset.view);
    const next = host.tabs.children[(at + step + views.length) % views.length];
    next.focus();
    next.click();
  });
  host.panel.addEventListener("keydown", (event) => event.key === "Escape" && close());
  dark.addEventListener("change", () => scheme(dark.matches ? "dark" : "light"));
  addEventListener("dragover", (event) => event.preventDefault());
  addEventListener("drop", (event) => {
    event.preventDefault();
    read(event.dataTransfer.files);
  });
}

const dark = matchMedia("(prefers-color-scheme: dark)");
listen();
build();
draw();
addEventListener("hashchange", () => {
  state = decode(location.hash);
  draw();
});
addEventListener("popstate", () => {
  state = decode(location.hash);
  draw();
});

// For the console, and for tests: what the page computes.
window.explorer = {
  get model() {
    return model;
  },
  given,
  dataOf,
  set,
  statistics,
  sources: () => sources(model),
  pairs: (a, b) => pairs(model, state, a, b),
  initial,
  encode,
  decode,
  state: () => state,
  command,
  profiles: () => profiled({ model, state }),
  situations: () => situations(model),
  ratio: (run, base, measure) => compare(model, run, base, measure),
  reference: (run) => reference(model, state, run.cell, run),
  selected: () => selected(model, state),
  ready: performance.now() - begun,
};
requestAnimationFrame(() => requestAnimationFrame(() => (window.explorer.shown = performance.now())));
