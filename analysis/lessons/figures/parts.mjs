// Parts of pictures: diagrams of values over time, trees, boxes and charts.
import { circle, line, polygon, polyline, rect, text } from "./svg.mjs";

export const colours = ["a", "b", "c", "d"];

/// A linear map from [from0, from1] to [to0, to1].
export const scale = (from0, from1, to0, to1) => (x) => to0 + ((x - from0) / (from1 - from0)) * (to1 - to0);

/// The range of the numbers of a list, with a margin.
export function range(values, margin = 0.06) {
  const [low, high] = [Math.min(...values), Math.max(...values)], room = (high - low || 1) * margin;
  return [low - room, high + room];
}

/// Paths [vertex][keyframe] of one coordinate of a body.
export const paths = (body, axis) => Array.from({ length: body.vertices }, (_, v) => body.positions.map((row) => row[3 * v + axis]));

/// The value of a path at a time.
export function valueAt(path, times, t) {
  if (path.length === 1 || t <= times[0]) return path[0];
  for (let k = 0; k + 1 < times.length; ++k)
    if (t <= times[k + 1]) return path[k] + ((path[k + 1] - path[k]) * (t - times[k])) / (times[k + 1] - times[k]);
  return path.at(-1);
}

/// Times in (begin, end) at which two linear paths cross, for bodies with two keyframes.
export function crossings(list) {
  const found = [];
  for (let i = 0; i < list.length; ++i)
    for (let j = i + 1; j < list.length; ++j) {
      const [a, b] = [list[i], list[j]], d0 = a[0] - b[0], d1 = a[1] - b[1];
      if (d0 * d1 < 0) found.push({ t: d0 / (d0 - d1), i, j });
    }
  return found.sort((p, q) => p.t - q.t);
}

/// The upper envelope of paths with two keyframes, as corners [time, value, path].
export function upperEnvelope(list) {
  let at = 0, current = list.reduce((best, path, i) => (path[0] > list[best][0] || (path[0] === list[best][0] && path[1] > list[best][1]) ? i : best), 0);
  const value = (i, t) => list[i][0] + (list[i][1] - list[i][0]) * t, corners = [[0, list[current][0], current]];
  for (;;) {
    const next = crossings([list[current], ...list]).filter(({ i, t, j }) => i === 0 && t > at + 1e-12 && list[j - 1][1] > list[current][1]);
    if (next.length === 0) break;
    const first = next.reduce((best, one) => (one.t < best.t - 1e-12 || (Math.abs(one.t - best.t) < 1e-12 && list[one.j - 1][1] > list[best.j - 1][1]) ? one : best));
    at = first.t, current = first.j - 1;
    corners.push([at, value(current, at), current]);
  }
  corners.push([1, list[current][1], current]);
  return corners;
}

/// Axes of a diagram over time, with a frame (x, y, w, h) in the picture.
export function timeFrame({ x, y, w, h }, [low, high], { times = [0, 1], label = "x", ticks = true } = {}) {
  const tx = scale(times[0], times.at(-1), x, x + w), vy = scale(low, high, y + h, y);
  return { tx, vy, parts: [
    ...(ticks ? times.map((t) => line(tx(t), y, tx(t), y + h, "grid") + text(tx(t), y + h + 24, `${t} s`, "small quiet", "middle")) : []),
    line(x, y + h, x + w, y + h, "axis"), line(x, y, x, y + h, "axis"), text(x - 10, y + 14, label, "quiet", "end"), text(x + w, y + h + 46, "time", "small quiet", "end")] };
}

/// Places of the nodes of a binary tree: [node] => [x, y].
export function treePlaces(nodes, { x, y, w, h }) {
  const children = nodes.map(() => []), depth = nodes.map(() => 0), places = nodes.map(() => [0, 0]);
  for (let n = 1; n < nodes.length; ++n) children[nodes[n].parent].push(n), (depth[n] = depth[nodes[n].parent] + 1);
  const leaves = nodes.map((_, n) => n).filter((n) => children[n].length === 0).length, deepest = Math.max(...depth);
  let next = 0;
  const place = (n) => {
    for (const child of children[n]) place(child);
    const across = children[n].length === 0 ? x + (w * (next++ + 0.5)) / leaves
      : (places[children[n][0]][0] + places[children[n].at(-1)][0]) / 2;
    places[n] = [across, y + (deepest === 0 ? 0 : (h * depth[n]) / deepest)];
  };
  place(0);
  return { places, children, depth };
}

/// A tree of nodes: `label(n)` is written into a node, `css(n)` its class.
export function drawTree(nodes, frame, { label, css = () => "ink", size = 26, edge = () => "soft", below } ) {
  const { places, depth } = treePlaces(nodes, frame);
  return [
    ...nodes.flatMap((node, n) => (n === 0 ? [] : [line(...places[node.parent], ...places[n], edge(n))])),
    ...nodes.flatMap((_, n) => {
      const [cx, cy] = places[n], caption = String(label(n, depth[n])), half = Math.max(size, 6 + 5.6 * caption.length);
      return [rect(cx - half, cy - 18, 2 * half, 36, "paper " + css(n), 8), text(cx, cy + 7, caption, "small", "middle"),
        below ? text(cx, cy + 42, below(n), "small quiet", "middle") : ""];
    })];
}

/// Boxes of nodes in the plane, drawn by a map from coordinates to the picture.
export const drawBoxes = (nodes, px, py, css) => nodes.map(({ lower, upper }, n) => {
  const kind = css(n);
  return kind ? rect(px(lower[0]), py(upper[1]), Math.max(1, px(upper[0]) - px(lower[0])), Math.max(1, py(lower[1]) - py(upper[1])), kind) : "";
});

/// The triangles or polygons of a body at a time.
export function drawBody(body, t, px, py, css) {
  const xs = paths(body, 0), ys = paths(body, 1);
  const at = (v) => [px(valueAt(xs[v], body.times, t)), py(valueAt(ys[v], body.times, t))];
  if (body.shape === "points") return body.indices.map((v) => circle(...at(v), 6, css));
  const offsets = body.offsets ?? Array.from({ length: body.indices.length / 3 + 1 }, (_, i) => 3 * i);
  return offsets.slice(1).map((end, p) => polygon(body.indices.slice(offsets[p], end).map(at), css));
}

/// A chart with logarithmic axes. `series` is [{points: [[x, y]], css, label, dx?, dy?}].
export function logChart({ x, y, w, h }, [x0, x1], [y0, y1], series, { xLabel, yLabel, xTicks, yTicks }) {
  const px = (v) => scale(Math.log(x0), Math.log(x1), x, x + w)(Math.log(v)), py = (v) => scale(Math.log(y0), Math.log(y1), y + h, y)(Math.log(v));
  return [
    ...xTicks.flatMap((v) => [line(px(v), y, px(v), y + h, "grid"), text(px(v), y + h + 24, v.toLocaleString("en"), "small quiet", "middle")]),
    ...yTicks.flatMap((v) => [line(x, py(v), x + w, py(v), "grid"), text(x - 10, py(v) + 6, v.toLocaleString("en"), "small quiet", "end")]),
    line(x, y + h, x + w, y + h, "axis"), line(x, y, x, y + h, "axis"),
    text(x + w, y + h + 50, xLabel, "small quiet", "end"), text(x - 60, y - 14, yLabel, "small quiet"),
    ...series.flatMap(({ points, css, label, dx = 10, dy = 6 }) => [
      polyline(points.map(([a, b]) => [px(a), py(b)]), css),
      ...points.map(([a, b]) => circle(px(a), py(b), 5, css.split(" ")[0] + " solid")),
      text(px(points.at(-1)[0]) + dx, py(points.at(-1)[1]) + dy, label, css.split(" ")[0])])];
}
