// Pictures of lessons 7 to 9.
import { drawBody, logChart, paths, range, scale, timeFrame, upperEnvelope, valueAt } from "./parts.mjs";
import { arrow, circle, line, picture, polyline, rect, text } from "./svg.mjs";

const overlap = (a, b) => [0, 1].every((axis) => a.lower[axis] <= b.upper[axis] && b.lower[axis] <= a.upper[axis]);
const childrenOf = (nodes, n) => nodes.flatMap((node, c) => (c > 0 && node.parent === n ? [c] : []));

/// The tree of box tests of two hierarchies: {a, b, meets, children}.
function testTree(one, two, a = 0, b = 0) {
  const meets = overlap(one[a], two[b]), node = { a, b, meets, children: [] };
  if (!meets || (one[a].leaf && two[b].leaf)) return node;
  const left = one[a].leaf ? [a] : childrenOf(one, a), right = two[b].leaf ? [b] : childrenOf(two, b);
  node.children = left.flatMap((c) => right.map((d) => testTree(one, two, c, d)));
  return node;
}

export function bvTestTree({ combs: { trace } }) {
  const frame = trace.frames[4], [one, two] = frame.hierarchies.map(({ nodes }) => nodes), root = testTree(one, two);
  let next = 0;
  const lay = (node, depth) => {
    node.y = 110 + 150 * depth;
    node.children.forEach((child) => lay(child, depth + 1));
    node.x = node.children.length ? (node.children[0].x + node.children.at(-1).x) / 2 : next++;
  };
  lay(root, 0);
  const px = scale(-0.5, next - 0.5, 20, 940), half = Math.min(34, 440 / next);
  const draw = (node) => {
    const inList = node.children.length === 0, css = !inList ? "soft" : node.meets ? "b thick fb" : "a";
    return [...node.children.flatMap((child) => [line(px(node.x), node.y + 18, px(child.x), child.y - 18, "soft"), draw(child)]),
      rect(px(node.x) - half, node.y - 18, 2 * half, 36, "paper", 6), rect(px(node.x) - half, node.y - 18, 2 * half, 36, css, 6), text(px(node.x), node.y + 6, `${node.a},${node.b}`, "small", "middle")];
  };
  return picture("The tree of box tests of the two combs; the separation list is its set of leaves",
    text(20, 44, `the combs at ${frame.time} s: pairs of nodes (lower comb, upper comb)`, "bold"), draw(root),
    text(16, 520, "grey: overlaps, descended", "quiet"), text(290, 520, "blue: apart, in the list", "a"), text(545, 520, "orange: overlapping leaves, in the list", "b"));
}

export function combsNow({ combs: { request, trace } }) {
  const px = scale(-0.5, 15.5, 30, 930), py = scale(-0.6, 3.6, 480, 60), t = trace.frames[4].time;
  return picture("Two combs slide past each other", request.scene.bodies.map((body, i) => drawBody(body, t, px, py, ["a fa", "b fb"][i])),
    text(px(3.2), py(-0.35), "lower comb", "a bold"), text(px(7), py(3.25), "upper comb", "b bold"), arrow(px(6.2), py(-0.28), px(7.8), py(-0.28), "a thick"), arrow(px(6.6), py(3.35), px(5.2), py(3.35), "b thick"));
}

export function axesTakeTurns() {
  const tx = scale(0, 1, 150, 900), bar = (y, t0, t1, css, label) => [rect(tx(t0), y, tx(t1) - tx(t0), 44, css, 6), text(140, y + 30, label, "bold", "end")];
  return picture("The overlaps of the axes are intervals of time: intersect them; the maximum of their begins is not enough",
    text(150, 50, "two boxes: when does each axis overlap?", "bold"), bar(90, 0.12, 0.42, "a fa", "x"), bar(170, 0.58, 0.9, "c fc", "y"),
    line(tx(0.58), 80, tx(0.58), 300, "b thick dash"), text(tx(0.58) + 10, 290, "maximum of the begins:", "b"), text(tx(0.58) + 10, 316, "a meeting that never happens", "b bold"),
    text(140, 380, "x and y", "bold", "end"), line(tx(0), 372, tx(1), 372, "soft dash"), text(tx(0.02), 410, "the intersection is empty: no event", "quiet"), arrow(tx(0), 450, tx(1), 450, "axis"), text(tx(1), 484, "time", "quiet", "end"));
}

export function valuesOverL(data, numbers) {
  const ls = [1, 3, 10, 30, 100], series = (key) => ls.map((l) => [l, numbers[`sheet${l}.${key}`].value]);
  return picture("Values written on the sheet over the number of frames per keyframe interval", logChart({ x: 140, y: 60, w: 600, h: 400 }, [0.9, 120], [800, 3000000],
    [{ points: series("refit"), css: "b thick", label: "refit" }, { points: series("kinetic"), css: "a thick", label: "kinetic tree" }, { points: series("events"), css: "c", label: "its events" }],
    { xLabel: "frames per keyframe interval l", yLabel: "values written in the clip", xTicks: ls, yTicks: [1000, 10000, 100000, 1000000] }));
}

export function breakEven(data, numbers) {
  const at = scale(0, Math.log10(10000), 330, 900), log = (v) => at(Math.log10(Math.max(1, v)));
  const rows = [["an event in 2006's tree", 1000 * numbers["cloth.kinetic2006.event_us"].value, "a"], ["an event in today's tree", 1000 * numbers["cloth.kinetic.event_us"].value, "c"],
    ["allowed against the refit of 2006", numbers["cloth.break_even_period_ns"].value, "b"], ["allowed against today's refit", numbers["cloth.break_even_ns"].value, "b"]];
  return picture("What one event costs, and what it may cost", text(40, 50, "nanoseconds per event, tablecloth of 16,200 triangles, l = 10", "bold"),
    [1, 10, 100, 1000, 10000].map((v) => [line(log(v), 90, log(v), 430, "grid"), text(log(v), 460, v.toLocaleString("en"), "small quiet", "middle")]),
    rows.map(([label, value, css], i) => [text(318, 137 + 84 * i, label, "small " + css, "end"), rect(log(1), 112 + 84 * i, log(value) - log(1), 38, css + " f" + css, 4), text(log(value) + 10, 138 + 84 * i, Math.round(value).toLocaleString("en"), "bold")]));
}

export function chord() {
  const list = [[5, 2], [3, 4.2], [1, 6]], corners = upperEnvelope(list), { tx, vy, parts } = timeFrame({ x: 90, y: 50, w: 780, h: 400 }, [0.5, 6.5]);
  return picture("The maximum of linear functions is convex: it lies below its chord", parts, list.map(([a, b]) => line(tx(0), vy(a), tx(1), vy(b), "soft")),
    polyline(corners.map(([t, v]) => [tx(t), vy(v)]), "a thick"), line(tx(0), vy(corners[0][1]), tx(1), vy(corners.at(-1)[1]), "b thick dash"),
    corners.slice(1, -1).map(([t, v]) => circle(tx(t), vy(v), 8, "a solid")), [0, 1].map((t) => circle(tx(t), vy(t === 0 ? corners[0][1] : corners.at(-1)[1]), 9, "b solid")),
    text(tx(0.36), vy(5.75), "chord: contains, no event", "b bold", "end"), text(tx(0.5), vy(2.75), "tight bound: an event at every corner", "a bold", "middle"));
}

export function threeInOne({ tie: { request } }) {
  const [body] = request.scene.bodies, xs = paths(body, 0), { tx, vy, parts } = timeFrame({ x: 90, y: 40, w: 780, h: 410 }, range(xs.flat()));
  return picture("Three lines meet in one point; the middle one leads for no time", parts, xs.map((x, i) => [line(tx(0), vy(x[0]), tx(1), vy(x[1]), ["a", "b", "c"][i] + " thick"), text(tx(1) + 8, vy(x[1]) + 6, i, ["a", "b", "c"][i])]),
    circle(tx(0.5), vy(2), 12, "paper ink thick"), text(tx(0.5), vy(2) - 34, "1/2 s: all equal", "bold", "middle"), text(tx(0.04), vy(valueAt(xs[0], body.times, 0)) - 14, "leads before", "a"), text(tx(0.78), vy(3.6), "leads after", "c", "end"));
}

export function rounding() {
  const x = 90, w = 780, { tx, vy, parts } = timeFrame({ x, y: 50, w, h: 390 }, [0, 6], { label: "value" });
  // Dots at their heights; two dots with one value stand side by side, for a tie has no order.
  const exact = [[0.7, 4.6], [2.3, 3.8]], steps = 12, at = (i, k) => Math.round(exact[i][0] + ((exact[i][1] - exact[i][0]) * k) / steps);
  return picture("Two exact plans and their rounded positions at frames: rounding never reverses an order, but it makes ties", parts,
    [0, 1, 2, 3, 4, 5, 6].map((v) => line(x, vy(v), x + w, vy(v), "grid")),
    exact.map(([a, b], i) => [line(tx(0), vy(a), tx(1), vy(b), ["a", "b"][i] + " thick"),
      ...Array.from({ length: steps + 1 }, (_, k) => circle(tx(k / steps) + (at(0, k) === at(1, k) ? (i ? 7 : -7) : 0), vy(at(i, k)), 6, ["a", "b"][i] + " solid"))]),
    text(tx(0.02), vy(5.3), "lines: exact plans (truth A)", "bold"), text(tx(0.02), vy(4.75), "dots: rounded to the grid (truth B)", "quiet"));
}

export function between() {
  const at = scale(0, 8, 80, 880);
  return picture("Two events whose exact times lie between the same two doubles", text(80, 90, "the doubles near one instant", "bold"), line(60, 260, 900, 260, "axis"),
    [0, 2, 4, 6, 8].map((v, i) => [line(at(v), 236, at(v), 284, "ink thick"), text(at(v), 318, ["t − 2u", "t − u", "t", "t + u", "t + 2u"][i], "small quiet", "middle")]),
    circle(at(4.5), 260, 10, "a solid"), circle(at(5.2), 260, 10, "b solid"), text(at(4.5) - 6, 225, "event 1", "a", "end"), text(at(5.2) + 6, 225, "event 2", "b"),
    text(80, 400, "Rounded, both events happen at t or at t + u: their order is lost.", ""), text(80, 440, "Compared exactly, as crossings of stored lines, event 1 comes first.", "bold"));
}
