// Numbers in the texts come from the build: no key is missing, none is typed by hand.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { lessons } from "../../analysis/lessons/renderer/build.mjs";
import { fill, format, parse } from "../../analysis/lessons/renderer/text.mjs";

const numbers = JSON.parse(readFileSync(process.env.KBVH_LESSONS + "/numbers.json", "utf8"));

/// Numbers above ten, in digits or words, and numbers with decimals, that stand in the prose of a text: outside of code,
/// mathematics, citations, links, the first lines of blocks and the expressions before reasons.
export function typedNumbers(text) {
  const prose = text.replace(/```[\s\S]*?```/g, " ").replace(/\$\$[\s\S]*?\$\$/g, " ").replace(/\$[^$\n]+\$/g, " ").replace(/`[^`]*`/g, " ")
    .replace(/\{\{[^}]*\}\}/g, " ").replace(/\[@[^\]]*\]/g, " ").replace(/\]\([^)]*\)/g, "]").replace(/^:{3,}.*$/gm, " ").replace(/^- \[[^\]]*\]/gm, " ");
  const words = /\b(eleven|twelve|thirteen|fourteen|fifteen|sixteen|seventeen|eighteen|nineteen|(?:twen|thir|for|fif|six|seven|eigh|nine)ty)\b/gi;
  return [...(prose.match(/(?<![\w.,])\d[\d,.]*\d(?!\w)/g) ?? []), ...(prose.match(words) ?? [])];
}

for (const { text, meta, file } of lessons())
  test(`${file}: every number of the text is made by the build`, () => {
    const used = new Set();
    fill(text, numbers, file, used);
    assert.ok(used.size >= 3, `only ${used.size} numbers`);
    const allowed = Object.keys(meta.typed ?? {});
    assert.deepEqual(typedNumbers(text).filter((number) => !allowed.includes(number)), []);
    for (const number of allowed) assert.ok(typedNumbers(text).includes(number), `'${number}' is allowed, and not in the text`);
  });

test("a number typed by hand is found", () => {
  assert.deepEqual(typedNumbers("We saw 1,234 events at {{ a.b }} nodes, 3.5 each, in `12` cases of $n = 44$ [@x2006], and 5 more, or sixteen."), ["1,234", "3.5", "sixteen"]);
});

test("a missing key is an error that names key and file", () => {
  assert.throws(() => fill("{{ no.such_key }}", numbers, "x.md"), /x\.md.*no\.such_key/);
});

test("numbers have a source and are finite", () => {
  for (const [key, { value, source }] of Object.entries(numbers)) {
    assert.ok(source, key);
    assert.ok(typeof value === "string" || Number.isFinite(value), `${key} is ${value}`);
  }
});

test("formats", () => {
  assert.equal(format(1234.5678, "1"), "1,234.6");
  assert.equal(format(3, "Word"), "Three");
  assert.equal(format(0.0123, "%"), "1.2\u00a0%");
});

test("blocks that are not closed, or closed twice, are errors", () => {
  assert.throws(() => parse("---\na: 1\n---\n::: task\n", "x.md"), /x\.md: the block '::: task' is not closed/);
  assert.throws(() => parse("---\na: 1\n---\n:::\n", "x.md"), /line 1 closes a block/);
});

// Identities that the texts state about their numbers.
test("the numbers fit each other", () => {
  const n = (key) => numbers[key].value;
  assert.equal(n("ribbon.bounds"), 6 * (2 * n("ribbon.triangles") - 1));
  assert.equal(n("ribbon.values"), n("ribbon.bounds") * n("ribbon.frames"));
  assert.equal(n("dart.keyframe_pairs"), 0);
  assert.equal(n("dart.hits"), 2);
  assert.deepEqual([n("race4.swaps"), n("race4.events"), n("race4.upper_events"), n("race4.lead_changes"), n("race4.discarded")], [5, 4, 2, 1, 1]);
  assert.ok(2 * n("race.upper_events") < n("race.swaps") && n("race.upper_events") !== n("race.lead_changes"));
  assert.ok(n("flag.most_touched") === 3 && n("flag.nodes") === 7);
  assert.ok(n("shoal.values") < 100 && n("shoal.values") < n("shoal.refit_values"));
  assert.deepEqual([n("tangents.values"), n("tangents.refit"), n("tangents.upper")], [16, 6, 15]);
  for (const size of [4, 8, 16, 32, 64]) {
    const bound = size * Math.log2(size) - size + 1;
    assert.equal(n(`relay${size}.bound`), bound);
    assert.equal(n(`relay${size}.sorted_values`), bound);
    assert.equal(n(`relay${size}.mixed_values`), bound);
    assert.equal(n(`relay${size}.sorted_events`), size - 1);
    assert.equal(n(`relay${size}.mixed_events`), bound);
  }
  assert.ok(n("drape.loose_start") < 1.01 && n("drape.loose_end") > 4 && n("drape.boxtree_events") < n("drape.aabb_events"));
  assert.ok(n("combs.events") > 20 && n("combs.events") < 40 && n("combs.bound_change_events") === 0);
  for (const l of [3, 10, 30, 100]) {
    assert.equal(n(`sheet${l}.kinetic`), n("sheet1.kinetic"));
    assert.equal(n(`sheet${l}.refit`), l * n("sheet1.refit"));
  }
  assert.ok(n("carried.events") === 0 && n("carried.double_events") === 0 && n("carried.far_events") > 2);
  assert.ok(n("cloth.time_ratio_2006") > 0.33 && n("cloth.time_ratio_2006") < 0.4 && n("cloth.time_ratio_best") > 1);
  assert.equal(n("theory.search.adversarial.most"), n("theory.search.leaves") + 1);
  assert.equal(n("theory.over_lambda"), 0);
  // Said in words: "none of them", "each event", "nothing was updated".
  for (const key of ["silent", "linear_updates", "list.differences", "plan_moved_at_keyframes", "over_lambda"]) assert.equal(n("reference." + key), 0, key);
  assert.equal(n("reference.translated_far"), n("reference.translated_ties"));
  assert.ok(n("reference.loose_kinetic_values") < n("reference.linear_values") && n("reference.linear_values") < n("reference.loose_bottom_up_values"));
  assert.equal(n("theory.net"), n("theory.breakpoints"));
});
