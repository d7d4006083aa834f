// The pages in headless Chromium, from files, without a network: they load without errors, links lead somewhere, predictions
// hide their results, and every exercise's checker judges by the real engine as by the native one.
import assert from "node:assert/strict";
import { existsSync, readdirSync, readFileSync } from "node:fs";
import { join, resolve } from "node:path";
import { after, before, test } from "node:test";
import { checkers } from "../../analysis/lessons/checkers/index.mjs";
import { play } from "../../analysis/lessons/checkers/parts.mjs";
import { lessons } from "../../analysis/lessons/renderer/build.mjs";
import { walk } from "../../analysis/lessons/trace.mjs";
import { launch } from "./browser.mjs";

const folder = resolve(process.env.KBVH_LESSONS), walker = process.env.KBVH_WALKER;
const names = readdirSync(folder).filter((name) => name.endsWith(".html"));
const hasLab = existsSync(join(folder, "../lab.js"));
const needsLab = hasLab ? {} : { skip: "build/lab/lab.js is missing: experiments/lab builds it" };
let browser;

before(async () => {
  browser = await launch();
});
after(() => browser.close());

/// Opens a page and collects everything that goes wrong in it, and every request that leaves the machine.
async function open(name) {
  const page = await browser.newPage(), wrong = [];
  page.on("console", (message) => message.type() === "error" && wrong.push(message.text()));
  page.on("pageerror", (error) => wrong.push(error.message));
  page.on("request", (request) => /^https?:/.test(request.url()) && wrong.push("asks for " + request.url()));
  page.on("requestfailed", (request) => wrong.push("does not get " + request.url()));
  const begin = performance.now();
  await page.goto("file://" + join(folder, name), { waitUntil: "domcontentloaded" });
  return { page, wrong, seconds: (performance.now() - begin) / 1000 };
}

test("there is a page for each lesson", () => {
  assert.equal(lessons().length, 9);
  for (const { name } of lessons()) assert.ok(names.includes(name + ".html"), name);
});

for (const name of names)
  test(`${name} loads without an error, and its links lead somewhere`, async () => {
    const { page, wrong, seconds } = await open(name);
    await page.waitForNetworkIdle({ idleTime: 50 });
    assert.deepEqual(wrong, []);
    if (seconds > 2) console.log(`${name} took ${seconds.toFixed(1)} s to be readable`);
    const { links, ids, text, headings, untitled, wide } = await page.evaluate(() => ({
      links: [...document.querySelectorAll("a[href]")].map((a) => a.getAttribute("href")),
      ids: [...document.querySelectorAll("[id]")].map((element) => element.id),
      text: document.body.innerText,
      headings: document.querySelectorAll("h1").length,
      untitled: [...document.querySelectorAll("svg.picture")].filter((svg) => !svg.querySelector("title")?.textContent).length,
      wide: document.documentElement.scrollWidth > document.documentElement.clientWidth,
    }));
    assert.equal(headings, 1);
    assert.equal(untitled, 0);
    assert.ok(!wide, "the page scrolls sideways");
    assert.equal(new Set(ids).size, ids.length, "an id occurs twice");
    for (const mark of ["{{", ":::", "undefined", "NaN", "[@"]) assert.ok(!text.includes(mark), `'${mark}' in the text`);
    assert.match(text, /CC BY 4\.0/);
    for (const link of links.filter((to) => !/^https?:/.test(to))) {
      const [file, anchor] = link.split("#");
      if (file === "../index.html" && !hasLab) continue;
      if (file) assert.ok(existsSync(join(folder, file)), `${link} leads nowhere`);
      if (anchor) assert.ok((file ? readFileSync(join(folder, file), "utf8").includes(`id="${anchor}"`) : ids.includes(anchor)), `${link} leads nowhere`);
    }
    await page.close();
  });

test("at a width of 390 pixels no page scrolls sideways", async () => {
  for (const name of names) {
    const { page } = await open(name);
    await page.setViewport({ width: 390, height: 844 });
    const wide = await page.evaluate(() => [...document.querySelectorAll("body *")].filter((element) => element.getBoundingClientRect().right > innerWidth + 1
      && !element.closest("nav.course, .table, pre, .math, .katex-mathml, .skip, .scroll")).map((element) => element.outerHTML.slice(0, 90)));
    assert.deepEqual(wide, [], name);
    await page.close();
  }
});

test("a prediction hides its result until an answer is committed, and remembers it", async () => {
  for (const { name } of lessons()) {
    const { page } = await open(name + ".html");
    const seen = await page.evaluate(() => [...document.querySelectorAll(".predict")].map((form) => {
      const result = document.querySelector(`[data-result="${form.dataset.predict}"]`), button = form.querySelector("button");
      const rights = form.querySelectorAll("[data-right]").length, choices = form.querySelectorAll("input").length;
      const before = result.hidden && (!result.nextElementSibling || result.nextElementSibling.matches("h2, .predict") || result.nextElementSibling.hidden);
      button.click();
      const unchosen = result.hidden;
      form.querySelector("input").checked = true;
      button.click();
      return { before, unchosen, after: result.hidden, rights, choices };
    }));
    assert.ok(seen.length >= 1, name);
    for (const { choices, ...rest } of seen) {
      assert.deepEqual(rest, { before: true, unchosen: true, after: false, rights: 1 }, name);
      assert.ok(choices >= 3);
    }
    await page.close();
  }
});

test("questions accept the number and refuse others", async () => {
  for (const { name } of lessons()) {
    const { page } = await open(name + ".html");
    const answers = await page.evaluate(() => [...document.querySelectorAll(".answer")].map((form) => {
      const say = (text) => {
        form.querySelector("input").value = text;
        form.querySelector("button").click();
        return form.querySelector("output").textContent;
      };
      const value = Number(form.dataset.value);
      return [say(""), say(String(value + 7)), say(String(Math.round(value)))];
    }));
    assert.ok(answers.length >= 1, name);
    for (const answer of answers) assert.deepEqual(answer, ["Enter a number.", "Not this number. Try again.", "Right."], name);
    await page.close();
  }
});

test("the real engine judges exercises as the native program does", needsLab, async () => {
  const { page, wrong } = await open("3-certificates.html");
  for (const [name, checker] of Object.entries(checkers)) {
    const cases = [[checker.solution(), true], ...[checker.start(), ...checker.wrong()].map((state) => [state, false])];
    for (const [state, ok] of cases) {
      const verdict = await page.evaluate(async (which, given) => {
        const lab = { getState: () => structuredClone(given) };
        return globalThis.kbvhLessons.checkers[which].check(lab, await globalThis.kbvhLessons.api());
      }, name, state);
      assert.equal(verdict.ok, ok, `${name}, ${state.scene.name}: ${verdict.message}`);
      const api = { trace: async (request) => walk(walker, [request])[0] };
      assert.equal(verdict.message, (await checker.check({ getState: () => structuredClone(state) }, api)).message, name);
    }
  }
  assert.deepEqual(wrong, []);
  await page.close();
});

test("the engine's events are those of the native program, step by step", needsLab, async () => {
  const { page } = await open("4-kinetic-tree.html");
  for (const name of ["race4", "race", "flag", "shoal", "tangents", "relay-mixed", "tie", "combs"]) {
    const [strategy, scene] = await page.evaluate((which) => [globalThis.kbvhLessons.states[which].state.strategy, globalThis.kbvhLessons.states[which].state.scene], name);
    const request = play({ scene }, strategy, { l: 3 });
    const steps = await page.evaluate(async (asked) => (await (await globalThis.kbvhLessons.api()).trace(asked)).steps.map(({ event, touched }) => ({ event, touched })), request);
    const native = walk(walker, [request])[0].steps;
    const brief = ({ event, touched }) => [event.kind, event.body, event.node, event.time, ...(event.kind === "bound" ? [event.side, event.winner, event.loser] : [event.otherBody, event.otherNode]), touched.map((change) => [change.body, change.node, change.side, change.oldVertex, change.newVertex])];
    assert.ok(native.length > 0, name);
    assert.deepEqual(steps.map(brief), native.map(brief), name);
  }
  await page.close();
});

test("the lab opens in every lesson at each prepared state", needsLab, async () => {
  for (const { name } of lessons()) {
    const { page, wrong } = await open(name + ".html");
    const places = await page.$$eval(".lab", (labs) => labs.length);
    assert.ok(places >= 2, name);
    for (let i = 0; i < places; ++i) {
      const note = await page.evaluate(async (at) => {
        for (const form of document.querySelectorAll(".predict")) form.querySelector("input").checked = true, form.querySelector("button").click();
        const place = document.querySelectorAll(".lab")[at], { states, open: show, mounted } = globalThis.kbvhLessons;
        const lab = await show(place, states[place.dataset.lab].state);
        const { scene, strategy } = lab?.getState() ?? {};
        const result = [place.querySelector(".lab-note").textContent, scene?.name, strategy];
        lab?.destroy();
        mounted.delete(place);
        place.querySelector(".lab-place").replaceChildren();
        return [...result, states[place.dataset.lab].state.scene.name, states[place.dataset.lab].state.strategy];
      }, i);
      assert.ok(!note[0].includes("could not"), `${name}: ${note[0]}`);
      assert.deepEqual(note.slice(1, 3), note.slice(3), name);
    }
    assert.deepEqual(wrong, [], name);
    await page.close();
  }
});

test("the buttons of an exercise load a solution and check it", needsLab, async () => {
  const { page, wrong } = await open("3-certificates.html");
  const verdicts = await page.evaluate(async () => {
    const section = document.querySelector('[data-exercise="twelve-events"]'), output = section.querySelector(".verdict-line");
    const until = async (test) => {
      for (let i = 0; i < 400 && !test(); ++i) await new Promise((resolve) => setTimeout(resolve, 50));
    };
    section.querySelector(".check-scene").click();
    await until(() => /event/.test(output.textContent));
    const first = [output.textContent, output.className];
    section.querySelector(".show-solution").click();
    await until(() => !section.querySelector(".lab-note").textContent.startsWith("Loading") && !section.querySelector(".open-lab").disabled);
    section.querySelector(".check-scene").click();
    await until(() => /Exactly/.test(output.textContent));
    return [first, [output.textContent, output.className]];
  });
  assert.match(verdicts[0][0], /This scene has \d+ events/);
  assert.equal(verdicts[0][1], "verdict-line wrong");
  assert.deepEqual(verdicts[1], ["Exactly twelve events: 6 at lower x, 6 at upper x.", "verdict-line right"]);
  assert.deepEqual(wrong, []);
  await page.close();
});
