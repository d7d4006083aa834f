// Filters, links, and the answer to four questions.
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

await check("the page asks its question, and the text of a study stays text", async () => {
  const page = await open("merged", "#view=overview");
  assert.equal(await page.title(), "kbvh explorer: is it faster? study");
  assert.equal(await page.$eval("h1", (one) => one.textContent), "Which BVH update to take?");
  assert.match(await page.$eval(".notes summary", (one) => one.textContent), /^How this study was made · is it faster\? · \d+ runs/);
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
    const place = (id) => 100 * "ETC".indexOf(id[0]) + Number(id.slice(1));
    const listed = () => page.$$eval(".claim", (list) => list.map((one) => one.id.replace("claim-", "")));
    const byNumber = claims.map((claim) => claim.id).sort((a, b) => place(a) - place(b));
    assert.ok(byNumber.includes("E10") && byNumber.includes("T1"));
    assert.deepEqual(await listed(), byNumber, "E1, E2 ... E15, T1 ...: not by verdict, nor by letters");
    const tops = await page.evaluate(() => [".tally", ".main-claim", ".claim"].map((one) => document.querySelector(one).getBoundingClientRect().top));
    assert.ok(tops[0] < tops[1] && tops[1] < tops[2], "the tally on top");
    const verdicts = ["does not hold", "holds with a condition", "holds"];
    const byVerdict = verdicts.flatMap((verdict) => byNumber.filter((id) => claims.find((claim) => claim.id === id).verdict === verdict));
    assert.notDeepEqual(byVerdict, byNumber);
    await page.select(".toolbar select", "worst");
    assert.deepEqual(await listed(), byVerdict);
    assert.match(await page.evaluate(() => location.hash), /claims=worst/);
    await page.select(".toolbar select", "number");
    assert.deepEqual(await listed(), byNumber);
    assert.equal((await page.$$(".claim[open]")).length, 0, "folded");
    assert.equal(await page.$eval("#filters", (one) => getComputedStyle(one).display), "none", "no filters: claims do not depend on them");
    const six = claims.find((claim) => claim.id === "E6");
    const [, range] = six.corners.find(([name]) => /BoxTree/.test(name));
    assert.match(range, /^[\d.]+( to [\d.]+)?$/);
    assert.ok(six.corners.some(([name]) => /AABB/.test(name)) && six.corners.every(([name]) => /BoxTree|AABB/.test(name)), "each range has its structure");
    await page.click("#claim-E6 summary");
    assert.ok((await page.$eval("#claim-E6 .corners", (one) => one.innerText)).includes(range));
    assert.doesNotMatch(await page.$eval("#claim-E6", (one) => one.textContent), /Measured: /, "no range without its structure");
    await page.click("#claim-E6 summary");
    leave(page);
  }
});

// --- four questions, one answer --------------------------------------------------------------------------------

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

await check("four questions are answered by a name, an interval and a curve", async () => {
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
    new RegExp(`^Take ${await rule(1, "10 frames a keyframe and more")}: [\\d.]+ ms \\([\\d.]+[kM]?\\) to [\\d.]+ ms \\([\\d.]+[kM]?\\) a frame\\.That is [\\d.]+ times as fast as the best refit \\([\\d.]+ to [\\d.]+ in \\d+ cells(?:; doubtful, [^)]*)?\\)\\. It beats the best refit \\([^)]+\\) in \\d+ of \\d+ cells`),
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

await check("where a refit is the best one, doubtful cells are named without their ratio to itself", async () => {
  const page = await load("reference");
  const told = await page.evaluate(() => {
    const { model, set } = window.explorer;
    for (const { refit } of model.counted) refit.disturbed = "by this check";
    set({ know: "none", frames: "1", large: "any" });
    return document.querySelector(".answer").textContent;
  });
  const doubts = [...told.matchAll(/the best refit in \d+ of \d+ cells(.{60})/g)].map(([, next]) => next);
  assert.ok(doubts.length > 0, told);
  for (const next of doubts) assert.match(next, /^(, measured in \d+)? \(doubtful, from a disturbed machine: (?![\d.]+ on )/);
  await page.close();
});

const pressed = (page) => page.$$eval('.segments [aria-pressed="true"]', (list) => list.map((one) => one.textContent));
const press = (page, text) =>
  page.evaluate((text) => [...document.querySelectorAll(".segments button")].find((one) => one.textContent === text).click(), text);

/** Expects every dashed choice, and no other, to be named by the line below its question. */
async function reasons(page) {
  const groups = await page.$$eval(".question-of", (list) =>
    list.map((one) => [[...one.querySelectorAll("button.unmeasured")].map((button) => button.textContent), one.querySelector(".reason")?.textContent ?? "", one.querySelectorAll(":disabled").length]),
  );
  assert.equal(groups.length, 4);
  for (const [absent, said, disabled] of groups) {
    assert.equal(disabled, 0, "every choice can be made");
    assert.equal(said !== "", absent.length > 0, said);
    for (const name of absent) assert.ok(said.includes(name), `${name}: ${said}`);
  }
  return groups.flatMap(([absent]) => absent);
}

await check("a choice that was not measured stays, is said, and is answered by the project's measurements or the nearest ones", async () => {
  const page = await open("merged");
  assert.deepEqual(await pressed(page), ["Nothing: positions only", "1", "Any size", "two bodies"]);
  const absent = await reasons(page);
  for (const name of ["2 to 9", "10k to 100k", "100k and more", "one body with itself, too", "rays with bodies"]) assert.ok(absent.includes(name), name);
  const card = () => page.$eval(".answer", (one) => one.textContent);

  await press(page, "10k to 100k"); // the project has it
  assert.deepEqual(await pressed(page), ["Nothing: positions only", "1", "10k to 100k", "two bodies"]);
  assert.match(await card(), /^Not measured in these results: two bodies, positions only \(a keyframe at every frame\), 10k to 100k triangles\. Nothing above 8k was\.Take /);
  // What it takes is what the rule takes of these cells.
  const rule = await page.evaluate(() => {
    const { cells, strategies } = window.explorer.model.data.kept;
    const own = cells.filter((one) => one.asks === "pairs of two bodies" && one.l < 2 && one.primitives >= 1e4 && one.primitives < 1e5);
    const speed = (id) => {
      const known = own.filter((one) => id in one.speeds).map((one) => one.speeds[id]);
      if (2 * known.length < own.length || !["", "none"].includes(strategies[id][1])) return 0;
      return [...known, ...Array(own.length - known.length).fill(Math.min(...known))].reduce((product, one) => product * one, 1);
    };
    const best = Object.keys(strategies).reduce((most, id) => (speed(id) > speed(most) ? id : most));
    return [strategies[best][0], own.length];
  });
  assert.ok(rule[1] > 3);
  assert.ok((await card()).includes(`Take ${rule[0]}: `), `${rule[0]}: ${await card()}`);
  assert.match(await card(), / a frame, [\d.]+ to [\d.]+ ns a triangle\./);
  assert.match(await card(), /Next: .* a frame, [\d.]+ to [\d.]+ ns a triangle; .*Measured: /);
  // The project's cells stand by size, so that the one that is nearest to a mesh is found without reading all.
  const sizes = await page.evaluate(() =>
    [...document.querySelectorAll("#view h2")]
      .find((one) => one.textContent === "What it costs in the project's own measurements")
      .closest("section")
      .querySelector("tbody")
      .innerText.match(/, [\d.]+[kM]?, l = /g)
      .map((text) => parseFloat(text.slice(2)) * (text.includes("k") ? 1e3 : text.includes("M") ? 1e6 : 1)),
  );
  assert.equal(sizes.length, rule[1]);
  assert.deepEqual(sizes, sizes.toSorted((a, b) => a - b));
  assert.match(await card(), /By the project's own measurements, not by these results\. .*Measured: plans? .*commit [0-9a-f]{8}, .*Nearest in these results: positions only \(a keyframe at every frame\), below 10k triangles\./);
  await reasons(page);

  // A refit needs no keyframes: where only more frames a keyframe were measured, here of one scene, it is recommended nevertheless.
  const refit = await page.evaluate(() => {
    const { model, set } = window.explorer;
    const [all, before] = [model.counted, { large: "medium", of: "" }];
    model.counted = all.filter(({ cell }) => cell.l >= 10);
    set({ large: "any", of: model.counted[0].cell.scene });
    const told = document.querySelector(".answer").innerText;
    model.counted = all;
    set(before);
    return told;
  });
  assert.match(refit, /\nTake ([^:]+): a refit uses no keyframes\. Its time with positions only is not known\.\s+Nearest in these results: 10 frames a keyframe and more\. There, .* take \1: /);

  await press(page, "one body with itself, too"); // the project has it for other frames only
  assert.deepEqual(await pressed(page), ["Nothing: positions only", "1", "10k to 100k", "one body with itself, too"]);
  assert.match(await card(), /^Not measured in these results: one body with itself, too, positions only/);
  assert.match(await card(), /The project's own measurements have it with 10 frames a keyframe and more, 10k to 100k triangles\.$/);
  assert.doesNotMatch(await card(), /Take /);
  await reasons(page);
  await page.click(".kept-near button"); // leads there
  assert.deepEqual(await pressed(page), ["Nothing: positions only", "10 and more", "10k to 100k", "one body with itself, too"]);
  assert.match(await card(), /^Not measured in these results: .*Take .*By the project's own measurements/);

  await press(page, "100k and more"); // nobody has it
  await press(page, "two bodies");
  assert.match(await card(), /Nothing above 8k was\.Nearest in these results: .*take /);
  await page.click(".nearest button"); // leads there
  assert.match(await card(), /^Take /);
  assert.deepEqual(await pressed(page), ["Nothing: positions only", "10 and more", "below 10k", "two bodies"]);
  leave(page);
});

await check("results without the measurements of the project say what they lack", async () => {
  const page = await load("merged");
  const said = await page.evaluate(() => {
    window.explorer.model.data.kept = null;
    window.explorer.set({ asks: "rays" });
    return document.querySelector(".answer").textContent;
  });
  assert.equal(said, "Not measured in these results: rays with bodies, positions only (a keyframe at every frame).Nothing near it was measured, either.");
  await reasons(page);
  await page.close();
});

await check("a range of few rounds is not called an interval", async () => {
  for (const [results, called, never] of [
    [expected.merged.few.results, "range of its rounds", /interval [\d.]+ to/],
    [expected.merged.one.results, "95\u00a0% interval", /range of its rounds/],
  ]) {
    const page = await load("reference");
    await (await page.$('input[type="file"]')).uploadFile(results);
    await page.waitForFunction((count) => window.explorer.model.runs.length === count, {}, expected.merged.one.runs);
    await page.evaluate((of) => window.explorer.set({ of, know: "clip", frames: "10" }), expected.merged.one.scene);
    const said = await page.$eval("#view", (one) => one.textContent);
    assert.match(said, new RegExp(`: [\\d.]+ ms a frame \\(${called} [\\d.]+ to [\\d.]+\\)\\.`));
    assert.match(said, new RegExp(`times as fast as the best refit \\(${called} [\\d.]+ to [\\d.]+\\)`));
    assert.doesNotMatch(said, never);
    await page.close();
  }
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

await check("in a narrow window the tabs are one row on top, and the answer comes before the questions", async () => {
  for (const view of ["answer", "overview", "claims"]) {
    const page = await open("reference", `#view=${view}`, { width: 390 });
    const [tabs, main, chosen] = await page.evaluate(() =>
      ["[role=tablist]", "main", "[role=tab][aria-selected=true]"].map((one) => document.querySelector(one).getBoundingClientRect().toJSON()),
    );
    assert.ok(tabs.bottom <= main.top && tabs.height < 60, `${view}: ${tabs.height} pixels`);
    assert.ok(chosen.left >= 0 && chosen.right <= 390, `${view}: the tab is in sight`);
    if (view === "answer") {
      const tops = await page.evaluate(() => [".take", ".questions"].map((one) => document.querySelector(one).getBoundingClientRect().top));
      assert.ok(tops[0] > 0 && tops[0] < 844, "in the first screen");
      assert.ok(tops[0] < tops[1]);
    }
    leave(page);
  }
});

await check("the answer leads to the paper's claims, whose first sentence is that of the report", async () => {
  const page = await open("reference");
  const links = await page.$$(".onward button");
  assert.ok(links.length >= 1);
  await links[0].click();
  assert.equal(await page.evaluate(() => window.explorer.state().view), "claims");
  const said = await page.$eval(".main-claim", (one) => one.textContent);
  assert.match(said, /^Is updating a kinetic AABB tree faster than a bottom-up refit\? .*tuned here.*built as in 2006/);
  leave(page);
});

await check("time against error opens where contestants err, with missed pairs first and what they buy on top", async () => {
  const page = await load("merged");
  const [wanted, chosen, others, titles, said, share] = await page.evaluate(() => {
    const { model, set } = window.explorer;
    const wrong = model.contestants.find((one) => one.id === "top_down");
    wrong.guarantee = "approximate";
    const cell = model.cells.at(-1);
    const run = cell.runs.find((one) => one.contestant === wrong);
    Object.assign(run, { pairs: 1000, missed: 4, extra: 332 });
    set({ view: "errors" });
    const all = (selector) => [...document.querySelectorAll(selector)];
    const select = all(".toolbar select").find((one) => one.value === cell.key);
    for (const one of all("#view .numbers")) one.open = true;
    return [cell.key, select?.value, [...(select?.options ?? [])].slice(1).map((one) => one.text), all("#view figure h3").map((one) => one.textContent), all(".bargain").map((one) => one.textContent), run.contestant.label];
  });
  assert.equal(chosen, wanted);
  assert.ok(others.length > 1 && others.every((text) => text.endsWith(": exact contestants only")), others.join(" | "));
  assert.deepEqual(titles.slice(0, 2), ["Missed pairs", "False pairs"]);
  await drawn(page);
  const axes = await page.$eval("#view svg.chart", (chart) => ["x", "y"].map((name) => chart.querySelector(`[aria-label="${name}-axis label"]`).textContent));
  assert.match(axes[0], /ms per frame/, "time to the right and errors upwards, as in the report");
  assert.match(axes[1], /missed pairs/);
  assert.match(said[0], /^(If nothing|Whatever is known) .*missing up to 1\u202f% of the pairs (makes a frame [\d.]+ times as fast|gains nothing: .* and is [\d.]+ times as fast)/);
  assert.ok(said[0].includes("missed 0.40\u202f%"), said[0]);
  // 332 of the 1000 - 4 + 332 reported pairs are false: the share is of what was reported, as in the report.
  await page.waitForFunction(() => document.querySelectorAll("#view .numbers table").length > 1);
  const row = await page.evaluate(
    (label) => [...document.querySelectorAll("#view .numbers")][1].querySelector("table").innerText.split("\n").find((line) => line.startsWith(label)),
    share,
  );
  assert.match(row, /\s25\u202f%$/);
  await page.close();
});

await check("the details of a point have all times of frames without motion", async () => {
  const page = await open("merged", "#view=runs");
  await page.click(".runs tbody button.name");
  const said = await page.$$eval("#details dl div", (list) => list.map((one) => one.textContent).find((text) => text.startsWith("Frames")));
  assert.match(said ?? "no times of frames", /^Frames, without motionmean [\d.]+ ms; half of them take more than [\d.]+ ms, one in a hundred more than [\d.]+ ms; the worst takes [\d.]+ ms$/);
  leave(page);
});

await check("views of all situations say so, and lead to the answer", async () => {
  for (const view of ["overview", "pairwise"]) {
    const page = await open("reference", `#view=${view}`);
    await page.click(".mixture button");
    assert.equal(await page.evaluate(() => window.explorer.state().view), "answer");
    leave(page);
  }
});

await check("the tabs stay where they are", async () => {
  const page = await open("reference");
  const at = () => page.$eval('[data-view="claims"]', (one) => one.getBoundingClientRect().toJSON());
  const before = await at();
  await page.evaluate(() => window.explorer.set({ view: "overview" }));
  assert.deepEqual(await at(), before);
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
