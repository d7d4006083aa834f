// Pictures of lessons 1 to 3.
import { crossings, drawBody, drawBoxes, drawTree, paths, range, scale, timeFrame, treePlaces, upperEnvelope, valueAt } from "./parts.mjs";
import { arrow, circle, line, picture, polyline, rect, text } from "./svg.mjs";

const depthOf = (nodes) => nodes.reduce((depth, node, n) => [...depth, n === 0 ? 0 : depth[node.parent] + 1], []);

export function ribbonBoxes({ "ribbon.refit": { request, trace } }) {
  const frame = trace.frames.at(-1), [ribbon, table] = frame.hierarchies, depth = depthOf(ribbon.nodes);
  const px = scale(-0.5, 8.5, 40, 920), py = scale(-0.1, 4.4, 520, 70);
  return picture("The ribbon on the table at the last frame, with the boxes of its tree on three levels",
    drawBody(request.scene.bodies[1], 2, px, py, "soft fd"), drawBody(request.scene.bodies[0], 2, px, py, "ink thin"),
    drawBoxes(table.nodes, px, py, (n) => (n === 0 ? "d dash" : null)),
    drawBoxes(ribbon.nodes, px, py, (n) => [, , "c", "b"][depth[n]] ?? (depth[n] === 0 ? "a thick" : null)),
    text(60, 44, "root", "a bold"), text(150, 44, "level 2", "c bold"), text(270, 44, "level 3", "b bold"), text(390, 44, "table", "d bold"));
}

export function refitTree({ race4: { request, trace } }) {
  const [body] = request.scene.bodies, xs = paths(body, 0), nodes = trace.start[0].nodes;
  const interval = (t) => (n) => {
    const { lower, upper } = trace.frames[t === 0 ? 0 : trace.frames.length - 1].hierarchies[0].nodes[n];
    return `[${lower[0]}, ${upper[0]}]`;
  };
  return picture("A tree of seven nodes at the begin and at the end: the same tree, new intervals",
    text(40, 44, "t = 0 s", "big"), drawTree(nodes, { x: 20, y: 90, w: 900, h: 130 }, { label: interval(0), css: () => "a" }),
    text(40, 304, "t = 1 s", "big"), drawTree(nodes, { x: 20, y: 345, w: 900, h: 130 }, { label: interval(1), css: () => "b" }),
    text(940, 44, `${xs.length} points, ${nodes.length} intervals`, "quiet", "end"), text(940, 304, "every interval is written again, children first", "quiet", "end"));
}

export function flightPlan() {
  const times = [0, 1, 2, 3], plans = [[1, 3, 2.5, 4], [3.5, 2, 3, 1]];
  const { tx, vy, parts } = timeFrame({ x: 90, y: 50, w: 780, h: 380 }, [0, 5], { times });
  const frames = times.slice(0, -1).flatMap((k) => [0.25, 0.5, 0.75].map((f) => k + f));
  return picture("The flight plans of two vertices over three segments; keyframes are dots, frames are short strokes", parts,
    plans.map((plan, i) => [polyline(plan.map((v, k) => [tx(k), vy(v)]), ["a", "b"][i] + " thick"), ...plan.map((v, k) => circle(tx(k), vy(v), 8, ["a", "b"][i] + " solid"))]),
    frames.map((t) => plans.map((plan, i) => line(tx(t), vy(valueAt(plan, times, t)) - 9, tx(t), vy(valueAt(plan, times, t)) + 9, ["a", "b"][i]))),
    text(tx(0.5), 40, "segment", "quiet", "middle"), text(tx(1.5), 40, "segment", "quiet", "middle"), text(tx(2.5), 40, "segment", "quiet", "middle"),
    text(tx(2) + 4, vy(2.5) + 34, "keyframe", "a", "middle"), text(tx(2.75) + 16, vy(1.5) - 4, "frame", "b"));
}

export function dartFlight({ dart: { request, trace } }) {
  const px = scale(-0.5, 7.5, 40, 920), py = scale(-0.2, 5, 500, 40), [dart, wall] = request.scene.bodies;
  const hits = trace.frames.filter((frame) => frame.pairs.length > 0);
  return picture("The dart at its three keyframes, and at the frames between them that see it in the wall",
    drawBody(wall, 0, px, py, "soft fd"),
    hits.map(({ time }) => drawBody(dart, time, px, py, "b fb")),
    [0, 1, 2].map((t) => [drawBody(dart, t, px, py, "a thick"), text(px(valueAt(paths(dart, 0)[0], dart.times, t)) + 8, py(valueAt(paths(dart, 1)[0], dart.times, t)) + 28, `keyframe ${t}`, "a")]),
    text(px(3.05), py(3.2), "wall", "d bold"), text(px(3.7), py(2.0), hits.map(({ time }) => `${time} s`).join(", ") + ": hit", "b bold"));
}

/// Lines of vertices over time; the upper envelope is thick, every swap a small circle.
function race(request, title, { marked }) {
  const [body] = request.scene.bodies, xs = paths(body, 0), corners = upperEnvelope(xs), swaps = crossings(xs);
  const { tx, vy, parts } = timeFrame({ x: 90, y: 40, w: 760, h: 410 }, range(xs.flat()), {});
  const at = (i, t) => vy(valueAt(xs[i], body.times, t));
  const labelY = [];
  let above = -100;
  for (const i of xs.map((_, v) => v).sort((p, q) => xs[q][1] - xs[p][1])) above = labelY[i] = Math.max(above + 17, vy(xs[i][1]) + 6);
  return picture(title, parts,
    xs.map((x, i) => [line(tx(0), vy(x[0]), tx(1), vy(x[1]), "ink thin"), text(tx(1) + 10, labelY[i], `${i}`, "small quiet")]),
    polyline(corners.map(([t, v]) => [tx(t), vy(v)]), "a thick"),
    swaps.map(({ t, i }) => circle(tx(t), at(i, t), 5, "paper quiet")),
    corners.slice(1, -1).map(([t, v]) => circle(tx(t), vy(v), 9, "b solid")),
    marked ? marked(tx, vy) : "");
}

export function race4Lines({ race4: { request } }) {
  return race(request, "Positions of four runners over time; the leader's line is thick, every overtaking is a circle", {
    marked: (tx, vy) => [text(tx(0.3), vy(7.2), "the lead: the upper envelope", "a bold"), text(tx(0.64), vy(5.9), "2/3 s", "b", "end")] });
}

export function raceLines({ race: { request } }) {
  return race(request, "Positions of eight runners over time; the upper envelope changes hands at the large dots", {});
}

export function relayLines({ "relay8.sorted": { request } }) {
  return race(request, "Eight lines that are tangents of a parabola: each of them leads for a while", {
    marked: (tx, vy) => [text(tx(0.05), vy(55), "tangents of a parabola: each line leads once", "a bold")] });
}

/// The tournament at three times. A node shows the vertex with the largest value below.
export function tournament({ race4: { request, trace } }) {
  const [body] = request.scene.bodies, xs = paths(body, 0), { nodes, primitives } = trace.start[0];
  const winner = (n, t) => {
    const below = (m) => (nodes[m].leaf ? Array.from(primitives.slice(nodes[m].first, nodes[m].first + nodes[m].count))
      : nodes.flatMap((node, c) => (c > 0 && node.parent === m ? below(c) : [])));
    return below(n).reduce((best, v) => (valueAt(xs[v], body.times, t) > valueAt(xs[best], body.times, t) ? v : best));
  };
  const moments = [[0, "0 s to 1/2 s"], [0.55, "1/2 s to 2/3 s"], [0.9, "2/3 s to 1 s"]];
  return picture("The tournament of four runners before, between and after its two events", moments.map(([t, caption], i) => {
    const frame = { x: 20 + 310 * i, y: 150, w: 300, h: 240 }, { places } = treePlaces(nodes, frame);
    const changed = i === 0 ? [] : nodes.flatMap((_, n) => (winner(n, t) !== winner(n, moments[i - 1][0]) ? [n] : []));
    return [text(frame.x + 150, 60, caption, "bold", "middle"),
      drawTree(nodes, frame, { label: (n) => winner(n, t), css: (n) => (changed.includes(n) ? "b thick" : "a"), size: 22,
        edge: (n) => (winner(n, t) === winner(nodes[n].parent, t) ? "a thick" : "soft") }),
      i > 0 ? text(frame.x + 150, 470, `${changed[0] === 0 ? "root" : "left pair"}: ${winner(changed[0], moments[i - 1][0])} loses to ${winner(changed[0], t)}`, "b", "middle")
        : text(frame.x + 150, 470, "each node holds its winner", "quiet", "middle"), text(places[0][0], 118, "root", "small quiet", "middle")];
  }));
}

export function kineticLoop() {
  const box = (x, y, lines, css) => [rect(x, y, 250, 90, "paper " + css, 12), ...lines.map((row, i) => text(x + 125, y + 38 + 28 * i, row, i === 0 ? "bold" : "small", "middle"))];
  return picture("The loop of a kinetic data structure: certificates, queue, event, repair",
    box(90, 70, ["certificates", "prove the attribute"], "a"), box(620, 70, ["event queue", "failure times, in order"], "a"),
    box(620, 370, ["event", "a certificate fails"], "b"), box(90, 370, ["repair", "attribute and certificates"], "c"),
    arrow(340, 115, 620, 115, "a"), text(480, 100, "each has a failure time", "small quiet", "middle"), arrow(745, 160, 745, 370, "b"), text(757, 270, "earliest first", "small quiet"),
    arrow(620, 415, 340, 415, "c"), text(480, 400, "local change", "small quiet", "middle"), arrow(215, 370, 215, 160, "a"), text(203, 270, "new certificates", "small quiet", "end"));
}
