// What the lessons say about the paper: quotations stand in it, its algorithm 3 does what lesson 2 says, the bounds of lesson 5 hold
// on small cases, and the picture of rounding shows what its caption says.
import assert from "node:assert/strict";
import { existsSync, readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { test } from "node:test";
import { rounding } from "../../analysis/lessons/figures/lessons7to9.mjs";
import { lessons } from "../../analysis/lessons/renderer/build.mjs";

const root = dirname(dirname(dirname(fileURLToPath(import.meta.url))));
const paper = process.env.KBVH_PAPER ?? join(root, "../shared/paper/zachmann-weller-2006.txt");

/// Quotations of the paper in a text: what stands in quotation marks in a paragraph that names or cites it, four words or more.
export function quotations(text) {
  return text.split(/\n\s*\n/).filter((paragraph) => /\bpaper\b|\[@zachmann2006/i.test(paragraph))
    .flatMap((paragraph) => [...paragraph.replace(/\s+/g, " ").matchAll(/"([^"]+)"/g)].map(([, quote]) => quote))
    .filter((quote) => quote.split(" ").length >= 4);
}

/// Whether a quotation stands in a text; what it leaves out (…) is less than 200 letters long.
export function quotes(text, quote) {
  const plain = (words) => words.toLowerCase().replace(/[*_$]/g, "").replace(/\s+/g, " ").trim();
  const pattern = plain(quote).split("…").map((part) => part.trim().replace(/[.*+?^${}()|[\]\\]/g, "\\$&")).join("[^]{0,200}?");
  return new RegExp(pattern).test(plain(text));
}

test("every quotation of the paper stands in it", existsSync(paper) ? {} : { skip: "the paper's text is not here (KBVH_PAPER)" }, () => {
  const text = readFileSync(paper, "utf8");
  const all = lessons().flatMap(({ text: lesson, file }) => quotations(lesson).map((quote) => ({ file, quote })));
  assert.deepEqual(all.filter(({ quote }) => !quotes(text, quote)), []);
  assert.ok(all.length >= 6, `${all.length} quotations`);
  // As it stood: the begin of a sentence of the abstract, and the end of one of the introduction.
  assert.ok(!quotes(text, "a lower bound … for every BVH updating strategy"));
});

// ---- Lesson 2: algorithm 3, with the positions of P and Q at the frames l*f in lists.

/// The loop as it is printed, from the time t in the segment f, at most `most` rounds. `left` is what its condition has on the left: "t", or
/// "bar" for the computed time.
function algorithm3(P, Q, l, { t, f }, left, most = 1000) {
  const at = (path) => path[f] + ((path[f + 1] - path[f]) * (t - l * f)) / l, gap = at(Q) - at(P);
  let bar = l * (f + 1), rounds = 0;
  for (; (left === "bar" ? bar : t) > l * f && rounds < most; ++rounds, ++f) {
    const p = (P[f + 1] - P[f]) / l, q = (Q[f + 1] - Q[f]) / l;
    bar = p > q ? t + gap / (p - q) : Infinity; // no crossing, also behind the last keyframe
  }
  return { bar, rounds };
}

test("algorithm 3 as printed never looks at the next segment", () => {
  const P = [0, 0, 10], Q = [5, 5, 5]; // P overtakes Q in the second segment
  assert.equal(algorithm3(P, Q, 10, { t: 3, f: 0 }, "t").rounds, 1);
  assert.deepEqual(algorithm3(P, Q, 10, { t: 10, f: 1 }, "t"), { bar: 20, rounds: 0 }, "the end of the segment, as if it were an event");
});

test("algorithm 3 with the computed time walks forwards, and does not end for vertices that never cross", () => {
  assert.equal(algorithm3([0, 0, 10], [5, 5, 5], 10, { t: 3, f: 0 }, "bar").rounds, 2);
  assert.equal(algorithm3([0, 0, 0], [5, 5, 5], 10, { t: 3, f: 0 }, "bar", 500).rounds, 500);
});

// ---- Lesson 5: Davenport–Schinzel sequences by brute force.

/// Whether a sequence has no two equal neighbours and no alternation of `order` + 2 names of two kinds.
function isSequence(names, order) {
  if (names.some((name, i) => i > 0 && name === names[i - 1])) return false;
  const kinds = [...new Set(names)];
  return kinds.every((a) => kinds.every((b) => {
    if (a === b) return true;
    let length = 0, wanted = a;
    for (const name of names) if (name === wanted) ++length, (wanted = wanted === a ? b : a);
    return length < order + 2;
  }));
}

/// The longest sequence over n names, by search; new names come in their order.
function longest(n, order) {
  let most = 0;
  const grow = (names, used) => {
    most = Math.max(most, names.length);
    for (let next = 0; next < Math.min(n, used + 1); ++next) {
      names.push(next);
      if (isSequence(names, order)) grow(names, Math.max(used, next + 1));
      names.pop();
    }
  };
  grow([], 0);
  return most;
}

test("lambda is superadditive where the paper's step fails", () => {
  const lambda = (n, s) => longest(n, s);
  assert.deepEqual([1, 2, 3, 4].map((n) => lambda(n, 1)), [1, 2, 3, 4]);
  assert.deepEqual([1, 2, 3, 4].map((n) => lambda(n, 2)), [1, 3, 5, 7]);
  for (const s of [1, 2, 3])
    for (const [a, b] of [[1, 1], [1, 2], [2, 2], [1, 3]]) assert.ok(lambda(a, s) + lambda(b, s) <= lambda(a + b, s), `s = ${s}, ${a} + ${b}`);
  assert.ok(2 * lambda(Math.ceil(3 / 2), 1) > lambda(3, 1), "the step of the paper holds for n = 3");
});

/// The names along the upper envelope of segments {from, to, a, b}, of value a + b t, sampled between all ends and crossings.
function envelope(segments) {
  const cuts = segments.flatMap(({ from, to }) => [from, to]);
  segments.forEach((p, i) => segments.slice(0, i).forEach((q) => p.b !== q.b && cuts.push((q.a - p.a) / (p.b - q.b))));
  const times = [...new Set(cuts)].sort((x, y) => x - y), names = [];
  for (let k = 0; k + 1 < times.length; ++k) {
    const t = (times[k] + times[k + 1]) / 2, alive = segments.flatMap(({ from, to, a, b }, i) => (from < t && t < to ? [[a + b * t, i]] : []));
    if (alive.length === 0) continue;
    const [, name] = alive.reduce((best, one) => (one[0] > best[0] ? one : best));
    if (names.at(-1) !== name) names.push(name);
  }
  return names;
}

test("envelopes of segments are sequences of order 3, and order 2 does not suffice", () => {
  let state = 7, returns = 0;
  const random = (n) => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0, (state >>> 8) % n);
  for (let round = 0; round < 3000; ++round) {
    const segments = Array.from({ length: 2 + random(5) }, () => {
      const from = random(20);
      return { from, to: from + 1 + random(20), a: random(40), b: random(9) - 4 };
    });
    const names = envelope(segments);
    assert.ok(isSequence(names, 3), JSON.stringify({ segments, names }));
    returns += !isSequence(names, 1);
  }
  assert.ok(returns > 100, "no segment came back");
  // a b a b: two segments that cross once, and end one after the other.
  const four = [{ from: 0, to: 7, a: 0, b: 1 }, { from: 1, to: 10, a: 4, b: 0 }];
  assert.deepEqual(envelope(four), [0, 1, 0, 1]);
  assert.ok(!isSequence(envelope(four), 2));
});

// ---- Lesson 9: the picture of rounding.

test("dots of the picture of rounding never reverse the order of the lines", () => {
  const svg = rounding(), lines = [...svg.matchAll(/<line x1="([\d.]+)" y1="([\d.]+)" x2="([\d.]+)" y2="([\d.]+)" class="(a|b) thick"/g)].map(([, ...m]) => [...m.slice(0, 4).map(Number), m[4]]);
  const dots = [...svg.matchAll(/<circle cx="([\d.]+)" cy="([\d.]+)" r="6" class="(a|b) solid"/g)].map(([, x, y, kind]) => ({ x: Number(x), y: Number(y), kind }));
  assert.equal(lines.length, 2);
  const [a, b] = ["a", "b"].map((kind) => dots.filter((dot) => dot.kind === kind)), frames = a.length;
  assert.ok(frames > 5 && b.length === frames);
  let ties = 0;
  for (let k = 0; k < frames; ++k) {
    const exact = lines.map(([, y1, , y2]) => y1 + ((y2 - y1) * k) / (frames - 1)), order = exact[0] - exact[1], shown = a[k].y - b[k].y;
    assert.ok(order * shown >= -1e-9, `frame ${k}: the dots are the other way round`);
    ties += shown === 0;
  }
  assert.ok(ties >= 3, "no tie is shown");
});
