// Scenes for the tests of the engine.

import { readFileSync, readdirSync } from 'node:fs';
import { join } from 'node:path';

const root = new URL('../../..', import.meta.url).pathname;

/** A generator of whole numbers below 2^32, the same everywhere. */
export function numbers(seed) {
  let state = seed >>> 0;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state;
  };
}

/** Two bodies of separate triangles that fly through each other, over several keyframes. */
export function soups({ triangles = 20, keyframes = 4, seed = 1, l = 4 } = {}) {
  const next = numbers(seed);
  const unit = () => next() / 2 ** 32;
  const bodies = ['a', 'b'].map((name, b) => {
    const vertices = 3 * triangles;
    const corners = Array.from({ length: triangles }, () => [4 * unit(), 4 * unit(), 4 * unit()]);
    const first = corners.flatMap((c) => Array.from({ length: 9 }, (_, i) => c[i % 3] + unit()));
    const times = Array.from({ length: keyframes }, (_, k) => k * (b === 0 ? 1 : 0.75));
    const positions = times.map((t) => first.map((x, i) => x + t * (((i * 7 + b) % 5) - 2) * 0.4 + (t > 0 ? 0.5 * unit() : 0)));
    return { name, shape: 'polygons', vertices, indices: Array.from({ length: vertices }, (_, i) => i), times, positions };
  });
  return { format: 'kbvh-scene', version: 1, name: 'soups', dimension: 3, bodies, frames: { l } };
}

/** Points in the plane, on whole numbers: many overtake others at the same time. */
export function ties({ points = 12, l = 5 } = {}) {
  const at = (t) => Array.from({ length: points }, (_, i) => [(i * 5) % 7 + t * (((i * 3) % 7) - 3), (i * 3) % 5 + t * (((i + 2) % 5) - 2), 0]).flat();
  const body = (name, shift) => ({
    name, shape: 'points', vertices: points, indices: Array.from({ length: points }, (_, i) => i), times: [0, 2, 4],
    positions: [0, 2, 4].map((t) => at(t).map((x, i) => x + (i % 3 === 0 ? shift : 0))),
  });
  return { format: 'kbvh-scene', version: 1, name: 'ties', dimension: 2, bodies: [body('one', 0), body('two', 2)], frames: { l } };
}

/** The scenes that come with the lab. */
export function builtIn() {
  const folder = join(root, 'analysis/lab/scenes');
  let files = [];
  try {
    files = readdirSync(folder).filter((name) => name.endsWith('.json')).sort();
  } catch {
    return []; // there are none yet
  }
  return files.map((name) => JSON.parse(readFileSync(join(folder, name), 'utf8')));
}
