// Files that are opened in the page, and points that lead to commands.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

import { check, drawn, expected, leave, load, open } from "../support/explorer.mjs";

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
    leave(page);
  });

await check("files are opened, and what is no file of results is refused in one sentence", async () => {
  const page = await load("reference", "#view=overview&l=10", { scheme: "dark" });
  const picker = await page.$('input[type="file"]');
  await picker.uploadFile(expected.merged.results);
  await page.waitForFunction((count) => window.explorer.model.runs.length === count, {}, expected.merged.runs);
  assert.match(await page.$eval(".notes summary", (one) => one.textContent), / · is it faster\? · /);
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
  const other = await load("reference", await page.evaluate(() => location.hash));
  assert.equal(await other.$eval(".command", (one) => one.textContent), command);
  await page.keyboard.press("Escape");
  assert.equal(await page.$eval("#details", (panel) => panel.hidden), true);
  await other.close();
  leave(page);
});

await check("arrow keys and Enter reach every kind of figure", async () => {
  for (const view of ["answer", "overview", "pairwise", "errors", "scaling", "frames"]) {
    const page = await open("reference", `#view=${view}`);
    await page.focus('.plot[role="application"]');
    for (const key of ["ArrowRight", "ArrowDown", "ArrowRight", "Enter"]) await page.keyboard.press(key);
    assert.equal(await page.$eval("#details", (panel) => panel.hidden), false, view);
    assert.ok(await page.evaluate(() => document.activeElement.id === "details"), view);
    leave(page);
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
  leave(page);
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
  leave(page);
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
  const folder = mkdtempSync(join(tmpdir(), "kbvh-again-"));
  for (const text of commands) {
    const lines = text.replace(/^kbvh/m, `'${process.env.KBVH_PROGRAM}'`).replace("--out again", "--print-plan");
    const told = spawnSync("sh", ["-c", lines], { encoding: "utf8", cwd: folder });
    assert.equal(told.status, 0, `${lines}: ${told.stderr}`);
  }
  rmSync(folder, { recursive: true });
  leave(page);
  const shapes = await open("merged");
  const text = await shapes.evaluate(() => window.explorer.command(window.explorer.model.runs[0]).text);
  assert.match(text, /cat > again.json <<'PLAN'[^]*"shape": "sphere"[^]*kbvh run --plan again.json --out again/);
  leave(shapes);
});
