// Looks at the pages that explorer.py made, in a headless Chromium.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { readFileSync, statSync } from "node:fs";
import { createRequire } from "node:module";

const require = createRequire(`${process.env.KBVH_EXPLORER}/package.json`);
const puppeteer = require("puppeteer-core");
const expected = JSON.parse(readFileSync(process.argv[2], "utf8"));
const browser = await puppeteer.launch({
  executablePath: process.env.KBVH_BROWSER,
  args: [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
  ],
  protocolTimeout: 300_000,
});
const VIEWS = ["answer", "overview", "pairwise", "errors", "scaling", "frames", "versus", "claims", "runs"];
const complaints = [];
let checks = 0;

function check(what, work) {
  return Promise.resolve()
    .then(work)
    .then(() => (checks += 1))
    .catch((problem) => {
      console.log(`FAILED: ${what}: ${problem.message}`);
      complaints.push(what);
    });
}

/** Opens a page; errors of its console, and requests to a network, are complaints. */
async function open(which, link = "", { width = 1440, scheme = "light", file = "page" } = {}) {
  const page = await browser.newPage();
  const complain = (text) => {
    console.log(`FAILED: ${which}${link} (${width}, ${scheme}): ${text}`);
    complaints.push(text);
  };
  page.on("console", (message) => ["error", "warn"].includes(message.type()) && complain(message.text()));
  page.on("pageerror", (error) => complain(error.message));
  page.on("requestfailed", (request) => complain(`${request.url()} is missing`));
  page.on("request", (request) => /^https?:/.test(request.url()) && complain(`a request to ${request.url()}`));
  await page.setViewport({ width, height: 900 });
  await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
  await page.goto(`file://${expected[which][file]}${link}`);
  if (file === "page") await page.waitForFunction(() => window.explorer?.shown);
  return page;
}

/** Waits until figures are drawn: they are in the frame after the one that knows their widths. */
const drawn = (page) =>
  page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => requestAnimationFrame(done)))));

const near = (a, b) =>
  a === null || b === null ? a === b : Math.abs(a - b) <= 1e-9 * Math.max(Math.abs(a), Math.abs(b));

function sameRatio(own, python, place) {
  if (python === null) return assert.equal(own, null, place);
  const [middle, low, high, paired, isInterval] = python;
  assert.ok(own, place);
  assert.ok(near(own.middle, middle), `${place}: ${own.middle} and ${middle}`);
  // The page has its resampled times with five digits.
  for (const [name, value] of Object.entries({ low, high }))
    assert.ok(Math.abs(own[name] - value) <= 1e-4 * value, `${place}, ${name}: ${own[name]} and ${value}`);
  assert.equal(own.paired, paired, place);
  assert.equal(own.isInterval, isInterval, place);
}

// --- numbers: ratios, intervals and profiles are Python's -------------------------------------------------

for (const which of ["reference", "merged"]) {
  const page = await open(which);
  const python = expected[which];
  await check(`${which}: all runs are there`, async () => {
    assert.equal(await page.evaluate(() => window.explorer.model.runs.length), python.runs);
    assert.equal(await page.evaluate(() => window.explorer.selected().length), python.usual);
  });
  for (const [scope, ratios] of Object.entries(python.against_refit))
    await check(`${which}: ${scope}, against the best refit`, async () => {
      const own = await page.evaluate((scope) => {
        const { model, set, ratio, reference } = window.explorer;
        set({ measure: scope, against: "baseline" });
        return model.runs.map((run) => ratio(run, reference(run), scope));
      }, scope);
      assert.ok(ratios.filter(Boolean).length > 50);
      ratios.forEach((value, i) => sameRatio(own[i], value, `run ${i}`));
    });
  await check(`${which}: against ${python.chosen}`, async () => {
    const own = await page.evaluate((against) => {
      const { model, set, ratio, reference } = window.explorer;
      set({ measure: "with_motion", against });
      return model.runs.map((run) => ratio(run, reference(run), "with_motion"));
    }, python.chosen);
    assert.ok(python.pairwise.filter(Boolean).length > 20);
    python.pairwise.forEach((value, i) => sameRatio(own[i], value, `run ${i}`));
  });
  for (const [measure, profiles] of Object.entries(python.profiles))
    await check(`${which}: profiles of ${measure}`, async () => {
      const own = await page.evaluate((measure) => {
        window.explorer.set({ ...window.explorer.initial(), measure });
        return window.explorer.profiles().map(({ name, factors, cells }) => ({ name, factors, cells }));
      }, measure);
      assert.deepEqual(
        own.map((one) => one.name),
        profiles.map(([id]) => id),
      );
      own.forEach((one, i) => {
        assert.equal(one.cells, profiles[i][2]);
        assert.equal(one.factors.length, profiles[i][1].length);
        one.factors.forEach((factor, k) =>
          assert.ok(near(factor, profiles[i][1][k]), `${one.name}: ${factor} and ${profiles[i][1][k]}`),
        );
      });
    });
  await page.close();
}

// --- two commits side by side -------------------------------------------------------------------------------

await check("merged: two commits, pair by pair", async () => {
  const page = await open("merged", "#view=versus&contestants=all");
  const own = await page.evaluate(() => {
    const [a, b] = [...window.explorer.sources().keys()];
    return window.explorer.pairs(a, b).both.map((one) => one.ratio);
  });
  const python = expected.merged.versus;
  assert.equal(own.length, python.length);
  assert.ok(python.length >= 50);
  const sort = (list, of) => [...list].sort((x, y) => of(x) - of(y));
  sort(own, (r) => r.middle).forEach((ratio, i) => sameRatio(ratio, sort(python, (r) => r[0])[i], `pair ${i}`));
  const said = await page.$eval("#view .lead", (element) => element.textContent);
  assert.match(said, new RegExp(`of ${python.length} configurations`));
  assert.equal((await page.$$("#view .toolbar select")).length, 2);
  await page.close();
});

await check("merged: an outlier stretches no axis", async () => {
  for (const view of ["pairwise&strategy=rebuild,kinetic_aabb", "versus"]) {
    const page = await open("merged", `#view=${view}`);
    const [notes, ticks] = await page.evaluate(() => {
      const figure = document.querySelector("#view figure");
      const texts = (selector) => [...figure.querySelectorAll(selector)].map((one) => one.textContent);
      return [texts(".note"), texts('[aria-label="x-axis tick label"] text').map(Number)];
    });
    assert.ok(
      notes.some((text) => /1 point beyond the axis/.test(text)),
      notes.join(" | "),
    );
    assert.ok(ticks.length > 2 && Math.max(...ticks) / Math.min(...ticks) < 100, `${view}: ${ticks.join(" ")}`);
    await page.close();
  }
});

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
  const other = await open("reference", link);
  assert.deepEqual(await other.evaluate(() => window.explorer.state()), state);
  assert.equal(await other.evaluate(() => window.explorer.selected().length), count);
  assert.equal(await other.$eval(`input[name="scene"][value="${first}"]`, (box) => box.checked), true);
  await other.click(".filters-head button");
  assert.equal(await other.evaluate(() => window.explorer.selected().length), expected.reference.usual);
  assert.equal(await other.evaluate(() => location.hash), "#view=overview");
  await other.close();
  await page.close();
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
  await page.close();
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
  await page.close();
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
    await page.close();
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
    await page.close();
  });

await check("three questions are answered by a name, an interval and a curve", async () => {
  const page = await open("reference");
  const said = () => page.$eval(".answer", (one) => one.textContent);
  const press = (text) =>
    page.evaluate((text) => [...document.querySelectorAll(".segments button")].find((one) => one.textContent === text).click(), text);
  const rule = (known) =>
    page.evaluate((known) => {
      const one = window.explorer.situations().find(({ asks, frames }) => asks === "pairs of two bodies" && /^10/.test(frames));
      return one.advice[known].contestant.title;
    }, known);
  assert.match(await said(), new RegExp(`^Take ${await rule(0)}`));
  await press("The next keyframe");
  assert.match(await said(), new RegExp(`^Take ${await rule(1)}.* times as fast as the best refit \\([\\d.]+ to [\\d.]+ in \\d+ cells\\).* ms a frame`));
  await press("10k to 100k");
  assert.match(await page.evaluate(() => location.hash), /know=next&large=medium/);
  await drawn(page);
  assert.equal((await page.$$(".beside-legend svg.chart")).length, 1);
  assert.equal((await page.$$(".beside-legend .legend li")).length, 6);
  await press("1");
  assert.match(await said(), /^Take .*the best refit in \d+ of \d+ cells/);
  await page.close();
});

await check("a range of few rounds is not called an interval", async () => {
  const page = await open("reference", "#know=next&of=blender/dancer-skirt");
  assert.match(await page.$eval(".answer", (one) => one.textContent), /^Take .* times as fast as the best refit \(range of its rounds [\d.]+ to [\d.]+\)/);
  await page.close();
  const other = await open("reference");
  await (await other.$('input[type="file"]')).uploadFile(expected.merged.one.results);
  await other.waitForFunction((count) => window.explorer.model.runs.length === count, {}, expected.merged.one.runs);
  await other.evaluate((of) => window.explorer.set({ of, know: "clip", frames: "10" }), expected.merged.one.scene);
  const said = await other.$eval("#view", (one) => one.textContent);
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
    await page.close();
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
    await page.close();
  }
});

await check("in a narrow window the answer comes before the menus", async () => {
  const page = await open("reference", "", { width: 390 });
  const tops = await page.evaluate(() =>
    [".take", ".views", "#open-filters"].map((one) => document.querySelector(one).getBoundingClientRect().top),
  );
  assert.ok(tops[0] > 0 && tops[0] < 844, "in the first screen");
  assert.ok(tops[0] < tops[1]);
  await page.close();
});

await check("filters name strategies by their titles", async () => {
  const page = await open("reference", "#view=overview");
  const pairs = await page.$$eval('input[name="strategy"]', (list) =>
    list.map((box) => [box.value, box.parentElement.querySelector(".value").textContent]),
  );
  const titles = await page.evaluate(() => Object.fromEntries(window.explorer.model.contestants.map((one) => [one.id, one.title])));
  assert.ok(pairs.length > 10);
  for (const [id, text] of pairs) assert.equal(text, titles[id]);
  await page.close();
});

// --- files that are opened in the page --------------------------------------------------------------------------

for (const which of ["reference", "merged"])
  await check(`${which}: a file of results gives the data that Python makes of it`, async () => {
    const page = await open(which);
    const differences = await page.evaluate((text) => {
      const { dataOf, given } = window.explorer;
      const own = dataOf(text, "results.jsonl", given.palette);
      own.runs.draws = own.runs.draws.map((one) => (typeof one === "function" ? one() : one));
      const found = [];
      // Five digits and fewer are rounded in other ways where a number lies just between two.
      const near = (path) => (/pace|quality/.test(path) ? 1e-3 : /draws|values_|nodes_|_tests|certificates/.test(path) ? 1e-4 : 1e-9);
      const compare = (a, b, path) => {
        if (typeof a === "number" && typeof b === "number") {
          if (Math.abs(a - b) > near(path) * Math.max(Math.abs(a), Math.abs(b))) found.push(`${path}: ${a}, ${b}`);
        } else if (a && b && typeof a === "object" && typeof b === "object")
          for (const key of new Set([...Object.keys(a), ...Object.keys(b)])) compare(a[key], b[key], `${path}.${key}`);
        else if (a !== b) found.push(`${path}: ${JSON.stringify(a)}, ${JSON.stringify(b)}`);
      };
      for (const part of ["plans", "phases", "machines", "commits", "contestants", "cells", "runs"]) compare(own[part], given[part], part);
      return found.slice(0, 5);
    }, readFileSync(expected[which].results, "utf8"));
    assert.deepEqual(differences, []);
    await page.close();
  });

await check("files are opened, and what is no file of results is refused in one sentence", async () => {
  const page = await open("reference", "#view=overview&l=10", { scheme: "dark" });
  const picker = await page.$('input[type="file"]');
  await picker.uploadFile(expected.merged.results);
  await page.waitForFunction((count) => window.explorer.model.runs.length === count, {}, expected.merged.runs);
  assert.equal(await page.$eval("h1", (one) => one.textContent), "is it faster?");
  assert.match(await page.$eval(".answer", (one) => one.textContent), /^Take /);
  assert.equal((await page.$$("header.page")).length, 1);
  assert.equal(await page.evaluate(() => document.documentElement.dataset.scheme), "dark");
  await page.click('[data-view="pairwise"]');
  await drawn(page);
  assert.ok((await page.$$("#view svg.chart")).length > 0);
  await (await page.$('input[type="file"]')).uploadFile(expected.merged.page);
  await page.waitForFunction(() => !document.querySelector(".problem").hidden);
  assert.match(await page.$eval(".problem", (one) => one.textContent), /explorer.html cannot be shown: .* no result that can be used/);
  assert.equal(await page.evaluate(() => window.explorer.model.runs.length), expected.merged.runs);
  await page.close();
});

// --- points lead to commands, by pointer and by keyboard ----------------------------------------------------

await check("a number of the matrix leads to its command", async () => {
  const page = await open("reference", "#view=overview");
  const cell = await page.$(".matrix td[data-run]");
  await cell.click();
  const run = await cell.evaluate((td) => Number(td.dataset.run));
  const [id, command] = await page.evaluate(
    (index) => [window.explorer.model.runs[index].contestant.id, document.querySelector(".command").textContent],
    run,
  );
  assert.match(command, new RegExp(`kbvh (run|bench) .*--strategies ${id} `));
  assert.match(await page.evaluate(() => location.hash), /point=/);
  const other = await open("reference", await page.evaluate(() => location.hash));
  assert.equal(await other.$eval(".command", (one) => one.textContent), command);
  await page.keyboard.press("Escape");
  assert.equal(await page.$eval("#details", (panel) => panel.hidden), true);
  await other.close();
  await page.close();
});

await check("arrow keys and Enter reach every kind of figure", async () => {
  for (const view of ["answer", "overview", "pairwise", "errors", "scaling", "frames"]) {
    const page = await open("reference", `#view=${view}`);
    await page.focus('.plot[role="application"]');
    for (const key of ["ArrowRight", "ArrowDown", "ArrowRight", "Enter"]) await page.keyboard.press(key);
    assert.equal(await page.$eval("#details", (panel) => panel.hidden), false, view);
    assert.ok(await page.evaluate(() => document.activeElement.id === "details"), view);
    await page.close();
  }
  const page = await open("reference", "#view=overview");
  await page.focus('.matrix td[tabindex="0"]');
  await page.keyboard.press("ArrowDown");
  const run = await page.evaluate(() => Number(document.activeElement.dataset.run));
  await page.keyboard.press("Enter");
  assert.equal(
    await page.evaluate(() => window.explorer.model.runs.findIndex((one) => one.key === window.explorer.state().point)),
    run,
  );
  await page.focus('[role="tab"][aria-selected="true"]');
  await page.keyboard.press("ArrowRight");
  assert.equal(await page.evaluate(() => window.explorer.state().view), "pairwise");
  await page.close();
});

await check("the pointer finds the point below it", async () => {
  const page = await open("reference", "#view=frames");
  const ring = async () => page.$eval(".tip:not([hidden])", (tip) => tip.textContent);
  const box = await page.$eval('.plot[role="application"] svg.chart [aria-label="dot"] path', (path) =>
    path.getBoundingClientRect().toJSON(),
  );
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  assert.match(await ring(), /median .* ms/);
  await page.mouse.click(box.x + box.width / 2, box.y + box.height / 2);
  assert.equal(await page.$eval("#details", (panel) => panel.hidden), false);
  await page.close();
});

await check("the program accepts the commands", async () => {
  const page = await open("reference");
  const commands = await page.evaluate(() => {
    const one = new Map();
    for (const run of window.explorer.model.runs) {
      const { text } = window.explorer.command(run);
      if (text && (!one.has(run.contestant.id) || !one.has(run.cell.name)))
        one.set(run.contestant.id, text).set(run.cell.name, text);
    }
    return [...new Set(one.values())];
  });
  assert.ok(commands.length > 15);
  for (const text of commands) {
    const line = text
      .split("\n")
      .at(-1)
      .replace(/^kbvh/, `'${process.env.KBVH_PROGRAM}'`)
      .replace("--out again", "--print-plan");
    const told = spawnSync("sh", ["-c", line], { encoding: "utf8" });
    assert.equal(told.status, 0, `${line}: ${told.stderr}`);
  }
  await page.close();
  const shapes = await open("merged");
  const text = await shapes.evaluate(() => window.explorer.command(window.explorer.model.runs[0]).text);
  assert.match(text, /cat > again.json <<'PLAN'[^]*"shape": "sphere"[^]*kbvh run --plan again.json --out again/);
  await shapes.close();
});

// --- every view, both schemes, three widths -------------------------------------------------------------------

for (const [which, views] of [
  ["reference", VIEWS],
  ["merged", ["answer", "overview", "versus"]],
])
  for (const view of views)
    for (const [width, scheme] of [
      [1440, "light"],
      [1024, "dark"],
      [390, "light"],
      [390, "dark"],
    ])
      await check(`${which}: ${view} at ${width}, ${scheme}`, async () => {
        const page = await open(which, `#view=${view}`, { width, scheme });
        assert.equal(await page.evaluate(() => document.documentElement.dataset.scheme), scheme);
        assert.ok(
          (await page.evaluate(() => document.documentElement.scrollWidth)) <= width,
          "the page is wider than the window",
        );
        const cut = await page.$$eval(".plot svg.chart text", (list) =>
          list
            .filter((text) => {
              const [own, host] = [text.getBoundingClientRect(), text.closest(".plot").getBoundingClientRect()];
              return text.textContent && own.width && (own.left < host.left - 1 || own.right > host.right + 1);
            })
            .map((text) => text.textContent),
        );
        assert.deepEqual(cut, [], "labels beyond the edge of their figure");
        assert.ok((await page.$eval("#view", (one) => one.textContent.length)) > 100);
        await page.close();
      });

await check("the filters of a narrow window are a drawer", async () => {
  const page = await open("reference", "#view=overview", { width: 390 });
  const shown = () => page.$eval("#filters", (one) => getComputedStyle(one).display !== "none");
  assert.equal(await shown(), false);
  await page.click("#open-filters");
  assert.equal(await shown(), true);
  await page.click('input[name="scene"]');
  assert.equal(await page.$eval("#open-filters", (button) => button.textContent), "Filters (1)");
  await page.click(".close-filters");
  assert.equal(await shown(), false);
  assert.equal(await page.evaluate(() => document.activeElement.id), "open-filters");
  await page.close();
});

await check("the switch changes the scheme", async () => {
  const page = await open("reference", "", { scheme: "dark" });
  const colour = () => page.evaluate(() => getComputedStyle(document.documentElement).backgroundColor);
  const before = await colour();
  await page.click("#theme");
  assert.notEqual(await colour(), before);
  await page.close();
});

// --- the report -------------------------------------------------------------------------------------------------

/** Returns what reaches beyond the window without being in a part that scrolls. */
const beyond = (page) =>
  page.evaluate(() => {
    const scrolls = (one) => one && (getComputedStyle(one).overflowX === "auto" || scrolls(one.parentElement));
    return [...document.querySelectorAll("body *")]
      .filter((one) => one.getBoundingClientRect().right > innerWidth + 1 && one.getBoundingClientRect().width && !scrolls(one))
      .map((one) => one.outerHTML.slice(0, 80));
  });

for (const which of ["reference", "merged"])
  for (const [width, scheme] of [
    [1280, "light"],
    [1280, "dark"],
    [390, "light"],
    [390, "dark"],
  ])
    await check(`the report of ${which} at ${width}, ${scheme}: short, nothing cut`, async () => {
      assert.ok(statSync(expected[which].report).size < 2e6);
      const page = await open(which, "", { width, scheme, file: "report" });
      const tall = await page.evaluate(() => document.documentElement.scrollHeight);
      if (width === 1280) assert.ok(tall <= 5 * 900, `${tall} pixels`);
      assert.deepEqual(await beyond(page), []);
      const contrast = await page.evaluate(() => getComputedStyle(document.documentElement).color);
      assert.equal(contrast === "rgb(29, 33, 41)", scheme === "light");
      await page.evaluate(() => document.querySelectorAll("details").forEach((one) => (one.open = true)));
      assert.deepEqual(await beyond(page), [], "unfolded");
      await page.close();
    });

await check("the report's top answers, and its links unfold what they lead to", async () => {
  const page = await open("reference", "", { file: "report", width: 1280 });
  assert.deepEqual(await page.$$eval(".sentences a", (list) => list.map((one) => one.textContent)), [
    "What to take",
    "Other questions",
    "Time against error",
    "The paper",
    "This run",
  ]);
  const rule = expected.reference.situations.map(([, , , advice]) => [...new Set(advice.filter(Boolean).map(([id]) => id))].length);
  assert.equal((await page.$$(".situation:not(.scale)")).length, rule.reduce((a, b) => a + b));
  await page.click('.sentences a[href="#claims"]');
  await page.waitForFunction(() => document.querySelector("#claims").open);
  const claim = await open("reference", "#claim-E1", { file: "report" });
  assert.equal(await claim.$eval("#claim-E1", (one) => one.open && one.closest("#claims").open), true);
  await claim.close();
  await page.close();
});

// --- speed ----------------------------------------------------------------------------------------------------

await check("10 MB of results", async () => {
  const { megabytes, runs } = expected.large;
  assert.ok(megabytes > 10);
  const page = await open("large");
  const [shown, ready, filter] = await page.evaluate(async () => {
    const first = [window.explorer.shown, window.explorer.ready];
    const begun = performance.now();
    window.explorer.set({ l: ["10"] });
    await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
    return [...first, performance.now() - begun];
  });
  console.log(
    `${megabytes.toFixed(1)} MB of results, ${runs} runs: shown ${shown.toFixed(0)} ms after the start of loading (its own work ${ready.toFixed(0)} ms), filtered in ${filter.toFixed(0)} ms`,
  );
  assert.equal(await page.evaluate(() => window.explorer.model.runs.length), runs);
  assert.ok(shown < 20_000, "even a busy machine is faster");
  await page.close();
});

await browser.close();
console.log(`${checks} checks passed, ${complaints.length} complaints`);
process.exit(complaints.length ? 1 : 0);
