// Parts from which the scenes of the lessons are put together. A scene is the lab's scene file.

/// A scene from its bodies; `frames` is the number l of frames per keyframe interval.
export function scene(name, bodies, { dimension = 2, frames = 10, pairs = null } = {}) {
  const made = { format: "kbvh-scene", version: 1, name, dimension, bodies, frames: { l: frames } };
  if (pairs) made.pairs = pairs;
  return made;
}

/// A cloud of points. `keyframes` is [keyframe][point][x, y] or [x, y, z].
export function points(name, times, keyframes) {
  const count = keyframes[0].length;
  return {
    name,
    shape: "points",
    vertices: count,
    indices: Array.from({ length: count }, (_, i) => i),
    offsets: Array.from({ length: count + 1 }, (_, i) => i),
    times,
    positions: keyframes.map(flat),
  };
}

/// Triangles over shared vertices. `faces` is [triangle][three vertices].
export function triangles(name, times, keyframes, faces) {
  return {
    name,
    shape: "polygons",
    vertices: keyframes[0].length,
    indices: faces.flat(),
    offsets: null,
    times,
    positions: keyframes.map(flat),
  };
}

/// Polygons of any size over shared vertices.
export function polygons(name, times, keyframes, faces) {
  const offsets = [0];
  for (const face of faces) offsets.push(offsets.at(-1) + face.length);
  return { ...triangles(name, times, keyframes, faces), offsets };
}

function flat(row) {
  return row.flatMap(([x, y, z = 0]) => [x, y, z]);
}

/// A strip of quads, each cut into two triangles: 2 (columns + 1) vertices, 2 columns triangles. `at(u, v, k)`
/// gives a position for u in 0..columns, v in 0..1, and a keyframe.
export function strip(name, times, columns, at) {
  const keyframes = times.map((_, k) => {
    const row = [];
    for (let u = 0; u <= columns; ++u) for (let v = 0; v < 2; ++v) row.push(at(u, v, k));
    return row;
  });
  const faces = [];
  for (let u = 0; u < columns; ++u) {
    const a = 2 * u;
    faces.push([a, a + 1, a + 2], [a + 1, a + 3, a + 2]);
  }
  return triangles(name, times, keyframes, faces);
}

/// A grid of quads in space or in the plane, each cut into two triangles.
export function grid(name, times, columns, rows, at) {
  const keyframes = times.map((_, k) => {
    const all = [];
    for (let u = 0; u <= columns; ++u) for (let v = 0; v <= rows; ++v) all.push(at(u, v, k));
    return all;
  });
  const faces = [];
  const id = (u, v) => u * (rows + 1) + v;
  for (let u = 0; u < columns; ++u)
    for (let v = 0; v < rows; ++v) {
      faces.push([id(u, v), id(u + 1, v), id(u, v + 1)]);
      faces.push([id(u + 1, v), id(u + 1, v + 1), id(u, v + 1)]);
    }
  return triangles(name, times, keyframes, faces);
}

/// Numbers between 0 and 1 that are multiples of 2^-10, the same on every machine (a linear congruential
/// generator modulo 2^32).
export function noise(seed) {
  let state = seed >>> 0;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return (state >>> 22) / 1024;
  };
}
