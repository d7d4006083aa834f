// Filters, links, and the answer to three questions.
import assert from "node:assert/strict";

import { check, drawn, expected, leave, load, open } from "../support/explorer.mjs";

// --- filters, links and history -------------------------------------------------------------------------------

await check("filters choose runs, and the link keeps them", async () => {
  const page = await open("reference", "#view=overview");
  const scenes = expected.reference.scenes;
  const [first, second] = Object.keys(scenes);
  await page.click(`input[name="scene"][value="${first}"]`);
  assert.equal(await page.evaluate(() => window.explorer.selected().length), scenes[first]);
  await page.click(`input[name="scene"][value="${second}"]`);
  assert.equal(await page.evaluate(() => window.explorer.selected().length), scenes[first] + scenes[second]);
  await page.click('input[name="strategy"][value="bottom_up"]');
  const rows = new Set(await page.$$eval(".matrix tbody tr .scene", (list) => list.map((one) => one.textContent)));
  assert.deepEqual(rows, new Set([first, second].filter((scene) => rows.has(scene))));
  const link = await page.evaluate(() => location.hash);
  const [state, count] = await page.evaluate(() => [window.explorer.state(), window.explorer.selected().length]);
  const other = await load("reference", link);
  assert.deepEqual(await other.evaluate(() => window.explorer.state()), state);
  assert.equal(await other.evaluate(() => window.explorer.selected().length), count);
  assert.equal(await other.$eval(`input[name="scene"][value="${first}"]`, (box) => box.checked), true);
  await other.click(".filters-head button");
  assert.equal(await other.evaluate(() => window.explorer.selected().length), expected.reference.usual);
  assert.equal(await other.evaluate(() => location.hash), "#view=overview");
  await other.close();
  leave(page);
});

await check("states survive their links, strange names included", async () => {
  const page = await open("merged");
  const failures = await page.evaluate(() => {
    const { initial, encode, decode } = window.explorer;
    const words = ["a", "a,b", "100%", "x=y&z", "#", 'ä "<b>', "sequences/one", "~", "+"];
    const found = [];
    for (let i = 0; i < 300; ++i) {
      const state = initial();
      const pick = (k) => words[(i * 7 + k * 5) % words.length];
      for (const [name, usual] of Object.entries(state)) {
        if ((i + name.length) % 3 === 0) continue;
        state[name] = Array.isArray(usual) ? [...new Set([pick(1), pick(name.length)])] : pick(name.length);
      }
      if (JSON.stringify(decode(encode(state))) !== JSON.stringify(state)) found.push(encode(state));
    }
    return found;
  });
  assert.deepEqual(failures, []);
  assert.deepEqual(await page.evaluate(() => window.explorer.decode("#view&scene=%E0%A4%A&nonsense=1&l=10,10")), {
    ...(await page.evaluate(() => window.explorer.initial())),
    scene: ["%E0%A4%A"],
    l: ["10"],
  });
  await page.evaluate(() => window.explorer.set({ view: "runs" }));
  await page.evaluate(() => window.explorer.set({ view: "frames" }));
  await page.goBack();
  assert.equal(await page.$eval('[role="tab"][aria-selected="true"]', (tab) => tab.dataset.view), "runs");
  leave(page);
});

await check("a study's question is the title, and its text stays text", async () => {
  const page = await open("merged", "#view=overview");
  assert.equal(await page.title(), "is it faster?");
  assert.equal(await page.$eval("h1", (one) => one.textContent), "is it faster?");
  assert.match(await page.$eval(".question", (one) => one.textContent), /<script>alert\(1\)<\/script>/);
  assert.ok(
    (await page.$$eval(".matrix tbody .scene", (list) => list.map((one) => one.textContent))).some((text) =>
      text.includes('<b>&"scene"'),
    ),
  );
  leave(page);
});

await check("claims have verdicts, say whose they are, and add up", async () => {
  for (const [which, source] of [
    ["reference", "this study"],
    ["merged", "the reference run"],
  ]) {
    const page = await open(which, "#view=claims");
    const claims = await page.evaluate(() => window.explorer.model.data.claims);
    assert.ok(claims.length > 20);
    assert.equal((await page.$$(".claim")).length, claims.length);
    assert.ok(claims.every((claim) => claim.verdict !== "not decided here"));
    assert.ok(claims.some((claim) => claim.source === source), source);
    const tally = await page.$eval(".tally", (one) => one.textContent);
    const counted = [...tally.matchAll(/(?:holds|condition|hold) (\d+)/g)].reduce((sum, [, count]) => sum + Number(count), 0);
    assert.equal(counted, claims.length, tally);
    leave(page);
  }
});

// --- three questions, one answer --------------------------------------------------------------------------------

for (const which of ["reference", "merged"])
  await check(`${which}: the rule takes what the report takes`, async () => {
    const page = await open(which);
    const own = await page.evaluate(() =>
      window.explorer
        .situations()
        .map(({ asks, frames, cells, advice }) => [
          asks,
          frames,
          cells,
          advice.map((one) => one && [one.id, one.speed, one.low, one.high, one.own.length, one.bestIn]),
        ]),
    );
    const python = expected[which].situations;
    assert.deepEqual(own.map(([asks, frames]) => [asks, frames]).sort(), python.map(([asks, frames]) => [asks, frames]).sort());
    assert.ok(python.length > 1);
    for (const [asks, frames, cells, advice] of python) {
      const found = own.find((one) => one[0] === asks && one[1] === frames);
      assert.equal(found[2], cells, asks);
      advice.forEach((one, i) => {
        assert.equal(found[3][i][0], one[0], `${asks}, ${frames}`);
        found[3][i].slice(1).forEach((value, k) => assert.ok(Math.abs(value - one[k + 1]) <= 1e-4 * Math.abs(value), `${one[0]}: ${value} and ${one[k + 1]}`));
      });
    }
    leave(page);
  });

await check("three questions are answered by a name, an interval and a curve", async () => {
  const page = await open("reference");
  const said = () => page.$eval(".answer", (one) => one.textContent);
  const press = (text) =>
    page.evaluate((text) => [...document.querySelectorAll(".segments button")].find((one) => one.textContent === text).click(), text);
  const rule = (known, words) =>
    page.evaluate(
      (known, words) => {
        const one = window.explorer.situations().find(({ asks, frames }) => asks === "pairs of two bodies" && frames === words);
        return one.advice[known].contestant.title;
      },
      known,
      words,
    );
  assert.match(await said(), new RegExp(`^Take ${await rule(0, "a keyframe at every frame")}: `));
  await press("The next keyframe");
  assert.match(
    await said(),
    new RegExp(`^Take ${await rule(1, "10 frames a keyframe and more")}: [\\d.]+ to [\\d.]+ ms a frame\\.That is [\\d.]+ times as fast as the best refit \\([\\d.]+ to [\\d.]+ in \\d+ cells\\)\\.`),
  );
  await press("10k to 100k");
  assert.match(await page.evaluate(() => location.hash), /know=next&large=medium/);
  await drawn(page);
  assert.equal((await page.$$(".beside-legend svg.chart")).length, 1);
  assert.equal((await page.$$(".beside-legend .legend li")).length, 6);
  await press("1");
  assert.match(await said(), /^Take .*the best refit in \d+ of \d+ cells/);
  leave(page);
});

await check("what was not asked for is said", async () => {
  const page = await open("reference");
  const kinds = await page.evaluate(() => [...new Set(window.explorer.situations().map(({ asks }) => asks))]);
  assert.ok(!kinds.includes("rays"));
  assert.match(await page.$eval(".questions .note", (one) => one.textContent), /^Not measured in these results: [^.]*rays\. The report says what is known of them\.$/);
  assert.equal(await page.$eval(".questions .note a", (one) => one.getAttribute("href")), "report.html");
  leave(page);
});

await check("a range of few rounds is not called an interval", async () => {
  const page = await open("reference", "#know=next&of=blender/dancer-skirt");
  assert.match(await page.$eval(".answer", (one) => one.textContent), /^Take [^:]+: [\d.]+ ms a frame \(range of its rounds [\d.]+ to [\d.]+\)\.That is [\d.]+ times as fast as the best refit \(range of its rounds [\d.]+ to [\d.]+\)/);
  leave(page);
  const other = await load("reference");
  await (await other.$('input[type="file"]')).uploadFile(expected.merged.one.results);
  await other.waitForFunction((count) => window.explorer.model.runs.length === count, {}, expected.merged.one.runs);
  await other.evaluate((of) => window.explorer.set({ of, know: "clip", frames: "10" }), expected.merged.one.scene);
  const said = await other.$eval("#view", (one) => one.textContent);
  assert.match(said, /: [\d.]+ ms a frame \(95\u00a0% interval [\d.]+ to [\d.]+\)\./);
  assert.match(said, /times as fast as the best refit \(95\u00a0% interval [\d.]+ to [\d.]+\)/);
  assert.doesNotMatch(said, /range of its rounds/);
  await other.close();
});

await check("six lines, and the others on demand", async () => {
  for (const view of ["answer", "overview", "scaling"]) {
    const page = await open("reference", `#view=${view}&know=clip`);
    const lines = () => page.$eval("#view svg.chart", (svg) => svg.querySelectorAll('g[aria-label="line"]').length);
    const few = await lines();
    assert.ok(few >= 2 && few <= 6 + 3, `${view}: ${few} lines`); // and three guides of slope
    assert.ok((await page.$$eval("#view .legend li, #view .ranking tbody tr", (list) => list.length)) <= 6, view);
    await page.click("button.others");
    await drawn(page);
    assert.ok((await lines()) > few, view);
    leave(page);
  }
});

await check("legends are next to the plot, or right above it in a narrow window", async () => {
  for (const [width, beside] of [
    [1440, true],
    [390, false],
  ]) {
    const page = await open("reference", "#view=answer", { width });
    const [plot, legend] = await page.evaluate(() =>
      [".beside-legend figure", ".beside-legend .legend"].map((one) => document.querySelector(one).getBoundingClientRect().toJSON()),
    );
    if (beside) assert.ok(legend.left >= plot.right && Math.abs(legend.top - plot.top) < 120);
    else assert.ok(legend.bottom <= plot.top);
    leave(page);
  }
});

await check("in a narrow window the answer comes before the menus", async () => {
  const page = await open("reference", "", { width: 390 });
  const tops = await page.evaluate(() =>
    [".take", ".views", "#open-filters"].map((one) => document.querySelector(one).getBoundingClientRect().top),
  );
  assert.ok(tops[0] > 0 && tops[0] < 844, "in the first screen");
  assert.ok(tops[0] < tops[1]);
  leave(page);
});

await check("filters name strategies by their titles", async () => {
  const page = await open("reference", "#view=overview");
  const pairs = await page.$$eval('input[name="strategy"]', (list) =>
    list.map((box) => [box.value, box.parentElement.querySelector(".value").textContent]),
  );
  const titles = await page.evaluate(() => Object.fromEntries(window.explorer.model.contestants.map((one) => [one.id, one.title])));
  assert.ok(pairs.length > 10);
  for (const [id, text] of pairs) assert.equal(text, titles[id]);
  leave(page);
});
