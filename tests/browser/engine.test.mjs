// The engine without a browser: what it computes is what the program computes, whatever way leads to a state.

import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';

import { steps } from '../../analysis/lab/src/engine/decode.js';
import { Host } from '../../analysis/lab/src/engine/host.js';
import { compileEngine } from '../../analysis/lab/src/engine/module.js';
import { beatingSphere, tetrahedron } from './support/files.mjs';
import { expectFrame, native, plain } from './support/reference.mjs';
import { builtIn, numbers, soups, ties } from './support/scenes.mjs';

const folder = new URL('../../build/wasm/', import.meta.url);
const { default: glue } = await import(new URL('kbvh_lab.mjs', folder).href);
const newModule = await compileEngine(glue, readFileSync(new URL('kbvh_lab.wasm', folder)));
const strategies = await new Host(newModule).strategies();
const kinetic = strategies.filter(({ events }) => events).map(({ id }) => id);

async function loaded(config) {
  const host = new Host(newModule);
  const info = await host.load(config);
  return { host, info };
}
/** The message of the error that a call throws. */
async function refusal(call) {
  try {
    await call();
  } catch (error) {
    return error.message;
  }
  return 'nothing was refused';
}

test('strategies are described', () => {
  const ids = strategies.map(({ id }) => id);
  for (const id of ['bottom_up', 'kinetic_aabb', 'kinetic_kdop', 'kinetic_boxtree', 'kinetic_separation_list', 'linear_bounds', 'interval_join',
    'kinetic_envelope', 'kinetic_calendar', 'drift_boxes', 'rebuild', 'lbvh', 'brute_force']) assert.ok(ids.includes(id), id);
  const { title, family, about, parameters } = strategies.find(({ id }) => id === 'kinetic_aabb');
  assert.ok(title.length > 0 && family === 'kinetic' && about.length > 50 && parameters.some(({ name }) => name === 'queue'));
});

test('counters have meanings', async () => {
  const { host } = await loaded({ scene: soups(), strategy: 'kinetic_aabb' });
  const meanings = await host.counters();
  assert.ok(meanings.every(({ name, meaning }) => /^[a-z_]+$/.test(name) && meaning.length > 5));
  const { counters } = host.state();
  for (const { name } of meanings) assert.ok(name in counters, name);
});

test('every strategy shows the bits of the program, in both precisions', async () => {
  let compared = 0;
  for (const scene of [soups(), ties()])
    for (const { id, precisions } of strategies)
      for (const precision of precisions) {
        const expected = native(scene, id, precision);
        const { host, info } = await loaded({ scene, strategy: id, precision });
        assert.deepEqual([...info.frames], expected.frames.map(({ t }) => t));
        for (const frame of expected.frames) {
          host.frame(frame.t);
          expectFrame(host.state(), frame, `${scene.name}, ${id}, ${precision}, t = ${frame.t}`);
          ++compared;
        }
        const events = host.history().flatMap(steps);
        assert.deepEqual(plain(events), expected.events, `${scene.name}, ${id}, ${precision}: events`);
        assert.ok(!info.hasEvents || events.length > 4, `${id} has ${events.length} events`);
      }
  assert.ok(compared > 500);
});

test('pairs are those of native brute force', async () => {
  let pairs = 0;
  for (const scene of [soups({ seed: 7 }), ties(), ...builtIn().slice(0, 3)]) {
    const expected = native(scene, 'bottom_up');
    for (const strategy of ['kinetic_aabb', 'kinetic_separation_list', 'interval_join', 'bottom_up']) {
      const { host } = await loaded({ scene, strategy });
      for (const { t, oracle } of expected.frames) {
        assert.deepEqual([...host.frame(t, { pairs: true }).pairs], oracle, `${scene.name}, ${strategy}, t = ${t}`);
        pairs += oracle.length / 4;
      }
    }
  }
  assert.ok(pairs > 100);
});

test('a state does not depend on the way to it', async () => {
  for (const scene of [soups(), ...builtIn()])
    for (const { id } of strategies) {
      let line;
      try {
        line = await loaded({ scene, strategy: id });
      } catch (error) {
        assert.match(error.message, /cannot answer pairs within one body|does not take|only/, `${scene.name}, ${id}`);
        continue;
      }
      const { host, info } = line;
      const frames = [...info.frames].filter((_, i) => i % 2 === 0).slice(0, 24);
      const times = frames.flatMap((t, i) => (i + 1 < frames.length ? [t, t + (frames[i + 1] - t) * 0.4] : [t]));
      const hashes = times.map((t) => {
        host.frame(t, { counters: true });
        return host.checkpoint();
      });
      assert.ok(new Set(hashes).size === hashes.length, `${scene.name}, ${id}: two states are equal`);
      const check = (i, way) => {
        host.frame(times[i], i % 3 === 0 ? undefined : { positions: true });
        assert.equal(host.checkpoint(), hashes[i], `${scene.name}, ${id}, ${way}: t = ${times[i]}`);
      };
      for (let i = times.length - 1; i >= 0; --i) check(i, 'backwards');
      const next = numbers(5);
      for (let k = 0; k < 12; ++k) check(next() % times.length, 'at random');
    }
});

test('events step forwards and back', async () => {
  for (const scene of [soups(), ties()])
    for (const strategy of kinetic) {
      const { host, info } = await loaded({ scene, strategy });
      const expected = native(scene, strategy).events;
      const before = [];
      for (const [i, event] of expected.entries()) {
        before.push(host.checkpoint());
        const { step, state } = host.event(info.end, { counters: true });
        assert.deepEqual(plain(steps(step)[0]), event, `${strategy}: event ${i}`);
        assert.equal(state.eventsDone, i + 1);
        assert.ok(state.betweenFrames);
        assert.ok(state.time >= event.event.time - event.event.error, `${strategy}: event ${i} is shown before its time`);
      }
      assert.equal(host.event(info.end, { counters: true }).step, null);
      const last = host.checkpoint();
      // At a frame, the state before an event is the frame, which the walk forwards went through without a stop.
      const atFrames = new Set();
      for (let i = expected.length - 1; i >= 0; --i) {
        const state = host.back({ counters: true });
        assert.equal(state.eventsDone, i);
        const hash = host.checkpoint();
        if (hash !== before[i]) {
          assert.ok(!state.betweenFrames, `${strategy}: another state before event ${i}`);
          atFrames.add(i);
        }
      }
      assert.ok(atFrames.size < info.frames.length);
      for (let i = 0; i < expected.length; ++i) host.event(info.end, { counters: true });
      host.event(info.end, { counters: true });
      assert.equal(host.checkpoint(), last, strategy);
    }
});

test('boxes between frames are those of the realisers at the time of the event', async () => {
  const { host, info } = await loaded({ scene: soups(), strategy: 'kinetic_aabb' });
  for (let i = 0; i < 40; ++i) {
    const { state } = host.event(info.end);
    state.hierarchies.forEach(({ bounds, realisers }, body) => {
      for (let k = 0; k < realisers.length; ++k) {
        const side = k % 6, axis = side >> 1;
        const bound = bounds[6 * Math.floor(k / 6) + (side % 2 === 0 ? axis : 3 + axis)];
        assert.equal(bound, state.positions[body][3 * realisers[k] + axis]);
      }
    });
  }
});

test('run stops at the first event that concerns a node, a vertex, a new pair', async () => {
  const scene = soups();
  const { host, info } = await loaded({ scene, strategy: 'kinetic_aabb' });
  const all = native(scene, 'kinetic_aabb').events;
  const { body, node } = all[25].event;
  const stopped = steps(host.run(info.end, { body, node }).stopped)[0];
  assert.equal(stopped.index, all.findIndex(({ touched }) => touched.some((change) => change.body === body && change.node === node)));
  const vertex = all[30].event.loser;
  host.frame(info.begin);
  const first = all.find(({ event, touched }) => event.winner === vertex || event.loser === vertex || touched.some((c) => c.newVertex === vertex || c.oldVertex === vertex));
  assert.equal(steps(host.run(info.end, { vertex }).stopped)[0].index, first.index);
  host.frame(info.begin);
  const before = host.state().pairs.length;
  const { begun, state } = host.run(info.end, { pair: true });
  assert.ok(begun && state.begun.length > 0 && state.pairs.length > 0, `${before}`);
  const nothing = host.run(info.end, { body: 0, node: 100000 });
  assert.equal(nothing.stopped, null);
  assert.equal(nothing.state.time, info.end);
});

test('pairs begin and end against the state shown last', async () => {
  const { host, info } = await loaded({ scene: soups({ seed: 3 }), strategy: 'bottom_up' });
  const key = (pairs) => Array.from({ length: pairs.length / 4 }, (_, i) => pairs.slice(4 * i, 4 * i + 4).join());
  let shown = new Set(key(host.state().pairs)), changes = 0;
  for (const t of [...info.frames, ...[...info.frames].reverse()]) {
    const { pairs, begun, ended } = host.frame(t);
    for (const pair of key(begun)) assert.ok(!shown.has(pair));
    for (const pair of key(ended)) assert.ok(shown.delete(pair));
    for (const pair of key(begun)) shown.add(pair);
    assert.deepEqual(shown, new Set(key(pairs)));
    changes += begun.length + ended.length;
  }
  assert.ok(changes > 0);
});

test('edits are part of the time line', async () => {
  for (const snapshotBytes of [undefined, 0]) await edits(snapshotBytes);
});
/** Without room for copies, everything is replayed from the start. */
async function edits(snapshotBytes) {
  const { host, info } = await loaded({ scene: soups(), strategy: 'kinetic_aabb', snapshotBytes });
  const plan = [{ body: 0, vertex: 4, times: [2], positions: [9, 9, 9], velocity: [1, 0, 0] }];
  const { frames } = info;
  host.frame(frames[3]);
  const untouched = [frames[4], frames[6]].map((t) => {
    host.frame(t);
    return host.checkpoint();
  });
  const middle = (frames[3] + frames[4]) / 2;
  host.frame(middle);
  host.changePlans(plan);
  const edited = host.checkpoint();
  host.edit({ vertices: [0, 1, 2].map((i) => ({ body: 1, position: [i, i * i, 1] })), primitives: [{ body: 1, vertices: [60, 61, 62] }], removedPrimitives: [{ body: 1, id: 3 }] });
  const inserted = host.state();
  assert.equal(inserted.positions[1].length, 3 * 63);
  const later = [frames[4], frames[6], frames[8]].map((t) => {
    host.frame(t);
    return host.checkpoint();
  });
  assert.notEqual(later[0], untouched[0]);
  assert.deepEqual([...host.frame(2).positions[0].slice(12, 15)], [9, 9, 9]);
  host.frame((frames[1] + frames[2]) / 2); // the detour takes a copy, for which that of the edit has to go
  [frames[4], frames[6], frames[8]].forEach((t, i) => {
    host.frame(t);
    assert.equal(host.checkpoint(), later[i], `replay after edits, t = ${t}`);
  });
  host.frame(frames[2]);
  host.changePlans([{ body: 0, vertex: 0, velocity: [0, 0, 1] }]); // takes the later edits back
  assert.equal(host.frame(frames[6]).positions[1].length, 3 * 60);
  assert.notEqual(host.checkpoint(), untouched[1]);
  host.frame(middle);
  assert.notEqual(host.checkpoint(), edited);
  const stands = host.checkpoint();
  assert.match(await refusal(() => host.changePlans([{ body: 0, vertex: 999, velocity: [0, 0, 0] }])), /999/);
  assert.match(await refusal(() => host.edit({ removedPrimitives: [{ body: 0, id: 77 }] })), /77/);
  assert.equal(host.checkpoint(), stands, 'a refused edit changes nothing');
}

test('an edit after single events happens at the time of the last one', async () => {
  const { host, info } = await loaded({ scene: soups(), strategy: 'kinetic_aabb', snapshotBytes: 0 });
  for (let i = 0; i < 9; ++i) host.event(info.end, { counters: true });
  const { time } = host.state();
  const between = host.checkpoint();
  assert.match(await refusal(() => host.changePlans([{ body: 0, vertex: 1, times: [0], positions: [0, 0, 0] }])), /0/);
  assert.equal(host.checkpoint(), between, 'a refused edit changes nothing');
  const state = host.changePlans([{ body: 0, vertex: 1, velocity: [0, 2, 0] }]);
  assert.equal(state.time, time);
  assert.ok(!state.betweenFrames);
  host.frame(info.end);
  const end = host.checkpoint();
  const count = host.state().eventsDone;
  assert.equal(host.history().flatMap(steps).length, count);
  host.history().flatMap(steps).forEach(({ index }, i) => assert.equal(index, i));
  assert.equal(host.history(count - 3).flatMap(steps).filter(({ index }) => index >= count - 3).length, 3);
  host.frame((info.frames[0] + info.frames[1]) / 2);
  host.frame(info.end);
  assert.equal(host.checkpoint(), end);
});

test('wrong input is refused with the place and the value', async () => {
  const host = new Host(newModule);
  const load = (change, more = {}) => refusal(() => {
    const scene = soups();
    change(scene);
    return host.load({ scene, strategy: 'kinetic_aabb', ...more });
  });
  assert.match(await refusal(() => host.frame(1)), /call load first/);
  assert.match(await load((s) => { s.format = 'obj'; }), /format is "obj"/);
  assert.match(await load((s) => { s.version = 2; }), /version is 2/);
  assert.match(await load((s) => { s.bodies = []; }), /no bodies/);
  assert.match(await load((s) => { s.bodies[1].indices[4] = 60; }), /bodies\[1\]\.indices\[4\] is 60/);
  assert.match(await load((s) => { s.bodies[0].indices.pop(); }), /bodies\[0\]\.indices has 59 numbers/);
  assert.match(await load((s) => { s.bodies[0].times[2] = 1; }), /bodies\[0\]\.times\[2\] is 1, not later than 1/);
  assert.match(await load((s) => { s.bodies[0].positions[1][7] = null; }), /bodies\[0\]\.positions\[1\]\[7\] is null/);
  assert.match(await load((s) => { s.bodies[0].positions[1].pop(); }), /positions\[1\] has 179 numbers, not 180/);
  assert.match(await load((s) => { s.bodies[0].offsets = [0, 3, 3, 60]; }), /offsets\[2\] is 3, not above 3/);
  assert.match(await load((s) => { s.pairs = [[0, 2]]; }), /pairs\[0\]\[1\] is 2/);
  assert.match(await load((s) => { s.dimension = 2; }), /z = .* in a scene of two dimensions/);
  assert.match(await load((s) => { s.frames = { l: 0 }; }), /frames\.l is 0/);
  assert.match(await load((s) => { s.bodies[0].positions[0][0] = 1e200; }), /1e\+?200|admissible/);
  assert.match(await load(() => {}, { strategy: 'nobody' }), /'nobody'/);
  assert.match(await load(() => {}, { params: { queue: 'x' } }), /'queue'.*'x'/);
  assert.match(await load(() => {}, { precision: 'half' }), /half/);
  assert.match(await load(() => {}, { topology: { width: 3 } }), /width 3/);
  assert.match(await load(() => {}, { t0: NaN }), /t0 is NaN/);
  assert.equal(await load(() => {}), 'nothing was refused');
  assert.match(await refusal(() => host.frame(-1)), /before the start/);
  assert.match(await refusal(() => host.frame(Infinity)), /no frame at t = Infinity/);
  assert.match(await load((s) => { s.version = 3; }), /version is 3/);
  assert.equal(host.frame(1).time, 1, 'after a refused load the old scene stays');
  await host.load({ scene: soups(), strategy: 'bottom_up' });
  assert.match(await refusal(() => host.event(1)), /no events/);
});

test('own files are read by the readers of the program', async () => {
  const host = new Host(newModule);
  const { obj, pc2 } = tetrahedron();
  const scene = await host.readScene([{ name: 'tet.obj', bytes: obj }, { name: 'tet.pc2', bytes: pc2 }], { framesPerSecond: 10 });
  assert.deepEqual([...scene.bodies[0].times], [0, 0.1, 0.2]);
  assert.equal(scene.bodies[0].vertices, 4);
  const info = await host.load({ scene, strategy: 'kinetic_aabb' });
  assert.equal(host.frame(info.end).positions[0][2], 2);
  const sphere = await host.readScene([{ name: 'sphere.glb', bytes: beatingSphere(12, 4) }]);
  assert.equal(sphere.bodies[0].indices.length, 3 * 288);
  assert.equal(sphere.bodies[0].times.length, 4);
  assert.match(await refusal(() => host.readScene([{ name: 'x.stl', bytes: obj }])), /no mesh among x\.stl/);
  assert.match(await refusal(() => host.readScene([{ name: '../x.obj', bytes: obj }])), /not the name of a file/);
  assert.match(await refusal(() => host.readScene([{ name: 'x.obj', bytes: new TextEncoder().encode('v 1 2\n') }])), /x\.obj.*line 1/);
  assert.match(await refusal(() => host.readScene([{ name: 'x.glb', bytes: beatingSphere(4, 2).slice(0, 200) }])), /x\.glb/);
});
