// The native program's results on a scene, and how states of the engine are compared with it.

import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';

/** Plays a scene natively: {frames, events}. */
export function native(scene, strategy, precision = 'float64', params = {}) {
  const folder = mkdtempSync(join(tmpdir(), 'kbvh-lab-'));
  try {
    const file = join(folder, 'scene.json');
    writeFileSync(file, JSON.stringify(scene));
    const words = Object.entries(params).map(([key, value]) => `${key}=${value}`);
    return JSON.parse(execFileSync(process.env.KBVH_LAB_REFERENCE, [file, strategy, precision, ...words], { encoding: 'utf8', maxBuffer: 1 << 30 }));
  } finally {
    rmSync(folder, { recursive: true });
  }
}

/** JSON keeps no infinities and no signs of zeros. */
export const plain = (value) => JSON.parse(JSON.stringify(value));

/** Expects the frame of the engine to be the native one, to the last bit, except for the signs of zeros. */
export function expectFrame(state, frame, place) {
  assert.equal(state.time, frame.t, place);
  assert.deepEqual(plain([...state.pairs]), frame.pairs, `${place}: pairs`);
  state.positions.forEach((numbers, body) =>
    assert.deepEqual(plain([...numbers]), plain(frame.positions[body]), `${place}: positions of body ${body}`));
  state.hierarchies.forEach((hierarchy, body) =>
    assert.deepEqual(plain(hierarchy === null ? [] : [...hierarchy.bounds]), plain(frame.bounds[body]), `${place}: boxes of body ${body}`));
  const { bytes, ...counters } = state.counters;
  assert.deepEqual(counters, frame.counters, `${place}: counters`);
}
