// Pictures of lessons 4 to 6.
import { drawBody, drawBoxes, drawTree, logChart, paths, range, scale, timeFrame, treePlaces, upperEnvelope } from "./parts.mjs";
import { circle, line, picture, polyline, rect, text } from "./svg.mjs";

export function sixCertificates() {
  const nodes = [{ parent: 0 }, { parent: 0 }, { parent: 0 }];
  const { places } = treePlaces(nodes, { x: 120, y: 130, w: 720, h: 240 });
  return picture("One node and its two children: the certificate of a side compares the realisers of the children",
    drawTree(nodes, { x: 120, y: 130, w: 720, h: 240 }, { label: (n) => ["r(v) = q", "r(left) = p", "r(right) = q"][n], css: (n) => ["a thick", "c", "a"][n], size: 70 }),
    text(480, 70, "upper side in x of node v", "bold", "middle"), text(places[0][0], 270, "certificate: x of p ≤ x of q", "b bold", "middle"),
    text(places[1][0], 440, "all x below ≤ x of p", "c", "middle"), text(places[2][0], 440, "all x below ≤ x of q", "a", "middle"),
    text(480, 505, "so all x below v ≤ x of q, which lies below v: the bound is tight", "quiet", "middle"));
}

export function climb({ "exercise.climber": climber, flag: { trace } }) {
  const chosen = (climber ?? { trace }).trace, { nodes } = chosen.start[0];
  const step = chosen.steps.reduce((best, one) => (one.touched.length > best.touched.length ? one : best));
  const touched = step.touched.map(({ node }) => node), last = touched.at(-1);
  const names = ["lower x", "upper x", "lower y", "upper y"];
  return picture("One event climbs: the old realiser is replaced at every node that it realises",
    text(40, 48, `${names[step.event.side]}, t = ${step.event.time.toFixed(3)} s: vertex ${step.event.loser} overtakes vertex ${step.event.winner}`, "bold"),
    drawTree(nodes, { x: 60, y: 120, w: 840, h: 270 }, { label: (n) => (touched.includes(n) ? `${step.event.winner} → ${step.event.loser}` : `node ${n}`),
      css: (n) => (touched.includes(n) ? "b thick" : "soft"), size: 44, edge: (n) => (touched.includes(n) && touched.includes(nodes[n].parent) ? "b thick" : "soft") }),
    text(40, 470, `the event begins at node ${step.event.node}, changes ${touched.length} nodes, and ends at node ${last}`, "quiet"),
    text(40, 505, "each changed node gets a new certificate; a parent that keeps its realiser gets one, too", "quiet"));
}

export function tangentEnvelope({ "tangents.kinetic_aabb": { request } }) {
  const [body] = request.scene.bodies, xs = paths(body, 0), corners = upperEnvelope(xs);
  const { tx, vy, parts } = timeFrame({ x: 90, y: 40, w: 800, h: 410 }, range(xs.flat(), 0.03));
  return picture("Sixteen vertices, one frame: the upper side changes fifteen times before the frame is drawn", parts,
    xs.map((x) => line(tx(0), vy(x[0]), tx(1), vy(x[1]), "soft thin")), polyline(corners.map(([t, v]) => [tx(t), vy(v)]), "a thick"),
    corners.slice(1, -1).map(([t, v]) => circle(tx(t), vy(v), 6, "b solid")),
    text(tx(0.03), vy(240), `${corners.length - 2} events on one side`, "b bold"), text(tx(0.03), vy(205), "one frame interval", "quiet"));
}

export function mergeEnvelopes() {
  const left = [[6, 2], [3, 6], [1, 9]], right = [[7, 1], [4.2, 5.8], [2, 7.6]];
  const frame = { x: 90, y: 50, w: 780, h: 400 }, { tx, vy, parts } = timeFrame(frame, [2.5, 9.3]);
  const [one, two, all] = [left, right, [...left, ...right]].map(upperEnvelope);
  const own = (corners) => corners.slice(1, -1), key = ([t]) => t.toFixed(6);
  const children = new Set([...own(one), ...own(two)].map(key));
  return picture("The envelope of a node is the upper one of its children's envelopes", parts,
    polyline(one.map(([t, v]) => [tx(t), vy(v)]), "a thick"), polyline(two.map(([t, v]) => [tx(t), vy(v)]), "c thick"),
    polyline(all.map(([t, v]) => [tx(t), vy(v) - 5]), "ink dash"),
    own(one).map(([t, v]) => circle(tx(t), vy(v), 8, "a solid")), own(two).map(([t, v]) => circle(tx(t), vy(v), 8, "c solid")),
    own(all).filter((corner) => !children.has(key(corner))).map(([t, v]) => circle(tx(t), vy(v), 11, "b solid")),
    text(tx(0.04), vy(3.0), "left child", "a bold"), text(tx(0.22), vy(3.0), "right child", "c bold"), text(tx(0.42), vy(3.0), "orange: a tree event of the parent", "b bold"));
}

export function relayOrders({ "relay8.sorted": sorted, "relay8.mixed": mixed }) {
  const half = ({ trace }, title, i) => {
    const { nodes, primitives } = trace.start[0];
    const events = nodes.map((_, n) => trace.steps.filter(({ event }) => event.side === 1 && event.node === n).length);
    return [text(240 + 480 * i, 50, title, "bold", "middle"), drawTree(nodes, { x: 10 + 480 * i, y: 110, w: 460, h: 290 }, {
      label: (n) => (nodes[n].leaf ? primitives[nodes[n].first] : events[n] || "·"), css: (n) => (nodes[n].leaf ? "soft" : events[n] ? "b thick" : "a"), size: 20 }),
      text(240 + 480 * i, 470, `${events.reduce((a, b) => a + b)} events of the upper side`, "b", "middle")];
  };
  return picture("The same eight lines under two trees; the number in a node counts the events that begin there",
    half(sorted, "neighbours side by side", 0), half(mixed, "even left, odd right", 1), text(480, 515, "orange: events that begin at the node; last row: runners", "small quiet", "middle"));
}

export function growth(data, numbers) {
  const sizes = [8, 16, 32, 64, 128, 256], series = (key) => sizes.map((n) => [n, numbers[`wander${n}.${key}`].value]);
  return picture("Events, changed bounds and their bound for clouds of 8 to 256 wandering points", logChart({ x: 120, y: 60, w: 620, h: 400 }, [7, 300], [10, 10000],
    [{ points: series("bound"), css: "d dash", label: "bound" }, { points: series("values"), css: "b", label: "changes" }, { points: series("events"), css: "a", label: "events", dy: 22 },
      { points: sizes.map((n) => [n, (n * Math.log2(n)) / 2]), css: "soft dash", label: "½ n log₂ n", dy: -22 }],
    { xLabel: "points n", yLabel: "in one segment", xTicks: sizes, yTicks: [10, 100, 1000, 10000] }));
}

export function twoPlanes() {
  const px = (x) => 60 + 40 * x, py = (y) => 420 - 40 * y, right = (x) => px(x) + 470;
  const points = [[0.5, 1], [1.5, 5.5], [2.5, 3], [3.6, 6.5], [5, 0.6], [6, 4.5], [7, 2], [8, 6]];
  const dots = (at) => points.map(([x, y]) => circle(at(x), py(y), 6, "ink solid"));
  const box = (at, x0, y0, x1, y1, css) => rect(at(x0), py(y1), at(x1) - at(x0), py(y0) - py(y1), css);
  return picture("An AABB tree stores four sides of each box in the plane, a BoxTree two planes; its boxes inherit the rest",
    text(230, 60, "AABB tree", "bold", "middle"), text(700, 60, "BoxTree", "bold", "middle"),
    box(px, 0.5, 0.6, 8, 6.5, "soft dash"), box(px, 0.5, 1, 3.6, 6.5, "a thick"), box(px, 5, 0.6, 8, 6, "b thick"), dots(px),
    box(right, 0.5, 0.6, 8, 6.5, "soft dash"), box(right, 0.5, 0.6, 3.6, 6.5, "fa bare"), box(right, 5, 0.6, 8, 6.5, "fb bare"),
    line(right(3.6), py(0.6), right(3.6), py(6.5), "a thick"), line(right(5), py(0.6), right(5), py(6.5), "b thick"), dots(right),
    text(230, 490, "six sides per node in space", "quiet", "middle"), text(700, 490, "two planes per node: max left, min right", "quiet", "middle"));
}

export function drapeLoose({ "drape.kinetic_boxtree": loose, "drape.kinetic_aabb": tight }, numbers) {
  const [body] = loose.request.scene.bodies, half = ({ trace }, title, i, css) => {
    const px = scale(-0.5, 9.5, 20 + 480 * i, 460 + 480 * i), py = scale(-0.4, 9.2, 470, 80), { nodes } = trace.end[0];
    const depth = nodes.reduce((list, node, n) => [...list, n === 0 ? 0 : list[node.parent] + 1], []);
    return [text(240 + 480 * i, 50, title, "bold", "middle"), drawBoxes(nodes, px, py, (n) => (depth[n] === 3 ? css : null)), drawBody(body, 2, px, py, "ink thin")];
  };
  return picture("The cloth that started flat, at the end, with the boxes of level 3 of both trees", half(tight, "AABB tree: tight", 0, "a fa"), half(loose, "BoxTree: planes chosen when flat", 1, "b fb"),
    text(480, 515, `at the end the boxes of the BoxTree have ${numbers["drape.loose_end"].value.toFixed(1)} times the perimeter of tight ones`, "quiet", "middle"));
}

export function searchCost(data, numbers) {
  const rows = [["one axis", "one", "a"], ["axes by area", "mixed", "c"], ["root x, all else y", "adversarial", "b"]];
  const at = (v) => scale(0, Math.log10(10000), 260, 860)(Math.log10(Math.max(1, v)));
  const all = numbers["theory.search.nodes"].value;
  return picture("Nodes that one certificate search visits in BoxTrees, at most and on average",
    text(40, 50, `BoxTrees of ${numbers["theory.search.leaves"].value.toLocaleString("en")} leaves: nodes visited by one search`, "bold"),
    [1, 10, 100, 1000, 10000].map((v) => [line(at(v), 90, at(v), 430, "grid"), text(at(v), 460, v.toLocaleString("en"), "small quiet", "middle")]),
    line(at(all), 90, at(all), 430, "d dash"), text(at(all) + 6, 84, "all nodes", "small d", "end"),
    rows.map(([label, key, css], i) => {
      const most = numbers[`theory.search.${key}.most`].value, mean = numbers[`theory.search.${key}.mean`].value, y = 150 + 110 * i;
      return [text(245, y + 7, label, css, "end"), line(at(1), y, at(most), y, css + " thick"), circle(at(most), y, 10, css + " solid"), circle(at(mean), y, 8, "paper " + css),
        text(at(most), y - 18, `most ${most.toLocaleString("en")}`, "small " + css, "end"), text(at(mean), y + 34, `mean ${mean.toFixed(1)}`, "small quiet", "middle")];
    }));
}
