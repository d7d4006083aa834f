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
const patience = 240000; // milliseconds: a busy machine is slow
let browser, page, wrong = [];

before(async () => {
  browser = await launch();
  page = await browser.newPage();
  page.setDefaultTimeout(patience);
  page.on("console", (message) => message.type() === "error" && wrong.push(message.text()));
  page.on("pageerror", (error) => wrong.push(error.message));
  page.on("request", (request) => /^https?:/.test(request.url()) && wrong.push("asks for " + request.url()));
  page.on("requestfailed", (request) => wrong.push("does not get " + request.url()));
});
after(() => browser?.close());

/// Opens a page in the one tab of these tests. From then on `wrong` has everything that goes wrong in it, and every request that leaves the
/// machine. Returns the seconds until the page was readable.
async function open(name, { width = 800, height = 600 } = {}) {
  await page.goto("about:blank"); // what the page before still asks for ends here
  wrong = [];
  await page.setViewport({ width, height });
  const begin = performance.now();
  await page.goto("file://" + join(folder, name), { waitUntil: "domcontentloaded" });
  return (performance.now() - begin) / 1000;
}

test("there is a page for each lesson", () => {
  assert.equal(lessons().length, 9);
  for (const { name } of lessons()) assert.ok(names.includes(name + ".html"), name);
});

const isLesson = new Set(lessons().map(({ name }) => name + ".html"));
let labs = 0;
const labTabs = new Map(); // of the whole lab, and of the compact one, each opened once: later links are followed in it

/// Opens a link of a lab; returns what the lab shows.
async function labBehind(address, kind) {
  let tab = labTabs.get(kind);
  if (!tab) {
    labTabs.set(kind, (tab = await browser.newPage()));
    tab.setDefaultTimeout(patience);
    await tab.goto(address);
    await tab.waitForFunction(() => document.querySelector("[data-kbvh-lab-page]")?.lab?.state.at);
  } else {
    await tab.bringToFront();
    await tab.evaluate((hash) => new Promise((resolve) => {
      document.querySelector("[data-kbvh-lab-page]").lab.on("load", resolve);
      location.hash = hash;
    }), new URL(address).hash);
  }
  const shown = await tab.evaluate(() => [document.querySelector("[data-kbvh-lab-page]").lab.state.strategy, document.querySelector(".kbvh-lab.compact") !== null,
    document.querySelector(".lab-head h1") === null]);
  await page.bringToFront();
  return shown;
}

// A page is opened once for everything that is looked at in it: to load it takes longer than to look.
for (const name of names)
  test(name, async (of) => {
    const seconds = await open(name);

    await of.test("loads without an error, and its links lead somewhere", async () => {
      await page.waitForNetworkIdle({ idleTime: 50 });
      assert.deepEqual(wrong, []);
      if (seconds > 2) console.log(`${name} took ${seconds.toFixed(1)} s to be readable`);
      const { links, ids, text, headings, untitled, wide } = await page.evaluate(() => ({
        links: [...document.querySelectorAll("a[href]:not(.lab-link)")].map((a) => a.getAttribute("href")),
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
    });

    // What predictions hide is seen from here on.
    if (isLesson.has(name)) {
      await of.test("hides the result of a prediction until an answer is committed, and remembers it", async () => {
        const seen = await page.evaluate(() => [...document.querySelectorAll(".predict")].map((form) => {
          const result = document.querySelector(`[data-result="${form.dataset.predict}"]`), button = form.querySelector("button");
          const choices = form.querySelectorAll("input").length, right = globalThis.kbvhLessons.unseal(form.dataset.sealed, form.dataset.predict);
          const before = result.hidden && (!result.nextElementSibling || result.nextElementSibling.matches("h2, .predict") || result.nextElementSibling.hidden);
          button.click();
          const unchosen = result.hidden;
          form.querySelector("input").checked = true;
          button.click();
          const marked = [...form.querySelectorAll("li")].findIndex((item) => item.classList.contains("right")) === right;
          return { before, unchosen, after: result.hidden, marked, choices };
        }));
        assert.ok(seen.length >= 1, name);
        for (const { choices, ...rest } of seen) {
          assert.deepEqual(rest, { before: true, unchosen: true, after: false, marked: true }, name);
          assert.ok(choices >= 3);
        }
      });

      await of.test("accepts the number of a question, and gives a reason for every other one", async () => {
        const answers = await page.evaluate(() => [...document.querySelectorAll(".answer")].map((form) => {
          const say = (text) => {
            form.querySelector("input").value = text;
            form.querySelector("button").click();
            return form.querySelector("output").textContent;
          };
          const { value, known } = globalThis.kbvhLessons.unseal(form.dataset.sealed, form.dataset.answer);
          return { blank: say(""), less: say(String(value - 1.5)), more: say(String(1000 * value + 1e6)), known: known.map(([wrong]) => say(String(wrong))), right: say(String(Math.round(value))) };
        }));
        assert.ok(answers.length >= 1, name);
        for (const { blank, right, less, more, known } of answers) {
          assert.deepEqual([blank, right], ["Enter a number.", "Right."], name);
          const reasons = [less, more, ...known];
          for (const reason of reasons) assert.ok(reason.length > 25 && reason !== "Right." && !/try again/i.test(reason), `${name}: '${reason}'`);
          assert.ok(new Set(reasons).size >= 2, name);
        }
      });
    }

    await of.test("does not scroll sideways at a width of 390 pixels", async () => {
      await page.setViewport({ width: 390, height: 844 });
      const wide = await page.evaluate(() => [...document.querySelectorAll("body *")].filter((element) => element.getBoundingClientRect().right > innerWidth + 1
        && !element.closest("nav.course, .table, pre, .math, .katex-mathml, .skip, .scroll")).map((element) => element.outerHTML.slice(0, 90)));
      assert.deepEqual(wide, [], name);
    });

    await of.test("marks what is cut at 390 pixels, and not what is whole", async () => {
      await page.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))));
      const wrong = await page.evaluate(() => [...document.querySelectorAll("body *")].filter((element) => {
        const cut = element.clientWidth > 0 && element.scrollWidth > element.clientWidth + 1 && ["auto", "scroll"].includes(getComputedStyle(element).overflowX);
        return cut !== /right/.test(element.dataset.more ?? "");
      }).map((element) => element.outerHTML.slice(0, 90)));
      assert.deepEqual(wrong, [], name);
    });

    if (!isLesson.has(name)) return;
    await page.setViewport({ width: 800, height: 600 });

    await of.test("has a link and an embed for each lab that open its state", needsLab, async () => {
      await page.waitForFunction(() => [...document.querySelectorAll(".copy-embed")].every((button) => button.dataset.code));
      const found = await page.evaluate(() => [...document.querySelectorAll(".lab")].map((place) => ({ lab: place.dataset.lab, link: place.querySelector(".lab-link")?.href,
        code: place.querySelector(".copy-embed")?.dataset.code, strategy: globalThis.kbvhLessons.states[place.dataset.lab].state.strategy })));
      for (const { lab, link, code } of found) {
        assert.match(link ?? "", /lab\/index\.html#s=[\w-]{50,}$/, lab);
        assert.match(code ?? "", /^<iframe src="[^"]+lab\/index\.html#embed=[\w-]{50,}" title="[^"]+"/, lab);
      }
      labs += found.length;
      // One of them in full: the whole lab behind the link, a compact one in the frame.
      const [{ link, code, strategy }] = found;
      for (const [address, compact] of [[link, false], [/src="([^"]+)"/.exec(code)[1], true]])
        assert.deepEqual(await labBehind(address, compact ? "compact" : "whole"), [strategy, compact, compact], name);
      assert.deepEqual(wrong, []);
    });

    await of.test("opens the lab at each prepared state", needsLab, async () => {
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
    });
  });

test("the lessons have labs", needsLab, () => assert.ok(labs >= 30, `${labs} labs`));

test("on a phone the transport of an opened lab stays in sight, below the bar of lessons", needsLab, async () => {
  await open("3-certificates.html", { width: 390, height: 844 });
  await page.evaluate(() => { document.querySelectorAll("article > [hidden], .result[hidden]").forEach((element) => (element.hidden = false)); document.querySelector('[data-lab="race4"] .open-lab').click(); });
  await page.waitForFunction(() => document.querySelector('[data-lab="race4"] .kbvh-lab[data-phase=ready]'));
  for (const view of ["stage", "tree", "diagram"]) {
    const hit = await page.evaluate(async (view) => {
      document.querySelector(`[data-lab="race4"] .panel-${view}`).scrollIntoView({ block: "center" });
      await new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve)));
      const { x, y, width, height } = document.querySelector('[data-lab="race4"] .transport .play').getBoundingClientRect();
      return document.elementFromPoint(x + width / 2, y + height / 2)?.className;
    }, view);
    assert.equal(hit, "play", view);
  }
  assert.deepEqual(wrong, []);
});

test("no answer stands in a page's source", () => {
  for (const { name } of lessons()) {
    const html = readFileSync(join(folder, name + ".html"), "utf8");
    for (const mark of ["data-value", "data-right", "[&lt;]", "[&gt;]"]) assert.ok(!html.includes(mark), `${name}: ${mark}`);
    assert.ok((html.match(/data-sealed="[\w+/=]+"/g) ?? []).length >= 2, name);
  }
});

test("the menu of a student has no entry for teachers", () => {
  for (const name of names.filter((file) => file !== "teacher.html")) {
    const menu = /<nav class="course"[\s\S]*?<\/nav>/.exec(readFileSync(join(folder, name), "utf8"))[0];
    assert.ok(!menu.includes("teacher"), name);
  }
});

test("answers survive a reload, and the first page counts them", async () => {
  await open("3-certificates.html");
  const answer = () => page.evaluate(() => {
    const form = document.querySelector(".answer");
    return [form.querySelector("input").value, form.querySelector("output").textContent];
  });
  await page.evaluate(() => localStorage.clear());
  await page.reload();
  assert.deepEqual(await answer(), ["", ""]);
  await page.evaluate(() => {
    const form = document.querySelector(".answer");
    form.querySelector("input").value = "4";
    form.querySelector("button").click();
  });
  await page.reload();
  assert.deepEqual(await answer(), ["", ""], "a wrong number is not kept");
  await page.evaluate(() => {
    const form = document.querySelector(".answer");
    form.querySelector("input").value = "5";
    form.querySelector("button").click();
  });
  await page.reload();
  assert.deepEqual(await answer(), ["5", "Right."]);
  await page.goto("file://" + join(folder, "index.html"));
  assert.deepEqual(await page.$$eval(".progress", (marks) => marks.map((mark) => mark.textContent).filter(Boolean)), ["1 of 5 solved"]);
  await page.evaluate(() => localStorage.clear());
});

test("the real engine judges exercises as the native program does", needsLab, async () => {
  await open("3-certificates.html");
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
});

test("the engine's events are those of the native program, step by step", needsLab, async () => {
  await open("4-kinetic-tree.html");
  for (const name of ["race4", "race", "flag", "shoal", "tangents", "relay-mixed", "tie", "combs"]) {
    const [strategy, scene] = await page.evaluate((which) => [globalThis.kbvhLessons.states[which].state.strategy, globalThis.kbvhLessons.states[which].state.scene], name);
    const request = play({ scene }, strategy, { l: 3 });
    const steps = await page.evaluate(async (asked) => (await (await globalThis.kbvhLessons.api()).trace(asked)).steps.map(({ event, touched }) => ({ event, touched })), request);
    const native = walk(walker, [request])[0].steps;
    const brief = ({ event, touched }) => [event.kind, event.body, event.node, event.time, ...(event.kind === "bound" ? [event.side, event.winner, event.loser] : [event.otherBody, event.otherNode]), touched.map((change) => [change.body, change.node, change.side, change.oldVertex, change.newVertex])];
    assert.ok(native.length > 0, name);
    assert.deepEqual(steps.map(brief), native.map(brief), name);
  }
});

test("the buttons of an exercise check a scene; only an own solution counts as solved, and that survives a reload", needsLab, async () => {
  await open("3-certificates.html");
  await page.evaluate(() => localStorage.clear());
  await page.reload();
  const push = (button, until) => page.evaluate(async (selector, pattern) => {
    const section = document.querySelector('[data-exercise="twelve-events"]'), output = section.querySelector(".verdict-line");
    const idle = () => !section.querySelector(".lab-note").textContent.startsWith("Loading") && !section.querySelector(".open-lab").disabled && !section.querySelector(".check-scene").disabled;
    section.querySelector(selector).click();
    for (let i = 0; i < 4000 && !(new RegExp(pattern).test(output.textContent) && idle()); ++i) await new Promise((resolve) => setTimeout(resolve, 50));
    return [output.textContent, output.className, section.classList.contains("solved")];
  }, button, until);
  const first = await push(".check-scene", "events");
  assert.match(first[0], /This scene has \d+ events/);
  assert.deepEqual(first.slice(1), ["verdict-line wrong", false]);
  await push(".show-solution", "A solution");
  const loaded = await push(".check-scene", "Exactly");
  assert.match(loaded[0], /^Exactly twelve events: 6 at lower x, 6 at upper x\. This is the solution that you loaded/);
  assert.deepEqual(loaded.slice(1), ["verdict-line ", false]);
  // A scene of one's own: the same order of events at other places.
  await page.evaluate(async () => {
    const lab = globalThis.kbvhLessons.mounted.get(document.querySelector('[data-exercise="twelve-events"] .lab')), state = lab.getState();
    for (const body of state.scene.bodies) body.positions = body.positions.map((row) => Array.from(row, (x, i) => (i % 3 === 0 ? 2 * x : x)));
    await lab.setState(state);
  });
  assert.deepEqual(await push(".check-scene", "Exactly"), ["Exactly twelve events: 6 at lower x, 6 at upper x.", "verdict-line right", true]);
  await page.reload();
  assert.deepEqual(await page.$eval('[data-exercise="twelve-events"]', (section) => [section.querySelector(".verdict-line").textContent, section.classList.contains("solved")]),
    ["You have solved this exercise.", true]);
  await page.evaluate(() => localStorage.clear());
  assert.deepEqual(wrong, []);
});
