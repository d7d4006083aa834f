// Numbers of the explorer: those of the Python analysis, of one study and of two commits side by side.
import assert from "node:assert/strict";

import { check, expected, leave, near, open, sameRatio } from "../support/explorer.mjs";

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
  await check(`${which}: times with their ends`, async () => {
    const own = await page.evaluate(() => {
      const { model, statistics } = window.explorer;
      return model.runs.map((run) => run.times.length && statistics.span(run, model.place, "with_motion"));
    });
    let compared = 0;
    python.spans.forEach((ends, i) => {
      if (!ends) return;
      const [low, high, isInterval] = ends;
      assert.equal(own[i].isInterval, isInterval, `run ${i}`);
      for (const [mine, other] of [[own[i].low, Math.min(low, own[i].middle)], [own[i].high, Math.max(high, own[i].middle)]])
        assert.ok(Math.abs(mine - other) <= 1e-4 * other, `run ${i}: ${mine} and ${other}`);
      compared += 1;
    });
    assert.ok(compared > 50, `${compared} compared`);
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
  leave(page);
}

await check("every bar over l or n encloses its point", async () => {
  for (const which of ["reference", "merged"])
    for (const view of ["answer&know=clip", "scaling"]) {
      const page = await open(which, `#view=${view}`);
      const outside = await page.$$eval("#view svg.chart", (charts) =>
        charts.flatMap((chart) => {
          const groups = [...chart.children].filter((one) => ["rule", "dot"].includes(one.getAttribute("aria-label")));
          let bars = [];
          const found = [];
          for (const group of groups)
            if (group.getAttribute("aria-label") === "rule") bars = [...group.querySelectorAll("line")].map((line) => ["x1", "y1", "y2"].map((name) => Number(line.getAttribute(name))));
            else
              for (const dot of group.children) {
                const [x, y] = dot.getAttribute("transform").match(/[\d.]+/g).map(Number);
                const bar = bars.find(([at]) => Math.abs(at - x) < 1);
                found.push(bar ? Math.max(Math.min(bar[1], bar[2]) - y, y - Math.max(bar[1], bar[2])) : Infinity);
              }
          return found;
        }),
      );
      assert.ok(outside.length > 3, `${which}, ${view}: ${outside.length} points`);
      const most = Math.max(...outside);
      assert.ok(most < 0.1, `${which}, ${view}: a point is ${most} pixels outside of its bar`);
      leave(page);
    }
});

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
  leave(page);
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
    leave(page);
  }
});
