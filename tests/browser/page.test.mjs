// The page of the lab in Chromium: what a user does with keys and pointer, and that every view follows.

import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';

import { built, startBrowser } from './support/page.mjs';

let browser;
before(async () => { browser = await startBrowser(); });
after(() => browser.close());

let kept = null; // the tab of the tests that leave the lab as they found it
/**
 * Shows a scene for one test and checks afterwards that nothing went wrong on the page. A test that needs a page as it is loaded, or changes
 * more than the lab's state, says `fresh`; the others share a tab.
 */
async function withPage(options, job, { expected = [], fresh = false } = {}) {
  const opened = fresh || !kept ? await browser.open(options) : kept;
  if (opened === kept) await kept.show(options);
  if (!fresh) kept = null; // a test that fails leaves no tab
  await job(opened);
  const unexpected = opened.problems.filter((text) => !expected.some((pattern) => pattern.test(text)));
  assert.deepEqual(unexpected, []);
  if (fresh) await opened.page.close();
  else kept = opened;
}
const press = async ({ page, settle }, ...keys) => {
  for (const key of keys) await page.keyboard.press(key);
  await settle();
};
const summary = (lab) => ({ time: lab.state.at.time, events: lab.state.at.eventsDone, history: lab.state.history.length, phase: lab.state.phase, selection: lab.state.selection });

test('a choice that is made while another one loads adds to it', () => withPage({ hash: '#scene=overtake-8' }, async ({ page, lab, settle }) => {
  await page.evaluate(() => {
    const [scene, strategy] = document.querySelectorAll('.lab-head select');
    const choose = (select, value) => { select.value = value; select.dispatchEvent(new Event('change', { bubbles: true })); };
    choose(strategy, 'bottom_up');
    choose(scene, 'ties-6');
  });
  await settle();
  assert.deepEqual(await lab(({ state }) => [state.strategy, state.sceneId, state.phase]), ['bottom_up', 'ties-6', 'ready']);
}, { fresh: true }));

test('a first visitor gets a hint and a tour, once', () => withPage({ hash: '#scene=overtake-8' }, async ({ page, lab, settle }) => {
  const press = async (text) => {
    await page.evaluate((text) => [...document.querySelectorAll('.first-hint button, .tour button, .lab-head button')].find((button) => button.textContent === text).click(), text);
    await settle();
  };
  assert.ok(await page.$('.first-hint'));
  await press('Take the tour');
  assert.equal(await page.$('.first-hint'), null);
  const cards = [];
  for (;;) {
    cards.push(await page.evaluate(() => {
      const card = document.querySelector('.tour'), view = document.querySelector('.kbvh-lab').dataset.tour;
      const place = document.querySelector(view === 'transport' ? '.transport' : `.panel-${view}`), a = place.getBoundingClientRect(), b = card.getBoundingClientRect();
      return { view, focus: card.contains(document.activeElement), framed: parseFloat(getComputedStyle(place).outlineWidth) >= 2,
        hidden: Math.max(0, Math.min(a.right, b.right) - Math.max(a.left, b.left)) * Math.max(0, Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top)) / (a.width * a.height),
        seen: a.top >= -1 && b.bottom <= innerHeight + 1, words: card.querySelector('p').textContent.split(/\s+/).length };
    }));
    if (await page.evaluate(() => !document.querySelector('.tour .next') || document.querySelector('.tour .next').textContent === 'Done')) break;
    await press('Next');
  }
  assert.equal(cards.length, 8);
  for (const { view, focus, framed, hidden, seen } of cards) assert.ok(focus && framed && seen && hidden < 0.1, `${view}: ${JSON.stringify(cards)}`);
  assert.ok(cards.reduce((sum, { words }) => sum + words, 0) < 240, 'readable in a minute');
  assert.deepEqual(await lab(({ state }) => [state.at.eventsDone > 0, state.compare.strategy]), [true, 'bottom_up']);
  await press('Done');
  assert.equal(await page.$('.tour'), null);
  await page.reload();
  await page.waitForFunction(() => document.querySelector('[data-kbvh-lab-page]')?.lab?.state.at);
  assert.equal(await page.$('.first-hint'), null);
  await press('Tour');
  await page.keyboard.press('Escape');
  await settle();
  assert.equal(await page.$('.tour'), null);
}, { fresh: true }));

test('panels that a strategy without events, or without a tree, cannot fill say what they would show', () => withPage({ hash: '#scene=overtake-8' }, async ({ page, lab, settle }) => {
  const unfilled = () => page.evaluate(() => [...document.querySelectorAll('.unfilled')].map((element) => element.closest('.panel').className.match(/panel-(\w+)/)[1]).sort());
  await lab((lab) => lab.choose('bottom_up'));
  await settle();
  assert.deepEqual(await unfilled(), ['tabs', 'timeline']);
  assert.equal(await page.$('.gauge'), null, 'gauges of a kinetic structure go');
  assert.equal(await page.$('[aria-label="One event forwards"]'), null);
  await lab((lab) => lab.choose('brute_force'));
  await settle();
  assert.deepEqual(await unfilled(), ['diagram', 'tabs', 'timeline', 'tree']);
  for (const text of await page.$$eval('.unfilled', (all) => all.map((element) => element.textContent))) assert.match(text, /here/);
  await page.click('.panel-timeline .unfilled button');
  await settle();
  assert.deepEqual([await unfilled(), await lab(({ state }) => state.strategy)], [[], 'kinetic_aabb']);
  assert.ok(await page.$('.gauge'));
}));

test('settings, messages and captions have words, no ids; headings have units', () => withPage({ hash: '#scene=overtake-8' }, async ({ page, lab, settle }) => {
  await page.evaluate(() => [...document.querySelectorAll('.lab-head button')].find((button) => button.textContent === 'Settings').click());
  for (const strategy of await lab(({ state }) => state.strategies.map(({ id }) => id))) {
    const tasks = await lab(async (lab, strategy) => {
      const seen = new Set(), end = lab.on('state', ({ task }) => seen.add(task));
      await lab.choose(strategy);
      await lab.comparison.set({ strategy });
      await lab.comparison.set(null);
      end();
      return [...seen];
    }, strategy);
    await settle();
    const text = await page.$eval('.settings', (settings) => [...settings.querySelectorAll('label')].map((label) => label.textContent).join(' '));
    assert.doesNotMatch(`${text} ${tasks.join(' ')}`, /\w_\w/, strategy);
  }
  await lab(async (lab) => { await lab.choose('kinetic_aabb'); lab.view({ panel: 'box' }); });
  await settle();
  assert.deepEqual(await page.$$eval('.sides thead th', (heads) => heads.map((head) => head.textContent)), ['Side', 'Value, units', 'Realised by', 'Since, s', 'Until, s']);
  await lab(async (lab) => { lab.view({ panel: 'work' }); await lab.comparison.set({ strategy: 'bottom_up' }); });
  await page.waitForFunction(() => /Time in the engine, ms/.test(document.querySelector('.multiples')?.textContent ?? ''));
}, { fresh: true }));

test('at 1280 pixels no select of the bars is cut', () => withPage({ hash: '#scene=cloth-on-box', width: 1280, height: 800 }, async ({ page, lab, settle }) => {
  for (const strategy of ['kinetic_aabb', 'kinetic_separation_list', 'bottom_up']) {
    await lab((lab, strategy) => lab.choose(strategy), strategy);
    await lab((lab) => lab.select({ vertex: 123, node: 1234 }));
    await settle();
    const cut = await page.evaluate(() => [...document.querySelectorAll('.lab-head select, .transport select, .panel-tools select')].map((select) => {
      const probe = document.createElement('span'), style = getComputedStyle(select);
      probe.style.cssText = `position: absolute; visibility: hidden; white-space: nowrap; font: ${style.font}`;
      probe.textContent = select.selectedOptions[0].textContent;
      document.body.append(probe);
      const needed = probe.getBoundingClientRect().width + parseFloat(style.paddingLeft) + 18;
      probe.remove();
      return { text: probe.textContent, needed, has: select.getBoundingClientRect().width };
    }).filter(({ needed, has }) => needed > has + 0.5));
    assert.deepEqual(cut, [], strategy);
  }
}));

test('no panel lies over another one, and none is cut, at 1280 pixels and on a phone', async () => {
  for (const [width, height] of [[1280, 800], [820, 1100], [390, 844]])
    await withPage({ hash: '#scene=cloth-on-box', width, height }, async ({ page, lab, settle }) => {
      for (const compare of [null, { strategy: 'bottom_up' }]) {
        await lab((lab, compare) => { lab.view({ panel: 'box' }); return lab.comparison.set(compare); }, compare);
        await settle();
        const wrong = await page.evaluate(() => {
          const panels = [...document.querySelectorAll('.panel')].map((panel) => ({ name: panel.getAttribute('aria-label'), box: panel.getBoundingClientRect(), panel }));
          const over = panels.flatMap((a, i) => panels.slice(0, i).filter((b) => Math.min(a.box.right, b.box.right) - Math.max(a.box.left, b.box.left) > 1 && Math.min(a.box.bottom, b.box.bottom) - Math.max(a.box.top, b.box.top) > 1).map((b) => `${a.name} over ${b.name}`));
          const canvases = panels.flatMap(({ name, panel, box }) => [...panel.querySelectorAll('canvas')].filter((canvas) => !canvas.closest('.multiple') && canvas.getBoundingClientRect().bottom > box.bottom + 1).map(() => `a canvas of ${name} sticks out`));
          const table = document.querySelector('.sides').parentElement;
          return [...over, ...canvases, ...(table.scrollWidth > table.clientWidth + 1 ? [`the table of sides is cut: ${table.scrollWidth} in ${table.clientWidth}`] : [])];
        });
        assert.deepEqual(wrong, [], `${width}, ${compare?.strategy}`);
      }
    });
});

test('the gauge of locality has no number where a tree inherits sides', () => withPage({ hash: '#scene=overtake-8' }, async ({ page, lab, settle }) => {
  const local = () => page.$eval('.gauge-local .gauge-value b', (value) => value.textContent);
  assert.equal(await local(), '14');
  await lab((lab) => lab.choose('kinetic_boxtree'));
  await settle();
  assert.equal(await local(), '–');
}));

test('on a phone the transport stays in sight and takes little of it', () => withPage({ hash: '#scene=overtake-8', width: 390, height: 844 }, async ({ page }) => {
  for (const share of [0, 0.3, 0.6, 1]) {
    const { top, bottom, play } = await page.evaluate(async (share) => {
      scrollTo(0, share * (document.documentElement.scrollHeight - innerHeight));
      await new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve)));
      const box = document.querySelector('.transport').getBoundingClientRect(), play = document.querySelector('.transport .play').getBoundingClientRect();
      return { top: box.top, bottom: box.bottom, play: document.elementFromPoint(play.x + play.width / 2, play.y + play.height / 2)?.className };
    }, share);
    assert.ok(top >= -0.5 && bottom <= 844 && play === 'play', `${share}: ${top} to ${bottom}, ${play}`);
    assert.ok(bottom - top < 110, `it is ${bottom - top} high`);
  }
}));

test('keys alone: frames, events, break points, tree, timeline, panels', () => withPage({ hash: '#scene=overtake-8' }, async (opened) => {
  const { page, lab } = opened;
  await page.focus('[data-view=tree]');
  await press(opened, '.', '.', '.');
  assert.equal((await lab(summary)).time, await lab(({ state }) => state.frames[3]));
  const start = await lab(summary);
  await press(opened, 'n', 'n');
  assert.equal((await lab(summary)).events, start.events + 2);
  await press(opened, 'p', 'p');
  assert.equal((await lab(summary)).events, start.events);
  await press(opened, 'Home');
  assert.equal((await lab(summary)).time, 0);

  await lab((lab) => lab.select({ node: 0 }));
  await press(opened, 'ArrowDown', 'ArrowRight');
  const { node } = (await lab(summary)).selection;
  assert.equal(node, await lab(({ state }) => state.trees[0].kids(0)[1]));
  await press(opened, 'b');
  assert.ok(await lab(({ state }, node) => state.step?.touched.some((change) => change.node === node), node), 'stopped at an event of the node');
  await press(opened, 'v', 'v', 'B');
  assert.ok(await lab(({ state }) => [state.step?.event.winner, state.step?.event.loser].includes(state.selection.vertex)
    || state.step === null), 'stopped at an event of the vertex');

  await page.focus('[data-view=timeline]');
  await press(opened, 'ArrowRight');
  assert.ok((await lab(summary)).selection.event, 'the timeline chooses an event');
  assert.match(await page.$eval('.story', (story) => story.textContent), /Which certificate/);
  for (const [key, panel] of [['2', 'box'], ['3', 'pairs'], ['4', 'counters'], ['5', 'edit'], ['6', 'work'], ['1', 'why']]) {
    await press(opened, key);
    assert.equal(await page.$eval('[role=tab][aria-selected=true]', (tab) => tab.dataset.tab), panel);
  }
  await press(opened, '?');
  assert.ok(await page.$('dialog[open]'));
  await press(opened, 'Escape');
  assert.equal(await page.$('dialog[open]'), null);
}));

test('Tab reaches every view, and focus is visible', () => withPage({ hash: '#scene=overtake-8' }, async ({ page }) => {
  const seen = new Set();
  for (let k = 0; k < 90; ++k) {
    await page.keyboard.press('Tab');
    const at = await page.evaluate(() => {
      const element = document.activeElement, style = getComputedStyle(element);
      return { view: element.dataset.view ?? element.getAttribute('role') ?? element.tagName, outline: style.outlineStyle !== 'none' && parseFloat(style.outlineWidth) >= 2, body: element === document.body, html: element.outerHTML.slice(0, 80) };
    });
    if (at.body) break;
    assert.ok(at.outline, `no visible focus on ${at.html}`);
    seen.add(at.view);
  }
  for (const view of ['stage', 'tree', 'timeline', 'diagram', 'tab']) assert.ok(seen.has(view), `${view} was not reached: ${[...seen]}`);
}, { fresh: true }));

test('every control and picture has a name', () => withPage({ hash: '#scene=swarms-12' }, async ({ page, lab, settle }) => {
  for (const panel of ['why', 'box', 'pairs', 'counters', 'edit', 'work']) {
    await lab((lab, panel) => lab.view({ panel }), panel);
    await settle();
    const nameless = await page.evaluate(() => [...document.querySelectorAll('button, select, input, [role=img], [role=tree], [role=slider], [role=meter]')]
      .filter((element) => !(element.getAttribute('aria-label') || element.textContent.trim() || element.closest('label')?.textContent.trim() || element.title)).map((element) => element.outerHTML.slice(0, 100)));
    assert.deepEqual(nameless, [], panel);
  }
}));

test('scrubbing: the same time shows the same state, from both sides', () => withPage({ hash: '#scene=overtake-8' }, async ({ page, lab, settle }) => {
  const times = [0.3, 1.7, 0.9, 1.1, 0.3, 2, 0, 1.7, 1.1];
  const hashes = new Map();
  const scrub = await page.$('.scrub');
  const box = await scrub.boundingBox();
  for (const t of times) {
    await lab((lab, t) => lab.seek(t), t);
    await settle();
    const now = await lab(async (lab) => [await lab.engine.checkpoint(), lab.state.history.length, JSON.stringify(lab.state.trees[0].realisers)].join());
    if (hashes.has(t)) assert.equal(now, hashes.get(t), `t = ${t}`);
    hashes.set(t, now);
  }
  assert.ok(new Set(hashes.values()).size >= 5);
  await page.mouse.move(box.x + 8, box.y + box.height / 2);
  await page.mouse.down();
  for (let k = 1; k <= 20; ++k) await page.mouse.move(box.x + 8 + (box.width - 16) * k / 20, box.y + box.height / 2);
  await page.mouse.up();
  await settle();
  assert.ok(await lab(({ state }) => state.at.time) > 1.9, 'dragging the slider ends near the end');
  assert.equal(await lab((lab) => lab.engine.checkpoint().then((hash) => lab.seek(lab.state.at.time).then(() => lab.engine.checkpoint()).then((again) => again === hash))), true);
}));

test('single events: taking back and performing again gives equal states', () => withPage({ hash: '#scene=points-64' }, async ({ lab }) => {
  assert.deepEqual(await lab(async (lab) => {
    await lab.seek(0.5);
    const forwards = [], back = [];
    for (let k = 0; k < 12; ++k) { forwards.push(await lab.engine.checkpoint()); await lab.event(1); }
    for (let k = 0; k < 12; ++k) { await lab.event(-1); back.unshift(await lab.engine.checkpoint()); }
    const wrong = forwards.map((hash, k) => hash === back[k] ? -1 : k).filter((k) => k > 0);
    return { wrong, different: new Set(forwards).size };
  }), { wrong: [], different: 12 });
}));

test('run to: node, vertex, pair; the end of the clip is said', () => withPage({ hash: '#scene=swarms-12' }, async ({ lab }) => {
  const result = await lab(async (lab) => {
    await lab.seek(0);
    await lab.runTo({ pair: true });
    const pair = { time: lab.state.at.time, pairs: lab.state.at.pairs.length, notice: lab.state.notice };
    await lab.seek(lab.state.info.end);
    await lab.runTo({ body: 0, node: 0 });
    return { pair, end: lab.state.notice };
  });
  assert.ok(result.pair.pairs > 0 && result.pair.time > 0 && /pair begins/.test(result.pair.notice), JSON.stringify(result));
  assert.match(result.end, /ended before/);
}));

test('a link keeps the whole state', () => withPage({ hash: '#scene=overtake-8' }, async ({ page, lab }) => {
  const given = await lab(async (lab) => {
    await lab.choose('kinetic_boxtree');
    await lab.editing.apply('setKeyframe', { body: 0, vertex: 3, keyframe: 1, position: [2.5, 1.25, 0] });
    await lab.comparison.set({ strategy: 'bottom_up' });
    await lab.seek(0.6);
    await lab.event(1);
    await lab.event(1);
    lab.select({ node: 2, side: 3, vertex: 5 });
    lab.view({ panel: 'box', boxes: 'path', theme: 'dark' });
    await lab.chain;
    return { state: lab.getState(), hash: await lab.engine.checkpoint() };
  });
  assert.equal(given.state.events > 0, true);
  await page.click('[data-action=link]');
  await page.waitForFunction(() => location.hash.startsWith('#s='));
  const hash = await page.evaluate(() => location.hash);
  const second = await browser.open({ hash });
  await second.settle();
  const again = await second.lab(async (lab) => ({ state: lab.getState(), hash: await lab.engine.checkpoint() }));
  assert.deepEqual(again.state, given.state);
  assert.equal(again.hash, given.hash);
  // The same state, compact, in a frame of another page.
  const code = await page.$eval('.share-code', (field) => field.value);
  assert.match(code, /^<iframe src="[^"]+#embed=/);
  const third = await browser.open({ hash: /(#embed=[^"]+)"/.exec(code)[1] });
  await third.settle();
  const { view, ...rest } = await third.lab((lab) => lab.getState()), { view: _, ...wanted } = given.state;
  assert.deepEqual(rest, wanted);
  assert.deepEqual(await third.page.evaluate(() => [document.querySelector('.kbvh-lab.compact') !== null, document.querySelector('.lab-head h1')]), [true, null]);
  await third.page.close();
  assert.deepEqual(second.problems, []);
  await second.page.close();
}, { fresh: true }));

test('a saved file keeps the whole state, and the page in one file reads it', () => withPage({ hash: '#scene=strip-4' }, async ({ lab }) => {
  const saved = await lab(async (lab) => { await lab.seek(0.5); await lab.event(1); lab.view({ panel: 'box' }); return lab.getState(); });
  const second = await browser.open({ file: built.replace('index.html', 'lab.html') });
  await second.page.evaluate((text) => {
    const data = new DataTransfer();
    data.items.add(new File([text], 'state.kbvh-lab.json'));
    document.querySelector('.kbvh-lab').dispatchEvent(new DragEvent('drop', { dataTransfer: data, bubbles: true, cancelable: true }));
  }, JSON.stringify(saved));
  await second.page.waitForFunction(() => document.querySelector('[data-kbvh-lab-page]').lab.state.sceneId === 'strip-4');
  await second.settle();
  assert.deepEqual(await second.lab((lab) => lab.getState()), saved);
  assert.deepEqual(second.problems, []);
  await second.page.close();
}));

test('damaged links and wrong files are refused in words, and nothing is lost', () => withPage({ hash: '#s=abcdefg' }, async ({ page, lab, settle }) => {
  assert.match(await page.$eval('.banner.error', (banner) => banner.textContent), /damaged/);
  const drop = (name, text) => page.evaluate((name, text) => {
    const data = new DataTransfer();
    data.items.add(new File([text], name));
    document.querySelector('.kbvh-lab').dispatchEvent(new DragEvent('drop', { dataTransfer: data, bubbles: true, cancelable: true }));
  }, name, text);
  const scene = await lab(({ state }) => state.scene.name);
  for (const [name, text, pattern] of [['bad.obj', 'v 0 0\nf 1 2 3\n', /bad\.obj/], ['bad.json', '{"format": "kbvh-scene"}', /bodies/], ['x.json', '{', /not JSON/], ['notes.txt', 'hello', /notes\.txt/]]) {
    await drop(name, text);
    await page.waitForFunction((name) => document.querySelector('.banner.error')?.textContent.includes(name), {}, name);
    await settle();
    const message = await page.$eval('.banner.error', (banner) => banner.textContent);
    assert.match(message, pattern, name);
    assert.equal(message.split(name).length, 2, `'${message}' names ${name} once`);
    assert.doesNotMatch(await page.$eval('.status', (status) => status.textContent), /Reading/, name);
    assert.equal(await lab(({ state }) => state.scene.name), scene, name);
  }
  await drop('two.obj', 'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\nf 1 2 3\nf 2 3 4\n');
  await page.waitForFunction(() => document.querySelector('[data-kbvh-lab-page]').lab.state.info.bodies[0].primitives === 2);
  assert.equal(await lab(({ state }) => state.info.bodies[0].primitives), 2);
}, { fresh: true, expected: [/bad\.|obj|Error/] }));

test('dragging a vertex recomputes everything; undo brings the scene back', () => withPage({ hash: '#scene=line-4' }, async ({ page, lab, settle }) => {
  await lab(async (lab) => { lab.view({ edit: true, panel: 'edit' }); await lab.seek(2); });
  await settle();
  const first = await lab(({ state }) => ({ x: state.scene.bodies[0].positions[1][0], events: state.history.map((step) => step.event.time) }));
  const canvas = await page.$('[data-view=stage]'), box = await canvas.boundingBox();
  const spot = await page.evaluate(() => {
    // The place of vertex 0 on the stage: found by its fit of the whole clip, as the view does it.
    const canvas = document.querySelector('[data-view=stage]'), { width, height } = canvas.parentElement.getBoundingClientRect();
    const { scene } = document.querySelector('[data-kbvh-lab-page]').lab.state, all = scene.bodies.flatMap((body) => body.positions);
    const range = (axis) => { const values = all.flatMap((p) => p.filter((_, i) => i % 3 === axis)); return [Math.min(...values), Math.max(...values)]; };
    const [x0, x1] = range(0), [y0, y1] = range(1), scale = Math.min((width - 60) / (x1 - x0), (height - 50) / (y1 - y0));
    const [x, y] = scene.bodies[0].positions[1];
    return { x: width / 2 + 14 + (x - (x0 + x1) / 2) * scale, y: height / 2 - 8 - (y - (y0 + y1) / 2) * scale };
  });
  await page.mouse.move(box.x + spot.x, box.y + spot.y);
  await page.mouse.down();
  for (let k = 1; k <= 8; ++k) await page.mouse.move(box.x + spot.x - 12 * k, box.y + spot.y);
  await page.mouse.up();
  await settle();
  const moved = await lab(async (lab) => {
    const fresh = await kbvhLab.createEngine(), { state } = lab;
    await fresh.load({ scene: state.scene, strategy: state.strategy, params: state.params, topology: state.topology });
    await fresh.frame(state.at.time);
    const steps = await fresh.history();
    fresh.close();
    return { x: state.scene.bodies[0].positions[1][0], events: state.history.map((step) => step.event.time), fresh: steps.map((step) => step.event.time), undo: state.undo };
  });
  assert.ok(moved.x < first.x - 0.3, `vertex 0 moved from ${first.x} to ${moved.x}`);
  assert.deepEqual(moved.events, moved.fresh);
  assert.notDeepEqual(moved.events, first.events);
  assert.equal(moved.undo, 1);
  await page.keyboard.down('Control');
  await page.keyboard.press('z');
  await page.keyboard.up('Control');
  await settle();
  assert.deepEqual(await lab(({ state }) => ({ x: state.scene.bodies[0].positions[1][0], events: state.history.map((step) => step.event.time) })), first);
}));

test('dragging a keyframe in the diagram, and a vertex in space', () => withPage({ hash: '#scene=overtake-8' }, async ({ page, lab, settle }) => {
  await lab(async (lab) => { lab.view({ edit: true }); lab.select({ node: 0, side: 1, vertex: 1 }); await lab.seek(0.5); });
  await settle();
  const diagram = await (await page.$('[data-view=diagram]')).boundingBox();
  const knot = await lab(({ state }, width, height) => {
    // The place of vertex 1's second keyframe, by the margins of the diagram around the whole clip.
    const xs = state.scene.bodies[0].positions.flatMap((p) => p.filter((_, i) => i % 3 === 0)), low = Math.min(...xs), high = Math.max(...xs), more = (high - low) * 0.07;
    return { x: 52 + (1 + 0.03) / (2 + 0.06) * (width - 92), y: 14 + (high + more - state.scene.bodies[0].positions[1][3]) / (high - low + 2 * more) * (height - 50), unit: (height - 50) / (high - low + 2 * more), value: state.scene.bodies[0].positions[1][3] };
  }, diagram.width, diagram.height);
  await page.mouse.move(diagram.x + knot.x, diagram.y + knot.y);
  await page.mouse.down();
  for (let k = 1; k <= 6; ++k) await page.mouse.move(diagram.x + knot.x, diagram.y + knot.y + 15 * k);
  await page.mouse.up();
  await settle();
  const moved = await lab(({ state }) => ({ value: state.scene.bodies[0].positions[1][3], undo: state.undo }));
  assert.ok(Math.abs(moved.value - (knot.value - 90 / knot.unit)) < 4 / knot.unit, `${knot.value} became ${moved.value}`);
  assert.equal(moved.undo, 1);

  await lab(async (lab) => { await lab.setState({ format: 'kbvh-lab', version: 1, sceneId: 'points-64', time: 0, view: { edit: true } }); });
  await settle();
  await page.waitForFunction(() => document.querySelector('.space canvas'));
  const stage = await (await page.$('[data-view=stage]')).boundingBox();
  let spot = null;
  for (let y = 30; y < stage.height - 10 && !spot; y += 12)
    for (let x = 20; x < stage.width - 20 && !spot; x += 12) {
      await page.mouse.move(stage.x + x, stage.y + y);
      await page.mouse.down();
      if (await lab(({ state }) => state.undo) > 0) spot = { x: stage.x + x, y: stage.y + y };
      else await page.mouse.up();
    }
  assert.ok(spot, 'a vertex was found on the stage');
  const before = await lab(({ state }) => state.scene.bodies[0].positions[0].slice(3 * state.selection.vertex, 3 * state.selection.vertex + 3));
  for (let k = 1; k <= 5; ++k) await page.mouse.move(spot.x + 5 * k, spot.y - 5 * k);
  await page.mouse.up();
  await settle();
  const after = await lab(({ state }) => state.scene.bodies[0].positions[0].slice(3 * state.selection.vertex, 3 * state.selection.vertex + 3));
  assert.ok(Math.hypot(...after.map((x, axis) => x - before[axis])) > 0.05, `${before} became ${after}`);
  assert.ok(after[2] > before[2], 'upwards on the screen is upwards in space');
}));

test('editing: keyframes, insertion, deletion, ties, and what is refused', () => withPage({ hash: '#scene=strip-4' }, async ({ page, lab, settle }) => {
  const check = async (name, options) => lab(async (lab, name, options) => {
    await lab.editing.apply(name, options);
    const { scene, info, error } = lab.state, body = scene.bodies[0];
    return { vertices: info.bodies[0].vertices, primitives: info.bodies[0].primitives, times: body.times, bodies: info.bodies.length, error };
  }, name, options);
  assert.deepEqual((await check('addKeyframe', { body: 0, time: 0.5 })).times, [0, 0.5, 1, 2]);
  assert.deepEqual((await check('setKeyframeTime', { body: 0, keyframe: 1, time: 0.25 })).times, [0, 0.25, 1, 2]);
  assert.deepEqual((await check('removeKeyframe', { body: 0, keyframe: 1 })).times, [0, 1, 2]);
  assert.equal((await check('addFreeTriangle', { body: 0, position: [1, 2, 0], size: 0.3 })).primitives, 5);
  assert.deepEqual(await check('removeVertex', { body: 0, vertex: 0 }).then(({ vertices, primitives }) => [vertices, primitives]), [8, 4]);
  assert.equal((await check('removePrimitive', { body: 0, primitive: 0 })).primitives, 3);
  assert.equal((await check('addBody', { shape: 'polygons', position: [0, 0, 0], times: [0, 2] })).bodies, 2);
  assert.equal((await check('removeBody', { body: 1 })).bodies, 1);
  assert.match((await check('setKeyframeTime', { body: 0, keyframe: 1, time: 9 })).error, /must stay between 0 s and 2 s; 9 s is not/);
  assert.match((await check('setKeyframe', { body: 0, vertex: 99, keyframe: 0, position: [0, 0, 0] })).error, /no vertex 99/);
  // A typed coordinate reaches the scene.
  await lab(async (lab) => { lab.view({ panel: 'edit' }); lab.select({ vertex: 1 }); });
  await settle();
  const field = await page.$('[aria-label="x at keyframe 1"]');
  await field.click({ clickCount: 3 });
  await page.keyboard.type('1.75');
  await page.keyboard.press('Tab');
  await settle();
  assert.equal(await lab(({ state }) => state.scene.bodies[0].positions[1][3]), 1.75);
}));

test('ties are labelled, with the exact time', () => withPage({ hash: '#scene=ties-6' }, async ({ page, lab, settle }) => {
  await lab(async (lab) => { await lab.seek(0.9); await lab.event(1); });
  await settle();
  const story = await page.$eval('.story', (story) => story.textContent);
  assert.match(story, /Exact tie/);
  assert.match(story, /1 s, exactly/);
}));

test('why: the story of an event of the line', () => withPage({ hash: '#scene=line-4' }, async ({ page, lab, settle }) => {
  const step = await lab(async (lab) => { await lab.seek(0); lab.select({ node: 0, side: 1 }); await lab.runTo({ body: 0, node: 0 }); return lab.state.step; });
  await settle();
  const story = await page.$eval('.story', (story) => story.textContent.replace(/\s+/g, ' '));
  assert.match(story, new RegExp(`x of vertex ${step.event.winner} [≥≤] x of vertex ${step.event.loser}`));
  for (const change of step.touched) assert.ok(story.includes(`node ${change.node}`), story);
  for (const event of step.rescheduled) assert.ok(story.includes(`vertex ${event.loser} overtakes vertex ${event.winner}`), story);
  assert.ok(step.touched.length > 0);
}));

test('a box knows who realises its sides, since when and until when', () => withPage({ hash: '#scene=overtake-8' }, async ({ lab }) => {
  const wrong = await lab(async (lab) => {
    // From the table at 0.7 s to the next change of each side of the root: the realiser must change exactly then.
    const wrong = [];
    await lab.seek(0.7);
    lab.view({ panel: 'box' });
    lab.select({ node: 0 });
    await new Promise((resolve) => setTimeout(resolve, 100));
    const rows = [...document.querySelectorAll('.sides tbody tr')].map((row) => [...row.children].map((cell) => cell.textContent.trim()));
    for (const [side, row] of rows.entries()) {
      const vertex = Number(row[2].replace('vertex ', '')), until = parseFloat(row[4]);
      if (Number.isNaN(until)) continue;
      await lab.seek(until - 1e-4);
      if (lab.state.trees[0].realiser(0, side) !== vertex) wrong.push(`${row}: before`);
      await lab.seek(until + 1e-4);
      if (lab.state.trees[0].realiser(0, side) === vertex) wrong.push(`${row}: after`);
    }
    return { wrong, rows: rows.length };
  });
  assert.deepEqual(wrong, { wrong: [], rows: 4 });
}));

test('comparing: one clock, work of every frame', () => withPage({ hash: '#scene=strip-4' }, async ({ page, lab, settle }) => {
  await lab(async (lab) => { await lab.comparison.set({ strategy: 'bottom_up' }); await lab.seek(1.25); });
  await settle();
  await page.waitForFunction(() => { const { lab } = document.querySelector('[data-kbvh-lab-page]'); return lab.state.work?.timed; });
  const result = await lab(({ state }) => ({ time: [state.at.time, state.compare.at.time], pairs: [state.at.pairs.join(), state.compare.at.pairs.join()],
    done: state.work.series.every((s) => s.done === state.frames.length && s.counters.milliseconds.length === state.frames.length && s.counters.milliseconds.every((x) => x >= 0)),
    boxes: [state.trees[0].bounds.join(), state.compare.trees[0].bounds.join()], written: state.work.series.map((s) => s.counters.values_written.reduce((a, b) => a + b, 0)), nodes: state.compare.trees[0].size, frames: state.frames.length }));
  assert.ok(result.done);
  assert.equal(result.time[0], result.time[1]);
  assert.equal(result.pairs[0], result.pairs[1]);
  assert.equal(result.boxes[0], result.boxes[1]);
  assert.ok(result.written[1] >= 6 * result.nodes * (result.frames - 1), JSON.stringify(result.written));
  assert.ok(result.written[0] < result.written[1]);
  // Totals stand there once both have been counted, not before.
  const told = () => page.$$eval('.multiple', (all) => all.map((one) => `${one.querySelector('figcaption span').textContent} ${one.querySelector('.verdict').textContent}`));
  await lab((lab) => lab.view({ panel: 'work' }));
  await settle();
  const whole = await told();
  assert.ok(whole.length > 3 && whole.every((text) => /^[\d.]+( [kM])? : [\d.]+/.test(text)), whole.join(', '));
  await lab((lab) => { const { series } = lab.state.work; lab.store.set({ work: { timed: false, series: [series[0], { ...series[1], done: 0 }] } }); });
  await settle();
  assert.deepEqual(new Set(await told()), new Set(['… …']));
}));

test('nothing sticks out at three sizes, in both schemes', async () => {
  for (const [width, height] of [[1440, 900], [1024, 768], [390, 844]])
    for (const scheme of ['light', 'dark'])
      await withPage({ hash: '#scene=ties-6', width, height, scheme }, async ({ page }) => {
        const size = await page.evaluate(() => ({ wide: document.documentElement.scrollWidth, background: getComputedStyle(document.querySelector('.kbvh-lab')).backgroundColor }));
        assert.ok(size.wide <= width, `${width}: the page is ${size.wide} wide`);
        const [r] = size.background.match(/\d+/g).map(Number);
        assert.equal(r < 128, scheme === 'dark');
      });
});

test('a compact lab on a page of someone else: mount, events, destroy', () => withPage({}, async ({ page }) => {
  const result = await page.evaluate(async () => {
    const place = document.createElement('div');
    document.body.append(place);
    const lab = await kbvhLab.mountLab(place, { format: 'kbvh-lab', version: 1, sceneId: 'line-4', strategy: 'kinetic_aabb', time: 0.5, selection: { node: 0, side: 1 } }, { compact: true });
    let heard = 0;
    lab.on('arrive', () => { ++heard; });
    await lab.event(1);
    const { time, sceneId } = lab.getState();
    const views = [...place.querySelectorAll('[data-view]')].map((view) => view.dataset.view).sort().join();
    lab.destroy();
    return { heard: heard > 0, later: time >= 0.5, sceneId, views, left: place.innerHTML };
  });
  assert.deepEqual(result, { heard: true, later: true, sceneId: 'line-4', views: 'diagram,stage,timeline,tree', left: '' });
}));
