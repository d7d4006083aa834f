// All runs of the selection as one table that can be ordered and downloaded.
import { make, symbol } from "../dom.js";
import { MEASURES, compare, ratioText, reference, referenceName, selected, value } from "../model.js";
import { bytes, count, milliseconds, percent, plural, significant } from "../words.js";

const FIRST = 150; // rows before "show all"

export function runs({ model, state, set, choose }) {
  const measure = MEASURES[state.measure];
  const columns = [
    { name: "strategy", of: (run) => run.contestant.label, text: (v) => v },
    { name: "scene", of: (run) => run.cell.title, text: (v) => v },
    {
      name: `times as fast as ${referenceName(model, state)}`,
      number: true,
      of: (run) => ratioOf(model, state, run)?.middle ?? null,
      text: (_, run) => ratioText(ratioOf(model, state, run)),
    },
    ...["motion", "update", "query"].map((phase) => ({
      name: `${phase}, ms`,
      number: true,
      of: phase === "motion" ? (run) => difference(model, run) : (run) => value(model, run, phase),
      text: milliseconds,
    })),
    {
      name: `${measure.name}${measure.unit === "ms" ? ", ms" : ""}`,
      number: true,
      measured: true,
      of: (run) => value(model, run, state.measure),
      text: measure.format,
    },
    { name: "worst frame, ms", number: true, of: (run) => run.worst, text: milliseconds },
    { name: "missed", number: true, of: (run) => run.missed, text: count },
    { name: "extra", number: true, of: (run) => run.extra, text: count },
    { name: "protrusion", number: true, of: (run) => run.protrusion, text: (v) => significant(v, 2) },
    { name: "looseness", number: true, of: (run) => run.looseness, text: (v) => percent(v) },
    { name: "memory", number: true, of: (run) => run.bytes, text: bytes },
  ];
  const [by, down] = [Number(state.sort.replace(/\D/g, "") || -1), state.sort.startsWith("d")];
  const listed = selected(model, state);
  const column = columns[by];
  if (column) {
    const rank = (run) => column.of(run) ?? (column.number ? Infinity : "");
    listed.sort((a, b) => (rank(a) < rank(b) ? -1 : rank(a) > rank(b) ? 1 : 0) * (down ? -1 : 1));
  }
  const row = (run) =>
    make(
      "tr",
      { class: run.key === state.point ? "chosen" : null },
      columns.map(({ of, text, number }, i) => {
        const words = text(of(run), run);
        if (i) return make("td", { class: number ? "n" : null, text: run.refused && columns[i].measured ? "no time" : words });
        return make(
          "th",
          { scope: "row" },
          make(
            "button",
            { type: "button", class: "name", click: (event) => choose(run, event.currentTarget) },
            symbol(run.contestant),
            make("span", { text: words }),
          ),
        );
      }),
    );
  const body = make("tbody", {}, listed.slice(0, FIRST).map(row));
  const more =
    listed.length > FIRST &&
    make("button", {
      type: "button",
      text: `Show all ${listed.length}`,
      click: () => {
        body.append(...listed.slice(FIRST).map(row));
        more.remove();
      },
    });
  const head = columns.map(({ name, number }, i) =>
    make(
      "th",
      { scope: "col", class: number ? "n" : null, "aria-sort": by === i ? (down ? "descending" : "ascending") : null },
      make("button", {
        type: "button",
        class: "name",
        text: name + (by === i ? (down ? " ↓" : " ↑") : ""),
        click: () => set({ sort: by === i && !down ? `d${i}` : `a${i}` }),
      }),
    ),
  );
  return [
    make(
      "div",
      { class: "toolbar" },
      make("p", { class: "lead", text: `${plural(listed.length, "run")}. A name shows where its numbers come from.` }),
      make("button", { type: "button", text: "Download as CSV", click: () => download(columns, listed) }),
    ),
    make(
      "div",
      { class: "scroll", tabindex: 0 },
      make("table", { class: "runs" }, make("thead", {}, make("tr", {}, head)), body),
    ),
    more,
  ];
}

function difference(model, run) {
  const [all, rest] = ["with_motion", "without_motion"].map((scope) => value(model, run, scope));
  return all === null ? null : Math.max(0, all - rest);
}

function ratioOf(model, state, run) {
  return compare(model, run, reference(model, state, run.cell, run), state.measure);
}

function download(columns, listed) {
  const quoted = (text) => `"${String(text ?? "").replaceAll('"', '""')}"`;
  const names = [
    "id",
    "settings",
    "scene",
    "hash",
    "primitives",
    "scalar",
    "l",
    "commit",
    "machine",
    ...columns.slice(2).map((c) => c.name),
  ];
  const lines = listed.map((run) => [
    run.contestant.id,
    run.contestant.key,
    run.cell.name,
    run.cell.hash,
    run.cell.primitives,
    run.cell.scalar,
    run.cell.l,
    run.cell.commit.commit,
    run.cell.machine.label,
    ...columns.slice(2).map((c) => c.of(run)),
  ]);
  const text = [names, ...lines].map((line) => line.map(quoted).join(",")).join("\n");
  const link = make("a", {
    href: URL.createObjectURL(new Blob([text], { type: "text/csv" })),
    download: "results.csv",
  });
  link.click();
  URL.revokeObjectURL(link.href);
}
