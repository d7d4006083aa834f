/** A square cloth of 9 x 9 vertices that falls on a box: springs, gravity and a little damping, in fixed small steps. */
export function cloth(scene, mesh) {
  const n = 9, spacing = 0.25, step = 1 / 240, seconds = 2, keyframes = 20;
  const top = 0, half = 0.55;  // the box reaches from -half to half, its top face is at z = top
  const at = (i, j) => j * n + i;
  const position = [], velocity = [];
  for (let j = 0; j < n; ++j)
    for (let i = 0; i < n; ++i) {
      position.push([(i - (n - 1) / 2) * spacing + 0.12, (j - (n - 1) / 2) * spacing - 0.07, 0.8 + 0.02 * ((i * 7 + j * 3) % 5)]);
      velocity.push([0, 0, 0]);
    }
  const springs = [];
  const rest = (a, b) => Math.sqrt(position[a].reduce((sum, x, k) => sum + (k < 2 ? (x - position[b][k]) * (x - position[b][k]) : 0), 0));
  const spring = (a, b, stiffness) => springs.push([a, b, rest(a, b), stiffness]);
  for (let j = 0; j < n; ++j)
    for (let i = 0; i < n; ++i) {
      if (i + 1 < n) spring(at(i, j), at(i + 1, j), 220);
      if (j + 1 < n) spring(at(i, j), at(i, j + 1), 220);
      if (i + 1 < n && j + 1 < n) { spring(at(i, j), at(i + 1, j + 1), 120); spring(at(i + 1, j), at(i, j + 1), 120); }
      if (i + 2 < n) spring(at(i, j), at(i + 2, j), 12);
      if (j + 2 < n) spring(at(i, j), at(i, j + 2), 12);
    }
  const frames = [position.flat()];
  const steps = Math.round(seconds / step / keyframes);
  for (let frame = 0; frame < keyframes; ++frame) {
    for (let s = 0; s < steps; ++s) advance(position, velocity, springs, step, top, half);
    frames.push(position.flat());
  }
  const indices = [];
  for (let j = 0; j + 1 < n; ++j)
    for (let i = 0; i + 1 < n; ++i)
      indices.push(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j), at(i + 1, j + 1), at(i, j + 1));
  const times = frames.map((_, k) => k * seconds / keyframes);
  return scene('A cloth falls on a box', 'A cloth of 128 triangles falls on a resting box and drapes over it; twenty keyframe intervals.',
      3, [mesh('cloth', indices, times, frames), box(mesh, half, top)], 10, [[0, 1]]);
}

function advance(position, velocity, springs, step, top, half) {
  const force = velocity.map((v) => [-0.4 * v[0], -0.4 * v[1], -9.81 - 0.4 * v[2]]);
  for (const [a, b, rest, stiffness] of springs) {
    const d = [0, 1, 2].map((k) => position[b][k] - position[a][k]);
    const length = Math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    const along = [0, 1, 2].reduce((sum, k) => sum + (velocity[b][k] - velocity[a][k]) * d[k], 0) / length;
    const pull = (stiffness * (length - rest) * 6 + 1.2 * along) / length;
    for (let k = 0; k < 3; ++k) { force[a][k] += pull * d[k]; force[b][k] -= pull * d[k]; }
  }
  for (let v = 0; v < position.length; ++v) {
    for (let k = 0; k < 3; ++k) velocity[v][k] += step * force[v][k];
    for (let k = 0; k < 3; ++k) position[v][k] += step * velocity[v][k];
    collide(position[v], velocity[v], top, half);
  }
}

/** Keeps a vertex a little above the top face of the box (so that folds still cut it), and out of its walls. */
function collide(p, v, top, half) {
  const inside = Math.max(Math.abs(p[0]), Math.abs(p[1])) < half;
  if (inside && p[2] < top + 0.03 && p[2] > top - 0.25) {
    p[2] = top + 0.03;
    for (let k = 0; k < 3; ++k) v[k] *= k === 2 ? 0 : 0.6;
  }
}

function box(mesh, half, top) {
  const corners = [];
  for (const z of [top - 0.9, top])
    for (const y of [-half, half])
      for (const x of [-half, half]) corners.push(x, y, z);
  const quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
  return mesh('box', quads.flatMap(([a, b, c, d]) => [a, b, c, a, c, d]), [0], [corners]);
}
