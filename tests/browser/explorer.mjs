// Looks at the pages that explorer.py made, in a headless Chromium.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { readFileSync } from "node:fs";
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
const VIEWS = ["overview", "pairwise", "errors", "scaling", "frames", "versus", "claims", "runs"];
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
async function open(which, link = "", { width = 1440, scheme = "light" } = {}) {
  const page = await browser.newPage();
  const complain = (text) => {
    console.log(`FAILED: ${which}${link} (${width}, ${scheme}): ${text}`);
    complaints.push(text);
  };
  page.on("console", (message) => ["error", "warn"].includes(message.type()) && complain(message.text()));
  page.on("pageerror", (error) => complain(error.message));
  page.on("request", (request) => /^https?:/.test(request.url()) && complain(`a request to ${request.url()}`));
  await page.setViewport({ width, height: 900 });
  await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
  await page.goto(`file://${expected[which].page}${link}`);
  await page.waitForFunction(() => window.explorer?.shown);
  return page;
}

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

// --- two commits beside each other --------------------------------------------------------------------------

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
  const page = await open("reference");
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
  assert.equal(await other.evaluate(() => location.hash), "");
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
  const page = await open("merged");
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

await check("claims appear only where they are decided", async () => {
  const decided = await open("reference", "#view=claims");
  assert.equal(
    (await decided.$$(".claim")).length,
    await decided.evaluate(() => window.explorer.model.data.claims.length),
  );
  assert.ok((await decided.$$(".claim")).length > 20);
  const none = await open("merged", "#view=claims");
  const [tabs, claims] = await none.evaluate(() => [
    [...document.querySelectorAll('[role="tab"]')].map((tab) => tab.dataset.view),
    window.explorer.model.data.claims,
  ]);
  assert.equal(tabs.includes("claims"), claims.length > 0);
  assert.ok(claims.every((claim) => claim.verdict !== "not decided here"));
  await decided.close();
  await none.close();
});

// --- points lead to commands, by pointer and by keyboard ----------------------------------------------------

await check("a number of the matrix leads to its command", async () => {
  const page = await open("reference");
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
  for (const view of ["overview", "pairwise", "errors", "scaling", "frames"]) {
    const page = await open("reference", `#view=${view}`);
    await page.focus('.plot[role="application"]');
    for (const key of ["ArrowRight", "ArrowDown", "ArrowRight", "Enter"]) await page.keyboard.press(key);
    assert.equal(await page.$eval("#details", (panel) => panel.hidden), false, view);
    assert.ok(await page.evaluate(() => document.activeElement.id === "details"), view);
    await page.close();
  }
  const page = await open("reference");
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
  ["merged", ["overview", "versus"]],
])
  for (const view of views)
    for (const [width, scheme] of [
      [1440, "light"],
      [1024, "dark"],
      [390, "light"],
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
  const page = await open("reference", "", { width: 390 });
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
