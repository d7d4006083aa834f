// The scenes of the lessons, by name. Small ones are drawn in the plane; coordinates are multiples of powers of
// two, so that every number in the text is exact unless the lesson is about rounding.

import { grid, noise, points, polygons, scene, strip, triangles } from "./build.mjs";

/// Lesson 1: a ribbon of 16 triangles sags onto a table of 4.
export function ribbon() {
  const sag = (u, k) => (k === 0 ? 0 : k === 1 ? -0.125 * u * (8 - u) : -0.1875 * u * (8 - u));
  return scene("ribbon", [
    strip("ribbon", [0, 1, 2], 8, (u, v, k) => [u, 3.5 + 0.5 * v + sag(u, k)]),
    strip("table", [0], 2, (u, v) => [2 + 2 * u, 0.5 + 0.5 * v]),
  ]);
}

/// Lesson 1: two sheets that lie on their tree's leaves as built, then roll up: a refitted tree ages.
export function ageing() {
  const order = [0, 5, 2, 7, 4, 1, 6, 3];
  const start = [], end = [];
  for (let i = 0; i < 8; ++i) {
    for (const [list, at] of [[start, i], [end, order[i]]])
      list.push([2 * at, 0], [2 * at + 1, 0], [2 * at, 1]);
  }
  const probe = [[0, 0.25], [1, 0.25], [0, 0.75]];
  const faces = Array.from({ length: 8 }, (_, i) => [3 * i, 3 * i + 1, 3 * i + 2]);
  return scene("ageing", [
    triangles("tiles", [0, 1], [start, end], faces),
    triangles("probe", [0], [probe.map(([x, y]) => [x + 7, y])], [[0, 1, 2]]),
  ]);
}

/// Lesson 2: a dart flies through a wall between two keyframes.
export function dart() {
  const shape = [[0, 0], [1, 0.25], [0, 0.5]];
  const at = (x, y) => shape.map(([a, b]) => [a + x, b + y]);
  return scene("dart", [
    triangles("dart", [0, 1, 2], [at(0, 1), at(6, 1), at(6, 4)], [[0, 1, 2]]),
    strip("wall", [0], 2, (u, v) => [3 + 0.5 * v, 1.5 * u]),
  ]);
}

/// Lesson 3: eight runners on parallel tracks; y only keeps them apart on the screen.
export function race() {
  const from = [0, 1, 2, 3, 4, 5, 6, 7];
  const to = [13.5, 4, 13.25, 3.5, 10, 12, 8, 10.5];
  return scene("race", [
    points("runners", [0, 1], [from, to].map((xs) => xs.map((x, i) => [x, i]))),
  ]);
}

/// Lesson 3: a smaller race, small enough to do by hand.
export function race4() {
  return scene("race of four", [
    points("runners", [0, 1], [[0, 2, 4, 6], [8, 6, 3, 5]].map((xs) => xs.map((x, i) => [x, i]))),
  ]);
}

/// Lessons 3 and 5: the maximum changes hands as often as it can, because the lines are tangents of a parabola.
/// The tree splits on y, which is large: "sorted" makes neighbours of neighbouring tangents, "mixed" puts the even
/// ones on one side and the odd ones on the other, at every level. `count` is a power of two.
export function relay(count = 8, order = "sorted") {
  const place = (i) => (order === "sorted" ? i : reversed(i, Math.log2(count)));
  const from = [], to = [], apart = 2 * count * count;
  for (let i = 0; i < count; ++i) from.push([-i * i, apart * place(i)]), to.push([2 * count * i - i * i, apart * place(i)]);
  return scene(`relay of ${count}, ${order}`, [points("runners", [0, 1], [from, to])]);
}

function reversed(i, bits) {
  let result = 0;
  for (let b = 0; b < bits; ++b) result = 2 * result + ((i >> b) & 1);
  return result;
}

/// Lesson 4: a ribbon of four triangles that bends: a tree of seven nodes.
export function flag() {
  const y0 = [[0, 2], [1, 3], [0.25, 2.5]], y1 = [[2, 3.25], [-0.5, 3.5], [-1.5, 2.75]];
  return scene("flag", [
    strip("flag", [0, 1], 2, (u, v, k) => [2 * u + (k === 1 ? [0, 0.5, -1.5][u] - 0.75 * v * u : 0.25 * v), (k === 0 ? y0 : y1)[u][v]]),
  ]);
}

/// Lesson 4: eight triangles on their own, so that a leaf's vertices are its own.
export function shoal(seed = 5) {
  const random = noise(seed);
  const from = [], to = [], faces = [];
  for (let i = 0; i < 8; ++i) {
    const x = 2 * (i % 4), y = 3 * Math.floor(i / 4);
    for (const [a, b] of [[0, 0], [1, 0.25], [0.25, 1]]) {
      from.push([x + a, y + b]);
      to.push([x + a + 4 * random() - 2, y + b + 4 * random() - 2]);
    }
    faces.push([3 * i, 3 * i + 1, 3 * i + 2]);
  }
  return scene("shoal", [triangles("shoal", [0, 1], [from, to], faces)]);
}

/// Lessons 4 and 5: one polygon whose vertices move along tangents of a parabola, the counterexample to T9.
export function tangents(count = 16) {
  const from = [], to = [];
  for (let i = 0; i < count; ++i) from.push([-i * i, 2 * i]), to.push([32 * i - i * i, 2 * i]);
  return scene("tangents of " + count, [
    polygons("polygon", [0, 1], [from, to], [Array.from({ length: count }, (_, i) => i)]),
  ], { frames: 1 });
}

/// Lesson 5: points that wander along straight lines through random keyframes.
export function wander(count, keyframes = 2, seed = count) {
  const random = noise(seed);
  const times = Array.from({ length: keyframes }, (_, k) => k);
  const rows = times.map(() => Array.from({ length: count }, () => [16 * random(), 16 * random()]));
  return scene("wander " + count, [points("points", times, rows)]);
}

/// Lesson 6: a cloth of 2 x 16 triangles, seen from the side, that lies flat and then hangs over an edge.
export function drape() {
  return scene("drape", [
    strip("cloth", [0, 1, 2], 16, (u, v, k) => {
      if (k === 0) return [u, 8 + 0.25 * v];
      const hang = Math.max(0, u - 8);
      if (k === 1) return [u - 0.25 * hang, 8 + 0.25 * v - 0.5 * hang];
      return [Math.min(u, 8) + 0.0625 * hang + 0.25 * v * (hang > 0 ? 1 : 0), 8 + 0.25 * v * (hang > 0 ? 0 : 1) - hang];
    }),
  ]);
}

/// Lesson 7: two combs of triangles slide past each other.
export function combs(teeth = 4) {
  const up = [], upLater = [], down = [], downLater = [], faces = [];
  for (let i = 0; i < teeth; ++i) {
    for (const [a, b] of [[0, 0], [1, 0], [0.5, 2]]) up.push([2 * i + a, b]), upLater.push([2 * i + a + 6, b]);
    for (const [a, b] of [[0, 3], [1, 3], [0.5, 1]]) down.push([2 * i + a + 7, b]), downLater.push([2 * i + a + 1, b]);
    faces.push([3 * i, 3 * i + 1, 3 * i + 2]);
  }
  return scene("combs", [
    triangles("lower comb", [0, 1], [up, upLater], faces),
    triangles("upper comb", [0, 1], [down, downLater], faces),
  ]);
}

/// Lesson 8: a sheet of 2 n^2 triangles waves over a table.
export function sheet(n = 12, keyframes = 6) {
  const times = Array.from({ length: keyframes }, (_, k) => k);
  const wave = [0, 0.5, 1, 0.5, 0, -0.5, -1, -0.5];
  return scene("sheet", [
    grid("sheet", times, n, n, (u, v, k) => [u + 0.125 * wave[(u + 3 * k) % 8], v + 0.125 * wave[(v + k) % 8],
      wave[(u + 2 * v + k) % 8]]),
    grid("table", [0], 4, 4, (u, v) => [3 * u, 3 * v, -0.75]),
  ], { dimension: 3 });
}

/// Lesson 9: three points meet in one point of the diagram; the slowest does not matter.
export function tie() {
  return scene("tie", [points("points", [0, 1], [[[2, 0], [1, 1], [0, 2]], [[2, 0], [3, 1], [4, 2]]])]);
}

/// Lesson 9: 64 points, translated by the same vector in each of three seconds, `offset` from the origin. All numbers
/// are multiples of 2^-10: exact in float near the origin.
export function carried(offset = 0) {
  const random = noise(9);
  const from = Array.from({ length: 64 }, (_, i) => [offset + (i % 8) + random(), offset + random()]);
  const times = [0, 1, 2, 3];
  return scene(offset ? "carried, far away" : "carried", [
    points("points", times, times.map((k) => from.map(([x, y]) => [x + 0.4140625 * k, y + 0.2734375 * k]))),
  ]);
}

export const scenes = { ribbon, ageing, dart, race, race4, relay, flag, shoal, tangents, wander, drape, combs, sheet, tie, carried };
