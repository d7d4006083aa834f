// The engine and the lab in headless Chromium, from files, with the network off.

import assert from 'node:assert/strict';
import { existsSync, writeFileSync } from 'node:fs';
import { after, before, test } from 'node:test';

import { openFile, startBrowser } from './support/chromium.mjs';
import { beatingSphere } from './support/files.mjs';
import { native, plain } from './support/reference.mjs';
import { builtIn, soups, ties } from './support/scenes.mjs';

const folder = new URL('../../build/lab-test/', import.meta.url).pathname;
const lab = new URL('../../build/lab/', import.meta.url).pathname;
let chromium, page;

before(async () => {
  chromium = await startBrowser();
  writeFileSync(`${folder}engine.html`, '<!doctype html><meta charset="utf-8"><title>engine</title><link rel="icon" href="data:,"><script src="engine.js"></script>');
  page = await openFile(chromium.browser, `${folder}engine.html`);
  await page.evaluate(async () => {
    window.engine = await kbvhEngine.createEngine();
    window.load = (config) => engine.load(config);
  });
});
after(async () => {
  await chromium?.close();
});
const nothingWrong = (of = page) => assert.deepEqual(of.wrong, []);

test('the engine starts from a file without a network', async () => {
  const ids = await page.evaluate(async () => (await engine.strategies()).map(({ id }) => id));
  assert.ok(ids.includes('kinetic_aabb'));
  nothingWrong();
});

test('scrubbing forwards, backwards and at random gives equal states', async () => {
  for (const scene of [soups({ seed: 11 }), ...builtIn().slice(0, 2)])
    for (const strategy of ['kinetic_aabb', 'kinetic_boxtree', 'drift_boxes']) {
      const differing = await page.evaluate(async (config) => {
        const { frames } = await load(config);
        const hashes = new Map();
        for (const t of frames) {
          await engine.frame(t);
          hashes.set(t, await engine.checkpoint());
        }
        const wrong = [];
        const ways = [...frames].reverse().concat([...frames].map((_, i) => frames[(i * 7 + 3) % frames.length]));
        for (const t of ways) {
          await engine.frame(t, { positions: true });
          if ((await engine.checkpoint()) !== hashes.get(t)) wrong.push(t);
        }
        return { wrong, states: new Set(hashes.values()).size, frames: frames.length };
      }, { scene, strategy });
      assert.deepEqual(differing.wrong, [], `${scene.name}, ${strategy}`);
      assert.equal(differing.states, differing.frames);
    }
  nothingWrong();
});

test('a timed clip does the work of the frames, without a log of events', async () => {
  for (const scene of builtIn().slice(0, 3))
    for (const strategy of ['kinetic_aabb', 'kinetic_boxtree', 'bottom_up']) {
      const { times, frames, played, timed } = await page.evaluate(async (config) => {
        const { frames } = await load(config);
        let state;
        for (const t of frames) state = await engine.frame(t);
        const played = { counters: state.counters, pairs: [...state.pairs] };
        await load(config);
        const times = await engine.time();
        state = await engine.state();
        return { times, frames: frames.length, played, timed: { counters: state.counters, pairs: [...state.pairs] } };
      }, { scene, strategy });
      assert.equal(times.length, frames);
      assert.ok(times.every((x) => x >= 0));
      assert.deepEqual(timed.pairs, played.pairs, `${scene.name}, ${strategy}`);
      for (const name of ['values_written', 'certificates_failed', 'box_tests', 'nodes_visited'])
        assert.equal(timed.counters[name], played.counters[name], `${scene.name}, ${strategy}: ${name}`);
    }
  nothingWrong();
});

test('events stepped are the native log', async () => {
  for (const scene of [soups({ seed: 2 }), ties(), ...builtIn().slice(0, 1)])
    for (const strategy of ['kinetic_aabb', 'kinetic_separation_list']) {
      const stepped = await page.evaluate(async (config) => {
        const { end } = await load(config);
        const list = [];
        for (;;) {
          const { step } = await engine.event(end, { counters: true });
          if (step === null) return list;
          list.push(step);
        }
      }, { scene, strategy });
      // Serialisation to the test keeps infinities, JSON of the native program does not.
      assert.deepEqual(plain(stepped), native(scene, strategy).events, `${scene.name}, ${strategy}`);
    }
  nothingWrong();
});

test('pairs are those of native brute force at every frame of three scenes', async () => {
  let pairs = 0;
  for (const scene of [soups({ seed: 5 }), soups({ seed: 6, triangles: 40, keyframes: 3 }), ties()]) {
    const expected = native(scene, 'bottom_up').frames.map(({ oracle }) => oracle);
    for (const strategy of ['bottom_up', 'kinetic_aabb', 'linear_bounds', 'interval_join']) {
      const shown = await page.evaluate(async (config) => {
        const { frames } = await load(config);
        const list = [];
        for (const t of frames) list.push([...(await engine.frame(t, { pairs: true })).pairs]);
        return list;
      }, { scene, strategy });
      assert.deepEqual(shown, expected, `${scene.name}, ${strategy}`);
      for (const frame of shown) pairs += frame.length / 4;
    }
  }
  assert.ok(pairs > 100);
  nothingWrong();
});

test('errors of the program arrive with their text', async () => {
  const said = await page.evaluate(async (scene) => {
    const message = (promise) => promise.then(() => 'nothing', (error) => `${error instanceof Error}: ${error.message}`);
    return [await message(load({ scene, strategy: 'nobody' })), await message(engine.frame(-5)), await message(load({ scene, strategy: 'bottom_up', params: { threads: 'x' } }))];
  }, soups());
  assert.match(said[0], /^true: .*'nobody'/);
  assert.match(said[1], /^true: there is no frame at t = -5/);
  assert.match(said[2], /^true: .*'threads'.*'x'/);
  nothingWrong();
});

test('two engines work side by side, and a closed one says so', async () => {
  const said = await page.evaluate(async (scene) => {
    const other = await kbvhEngine.createEngine();
    const both = await Promise.all([load({ scene, strategy: 'kinetic_aabb' }), other.load({ scene, strategy: 'bottom_up' })]);
    const [a, b] = await Promise.all([engine.frame(1.3), other.frame(1.3)]);
    other.close();
    return [both[0].hasEvents, both[1].hasEvents, String(a.pairs) === String(b.pairs), await other.frame(1).catch((error) => error.message)];
  }, soups());
  assert.deepEqual(said, [true, false, true, 'the engine is closed']);
  nothingWrong();
});

test('a glTF file of 20,000 triangles plays', async (t) => {
  const bytes = Buffer.from(beatingSphere(100, 8)).toString('base64');
  const played = await page.evaluate(async (text) => {
    const file = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const scene = await engine.readScene([{ name: 'sphere.glb', bytes: file.buffer }]);
    const out = { triangles: scene.bodies[0].indices.length / 3, rates: {} };
    for (const strategy of ['bottom_up', 'kinetic_aabb', 'linear_bounds']) {
      const { frames } = await load({ scene, strategy });
      const shown = frames.slice(1, 61);
      let nodes = 0, longest = 0, ticked = performance.now();
      const ticks = setInterval(() => {
        longest = Math.max(longest, performance.now() - ticked);
        ticked = performance.now();
      }, 5);
      const begin = performance.now();
      for (const time of shown) {
        const state = await engine.frame(time, { positions: true, flat: true, pairs: true, counters: true });
        if (state.time !== time || state.positions[0].length !== 3 * 10100) throw new Error(`a wrong frame at t = ${time}`);
        nodes = state.hierarchies[0].flat.parent.length;
      }
      const seconds = (performance.now() - begin) / 1000;
      clearInterval(ticks);
      out.rates[strategy] = { perSecond: shown.length / seconds, nodes, pageBlockedFor: longest };
    }
    return out;
  }, bytes);
  assert.equal(played.triangles, 20000);
  for (const [strategy, { perSecond, nodes, pageBlockedFor }] of Object.entries(played.rates)) {
    t.diagnostic(`${strategy}: ${perSecond.toFixed(0)} frames/s with ${nodes} nodes; the page was blocked for ${pageBlockedFor.toFixed(0)} ms at most`);
    assert.ok(nodes > 1000);
    assert.ok(perSecond > 3, `${strategy} plays ${perSecond} frames/s`); // the aim is 30; this machine may be busy
  }
  nothingWrong();
});

for (const file of ['index.html', 'lab.html'])
  test(`the lab opens from ${file}`, { skip: existsSync(lab + file) ? false : 'the lab is not built (experiments/lab)' }, async () => {
    const opened = await openFile(chromium.browser, lab + file);
    await opened.waitForFunction(() => document.querySelector('canvas, svg') !== null && document.querySelector('[data-kbvh-lab-page]').lab?.state.phase === 'ready');
    await opened.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))));
    nothingWrong(opened);
    await opened.close();
  });
