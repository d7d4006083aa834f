// Parts of the page without a browser: lines and envelopes, exact times, edits, states of links.

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { medianClip } from '../../analysis/lab/src/math/clips.js';
import { envelope } from '../../analysis/lab/src/math/envelope.js';
import { compare, crossingTime, exact, spell, toNumber } from '../../analysis/lab/src/math/exact.js';
import { Tree } from '../../analysis/lab/src/math/hierarchy.js';
import { frameAt, frameTimes, overlay, valueAt } from '../../analysis/lab/src/math/plans.js';
import * as edit from '../../analysis/lab/src/state/edit.js';
import { checkState, decodeState, encodeState } from '../../analysis/lab/src/state/permalink.js';
import { linesBelow } from '../../analysis/lab/src/text/tenure.js';

/** Numbers in [0, 1), the same for the same seed. */
function noise(seed) {
  let state = seed;
  return () => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32;
}
const polylines = (random, n, times) => Array.from({ length: n }, (_, id) => ({ id, times, values: times.map(() => Math.round(random() * 12)) }));

test('the envelope is the maximum, and the minimum, of the lines at every time', () => {
  for (let seed = 1; seed <= 60; ++seed) {
    const random = noise(seed), times = [0, 1, 2.5, 4], lines = polylines(random, 2 + seed % 7, times);
    for (const upper of [true, false]) {
      const pieces = envelope(lines, upper, 0, 4);
      assert.equal(pieces[0].begin, 0);
      assert.equal(pieces[pieces.length - 1].end, 4);
      pieces.forEach((piece, i) => {
        if (i) { assert.equal(piece.begin, pieces[i - 1].end); assert.notEqual(piece.id, pieces[i - 1].id); }
        for (const u of [0.001, 0.5, 0.999]) {
          const t = piece.begin + u * (piece.end - piece.begin), values = lines.map((line) => valueAt(line, t));
          const best = upper ? Math.max(...values) : Math.min(...values);
          assert.ok(Math.abs(valueAt(lines[piece.id], t) - best) < 1e-9, `seed ${seed}, ${upper ? 'upper' : 'lower'}, t = ${t}`);
        }
      });
    }
  }
});

test('a leader keeps its place in a tie', () => {
  const flat = (id, values) => ({ id, times: [0, 1, 2], values });
  assert.deepEqual(envelope([flat(0, [1, 1, 1]), flat(1, [0, 1, 0])], true, 0, 2), [{ id: 0, begin: 0, end: 2 }]);
  assert.deepEqual(envelope([flat(0, [1, 1, 1]), flat(1, [1, 1, 1])], true, 0, 2), [{ id: 0, begin: 0, end: 2 }]);
});

test('lines without finite values do not stop the envelope', () => {
  assert.equal(envelope([{ id: 0, times: [0, 1], values: [NaN, NaN] }, { id: 1, times: [0, 1], values: [0, NaN] }], true, 0, 1).length, 1);
});

test('doubles are fractions, and crossings are exact', () => {
  for (const x of [0, 1, -1, 0.1, -2.5, 1e-310, 5e-324, 1.7e308, 1 / 3]) assert.equal(toNumber(exact(x)), x);
  assert.ok(compare(exact(0.1), { n: 1n, d: 10n }) === 1, 'the double 0.1 is larger than a tenth');
  const piece = (t0, t1, x0, x1, ray = false) => ({ t0, t1, x0, x1, ray });
  assert.deepEqual(crossingTime(piece(0, 1, 0, 3), piece(0, 1, 1, 1)), { n: 1n, d: 3n });
  assert.deepEqual(crossingTime(piece(2, 0, 0, 3, true), piece(0, 1, 1, 1)), { n: 7n, d: 3n });
  assert.equal(crossingTime(piece(0, 1, 0, 1), piece(0, 1, 5, 6)), null);
  assert.deepEqual(spell({ n: 4n, d: 3n }), { text: '4/3', exactly: true });
  assert.equal(spell(exact(0.1)).exactly, false);
});

test('frames are l to an interval between keyframes of any body', () => {
  const bodies = [{ times: [0, 2] }, { times: [0, 1] }, { times: [0.5] }];
  assert.deepEqual(overlay(bodies, 0, 2), [0, 0.5, 1, 2]);
  const frames = frameTimes([0, 1, 2], 4);
  assert.deepEqual(frames, [0, 0.25, 0.5, 0.75, 1, 1.25, 1.5, 1.75, 2]);
  assert.deepEqual([-1, 0, 0.24, 0.25, 1.9, 2, 9].map((t) => frameAt(frames, t)), [0, 0, 0, 1, 7, 8, 8]);
});

test('a tree knows its children, levels and vertices; samples keep what must be drawn', () => {
  const flat = { parent: Uint32Array.of(0, 0, 0, 2, 2), first: Uint32Array.of(1, 0, 3, 1, 2), count: Uint32Array.of(2, 1, 2, 1, 1), leaf: Uint32Array.of(0, 1, 0, 1, 1),
    stale: new Uint32Array(5), depth: Uint32Array.of(0, 1, 1, 2, 2), bounds: new Float64Array(30), realisers: null, primitives: Uint32Array.of(2, 0, 1) };
  const info = { indices: Uint32Array.of(0, 1, 2, 1, 2, 3, 3, 4, 5), offsets: null };
  const tree = new Tree(flat, 0, info);
  assert.deepEqual([...tree.kids(2)], [3, 4]);
  assert.equal(tree.levels, 3);
  assert.deepEqual(tree.verticesBelow(1), [3, 4, 5]);
  assert.deepEqual(tree.verticesBelow(2), [0, 1, 2, 3]);
  assert.deepEqual(tree.pathUp(4), [4, 2, 0]);
  assert.equal(tree.next({ ...flat }, info).childStart, tree.childStart, 'an unchanged structure is shared');
  assert.notEqual(tree.next({ ...flat, primitives: Uint32Array.of(0, 1, 2) }, info).childStart, tree.childStart);
  const scene = { bodies: [{ times: [0], positions: [Array.from({ length: 18 }, (_, i) => i)] }] };
  assert.deepEqual(linesBelow(scene, tree, 0, 0, 'float64').map(({ id }) => id), [0, 1, 2, 3, 4, 5]);
  assert.deepEqual(linesBelow(scene, tree, 0, 0, 'float64', 2, [4, 1]).map(({ id }) => id), [4, 1, 0, 3]);
});

test('edits make new scenes and refuse wrong input', () => {
  const body = { name: 'b', shape: 'polygons', vertices: 4, indices: [0, 1, 2, 1, 2, 3], times: [0, 1], positions: [[0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0], [0, 0, 0, 2, 0, 0, 0, 2, 0, 2, 2, 0]] };
  const scene = { format: 'kbvh-scene', version: 1, name: 's', dimension: 2, bodies: [body], frames: { l: 4 } };
  const before = structuredClone(scene);
  const half = edit.addKeyframe(scene, { body: 0, time: 0.5 });
  assert.deepEqual(half.bodies[0].positions[1].slice(3, 6), [1.5, 0, 0]);
  const less = edit.removeVertex(scene, { body: 0, vertex: 0 });
  assert.deepEqual([less.bodies[0].vertices, less.bodies[0].indices, less.bodies[0].positions[0]], [3, [0, 1, 2], [1, 0, 0, 0, 1, 0, 1, 1, 0]]);
  assert.equal(edit.tie(scene, { body: 0, vertex: 0, like: 3, axis: 1, keyframe: 1 }).bodies[0].positions[1][1], 2);
  assert.deepEqual(edit.shiftPlan(scene, { body: 0, vertex: 3, by: [1, 0, 0] }).bodies[0].positions.map((p) => p[9]), [2, 3]);
  const points = { ...scene, bodies: [{ name: 'p', shape: 'points', vertices: 1, indices: [0], offsets: [0, 1], times: [0, 1], positions: [[0, 0, 0], [1, 0, 0]] }] };
  const more = edit.addVertex(points, { body: 0, position: [5, 5, 0], like: 0, time: 0.5 }).bodies[0];
  assert.deepEqual([more.vertices, more.indices, more.offsets, more.positions[0].slice(3), more.positions[1].slice(3)], [2, [0, 1], [0, 1, 2], [4.5, 5, 0], [5.5, 5, 0]]);
  for (const [name, options, pattern] of [['setKeyframe', { body: 0, vertex: 9, keyframe: 0, position: [0, 0, 0] }, /vertex 9/], ['setKeyframe', { body: 0, vertex: 0, keyframe: 0, position: [NaN, 0, 0] }, /NaN/],
    ['addKeyframe', { body: 0, time: 1 }, /already/], ['addTriangle', { body: 0, vertices: [0, 0, 1] }, /different/], ['removeBody', { body: 0 }, /needs a body/], ['setFrames', { l: 0 }, /1 to 1000/],
    ['addKeyframe', { body: 3, time: 0.5 }, /no body 3/], ['removePrimitive', { body: 0, primitive: 0 }, null]])
    if (pattern) assert.throws(() => edit[name](scene, options), pattern, name); else edit[name](scene, options);
  assert.deepEqual(scene, before, 'nothing is changed in place');
});

test('states survive a link; damaged ones are refused with the reason', async () => {
  const state = { format: 'kbvh-lab', version: 1, sceneId: 'line-4', strategy: 'kinetic_aabb', time: 0.1 + 0.2, view: { boxes: 'none' } };
  assert.deepEqual(await decodeState(await encodeState(state)), state);
  await assert.rejects(decodeState((await encodeState(state)).slice(0, -9)), /damaged/);
  assert.throws(() => checkState({ format: 'x' }), /format is 'x'/);
  assert.throws(() => checkState({ ...state, version: 2 }), /version 2/);
  const scene = (bodies) => ({ format: 'kbvh-scene', version: 1, name: 'n', bodies });
  assert.throws(() => checkState(scene([])), /no bodies/);
  assert.throws(() => checkState(scene([{ name: 'b', vertices: 1, times: [0, 0], positions: [[0, 0, 0], [0, 0, 0]], indices: [0] }])), /must increase, but 0 follows 0/);
  assert.throws(() => checkState(scene([{ name: 'b', vertices: 1, times: [0], positions: [[0, 0, null]], indices: [0] }])), /vertex 0: null/);
  assert.throws(() => checkState(scene([{ name: 'b', vertices: 1, times: [0], positions: [[0, 0, 0]], indices: [4] }])), /index 4 with 1 vertices/);
});

test('names next to points do not cover each other, and those that must be seen are drawn', async () => {
  const { drawNames } = await import('../../analysis/lab/src/views/dom.js');
  const context = { measureText: (text) => ({ width: 7 * text.length }), strokeText() {}, fillText() {} };
  let state = 5, left = 0;
  const random = (n) => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0, (state >>> 8) % n);
  for (let round = 0; round < 200; ++round) {
    const labels = Array.from({ length: 24 }, (_, i) => ({ x: random(160), y: random(120), text: String(random(300)), colour: 'black', must: i === 23 }));
    const taken = drawNames(context, labels, { width: 180, height: 140, colours: { panel: 'white' } });
    for (const [i, a] of taken.entries()) for (const b of taken.slice(0, i)) assert.ok(a[2] < b[0] || b[2] < a[0] || a[3] < b[1] || b[3] < a[1], `${a} and ${b}`);
    const { x } = labels[23];
    assert.ok(Math.min(Math.abs(taken[0][0] - x), Math.abs(taken[0][2] - x)) < 8, 'the one that must be seen is first');
    for (const [x0, y0, x1, y1] of taken) assert.ok(x0 >= 0 && y0 >= 0 && x1 <= 180 && y1 <= 140, 'no name leaves the canvas');
    left += labels.length - taken.length;
  }
  assert.ok(left > 0 && left < 200 * 16, `${left} left out`);
});

test('the clip of median time is shown, whatever the frames of the others', () => {
  assert.deepEqual(medianClip([[9, 9], [1, 2], [0, 100], [3, 1], [0, 0]]), [3, 1]);
  assert.deepEqual(medianClip([[5], [7]]), [5]);
});
