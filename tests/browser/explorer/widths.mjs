// Every view in both schemes and three widths; the report; a large study.
import assert from "node:assert/strict";
import { statSync } from "node:fs";

import { check, drawn, expected, leave, load, open } from "../support/explorer.mjs";

const VIEWS = ["answer", "overview", "pairwise", "errors", "scaling", "frames", "versus", "claims", "runs"];

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
        leave(page);
      });

await check("the filters of a narrow window are a drawer", async () => {
  const page = await load("reference", "#view=overview", { width: 390 });
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
  const page = await load("reference", "", { scheme: "dark" });
  const colour = () => page.evaluate(() => getComputedStyle(document.documentElement).backgroundColor);
  const before = await colour();
  await page.click("#theme");
  assert.notEqual(await colour(), before);
  await page.close();
});

await check("in the dark scheme the recommended line is at least as bright as the others", async () => {
  for (const link of ["answer&know=none", "answer&know=next", "answer&know=clip", "scaling"]) {
    const page = await open("reference", `#view=${link}`, { width: 1440, scheme: "dark" });
    const charts = await page.$$eval("#view svg.chart", (list) => {
      const brush = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
      const luminance = (colour) => {
        brush.fillStyle = colour;
        brush.fillRect(0, 0, 1, 1);
        const [r, g, b] = [...brush.getImageData(0, 0, 1, 1).data].map((c) => (c / 255 <= 0.03928 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4));
        return 0.2126 * r + 0.7152 * g + 0.0722 * b;
      };
      return list.map((chart) =>
        [...chart.querySelectorAll('g[aria-label="line"]')].map((line) => {
          const { stroke, strokeWidth } = getComputedStyle(line);
          return [parseFloat(strokeWidth), luminance(stroke)];
        }),
      );
    });
    const shown = charts.filter((lines) => lines.some(([width]) => width === 3));
    assert.ok(shown.length > 0, link);
    for (const lines of shown) {
      const others = lines.filter(([width]) => width === 1.5).map(([, bright]) => bright);
      const [, own] = lines.find(([width]) => width === 3);
      assert.ok(others.length > 0 && own >= Math.max(...others) - 0.01, `${link}: ${own} and ${others}`);
    }
    leave(page);
  }
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

/** Opens every part of a report, and leaves what only a phone folds as the page's script has it. */
const unfold = (page) => page.evaluate(() => document.querySelectorAll("details:not(.fold)").forEach((one) => (one.open = true)));

/** Returns what scrolls sideways in its own frame, each with whether the frame says so. */
const scrolling = (page) =>
  page.$$eval(".scroll", (list) =>
    list
      .filter((one) => one.scrollWidth > one.clientWidth + 2)
      .map((one) => [one.classList.contains("more") && getComputedStyle(one, "::before").content.includes("scrolls sideways"), one.innerText.slice(0, 80)]),
  );

for (const which of ["reference", "merged", "erring"])
  for (const [width, scheme] of [
    [1280, "light"],
    [1280, "dark"],
    [800, "light"],
    [390, "light"],
    [390, "dark"],
  ])
    await check(`the report of ${which} at ${width}, ${scheme}: short, nothing cut`, async () => {
      assert.ok(statSync(expected[which].report).size < 2e6);
      const page = await open(which, "", { width, scheme, file: "report" });
      const tall = await page.evaluate(() => document.documentElement.scrollHeight);
      // Of a desktop, and of a phone of 390 x 844.
      const errors = await page.$eval("#errors", (one) => one.open).catch(() => false);
      assert.equal(errors, which === "erring" && width > 760, "time against error is in sight where there is room");
      if (width !== 800) assert.ok(tall <= (width === 1280 ? (errors ? 4 : 2) * 900 : 3 * 844), `${tall} pixels`);
      const rows = await page.$$eval(".sentences li", (list) => list.map((one) => Math.round(one.offsetHeight / parseFloat(getComputedStyle(one).lineHeight))));
      assert.equal(rows.length, 5);
      if (width === 1280) assert.ok(Math.max(...rows) <= 2, `sentences of ${rows} lines`);
      if (width === 1280) assert.ok((await page.$eval("#answers", (one) => one.getBoundingClientRect().bottom)) <= 900, "the answers are on the first screen");
      assert.deepEqual(await beyond(page), []);
      const contrast = await page.evaluate(() => getComputedStyle(document.documentElement).color);
      assert.equal(contrast === "rgb(29, 33, 41)", scheme === "light");
      await unfold(page);
      await drawn(page);
      const folds = await page.$$eval(".fold", (list) => list.map((one) => [one.open, one.querySelector("summary").offsetHeight > 0, one.querySelector("summary").textContent]));
      assert.equal(folds.length > 2, which === "erring");
      for (const [isOpen, named, title] of folds) {
        assert.equal(isOpen, width > 760, title);
        assert.equal(named, width < 760 && title !== "", title);
      }
      await page.evaluate(() => document.querySelectorAll("details").forEach((one) => (one.open = true)));
      await drawn(page);
      assert.deepEqual(await beyond(page), [], "unfolded");
      assert.ok((await page.evaluate(() => document.documentElement.scrollWidth)) <= width, "the page is wider than the window");
      const wide = await scrolling(page);
      if (width === 390) assert.ok(wide.length > 1, "wide tables scroll");
      for (const [said, text] of wide) assert.ok(said, `it scrolls without a hint: ${text}`);
      leave(page);
    });

await check("a hint stays at the edge while a table is scrolled, and the fade ends with it", async () => {
  const page = await open("reference", "", { width: 390, file: "report" });
  await unfold(page);
  await drawn(page);
  const table = await page.$("#glance .scroll");
  const faded = () => table.evaluate((one) => [one.classList.contains("wide"), one.classList.contains("more")]);
  assert.deepEqual(await faded(), [true, true]);
  await table.evaluate((one) => (one.scrollLeft = one.scrollWidth));
  await page.waitForFunction((one) => !one.classList.contains("more"), {}, table);
  assert.deepEqual(await faded(), [true, false]);
  leave(page);
});

await check("the report's top answers, and its links unfold what they lead to", async () => {
  const page = await open("reference", "", { file: "report", width: 1280 });
  assert.deepEqual(await page.$$eval(".sentences li > a", (list) => list.map((one) => one.textContent)), [
    "What to take",
    "Self-collision, rays",
    "Time against error",
    "The paper",
    "This run",
  ]);
  const rule = expected.reference.situations.map(([asks, , , advice]) => [asks, [...new Set(advice.filter(Boolean).map(([id]) => id))].length]);
  const sum = (list) => list.reduce((total, [, count]) => total + count, 0);
  assert.equal((await page.$$("#full .situation:not(.scale)")).length, sum(rule));
  const onTop = ["pairs of two bodies", "pairs within a body, too", "rays"];
  assert.equal((await page.$$("#answers .best:not(.scale)")).length, sum(rule.filter(([asks]) => onTop.includes(asks))));
  await page.click('#answers a[href="#full"]');
  await page.waitForFunction(() => document.querySelector("#full").open);
  await page.click('#full a[href="#kept"]'); // the project's cells
  await page.waitForFunction(() => document.querySelector("#kept").open && document.querySelectorAll("#kept tbody tr").length > 20);
  await page.click('.sentences a[href="#claims"]');
  await page.waitForFunction(() => document.querySelector("#claims").open);
  const claim = await load("reference", "#claim-E1", { file: "report" });
  assert.equal(await claim.$eval("#claim-E1", (one) => one.open && one.closest("#claims").open), true);
  await claim.close();
  leave(page);
});

await check("what a phone folds unfolds by a tap, in a wide window and on paper", async () => {
  const page = await load("erring", "", { width: 390, file: "report" });
  await unfold(page);
  const folded = () => page.$$eval(".fold", (list) => list.filter((one) => !one.open).length);
  const whole = () => page.waitForFunction(() => [...document.querySelectorAll(".fold")].every((one) => one.open));
  const all = await folded();
  assert.ok(all > 2);
  await page.click("#errors .fold summary");
  assert.equal(await folded(), all - 1);
  await page.setViewport({ width: 1280, height: 900 });
  await whole();
  assert.equal(await page.$eval(".fold > summary", (one) => one.offsetHeight), 0);
  await page.setViewport({ width: 390, height: 844 });
  await page.waitForFunction(() => [...document.querySelectorAll(".fold")].every((one) => !one.open));
  await page.emulateMediaType("print");
  await whole();
  await page.close();
});

await check("on paper the explorer's dark scheme is light", async () => {
  const page = await load("reference");
  await page.click("#theme");
  const ink = () => page.evaluate(() => getComputedStyle(document.documentElement).color);
  assert.equal(await ink(), "rgb(230, 232, 236)");
  await page.emulateMediaType("print");
  assert.equal(await ink(), "rgb(29, 33, 41)");
  await page.close();
});

// --- speed ----------------------------------------------------------------------------------------------------

await check("10 MB of results", async () => {
  const { megabytes, runs } = expected.large;
  assert.ok(megabytes > 10);
  const page = await load("large");
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
