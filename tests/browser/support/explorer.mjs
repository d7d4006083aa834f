// For the checks of the explorer: a headless Chromium, pages in it that are kept from check to check, and what was complained about.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";

const require = createRequire(`${process.env.KBVH_EXPLORER}/package.json`);
const puppeteer = require("puppeteer-core");
export const expected = JSON.parse(readFileSync(process.argv[2], "utf8"));
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
  timeout: 300_000, // a busy machine takes minutes to start it
  protocolTimeout: 300_000,
});
const complaints = [];
let checks = 0;
const took = []; // [milliseconds, check]

/** Runs one check; what it throws is a complaint. */
export function check(what, work) {
  const began = performance.now();
  return Promise.resolve()
    .then(work)
    .then(() => (checks += 1))
    .catch((problem) => {
      console.log(`FAILED: ${what}: ${problem.message}`);
      complaints.push(what);
    })
    .then(() => took.push([performance.now() - began, what]));
}

/** Loads a page in a tab of its own; errors of its console, and requests to a network, are complaints. */
export async function load(which, link = "", { width = 1440, scheme = "light", file = "page" } = {}) {
  const page = await browser.newPage();
  page.setDefaultTimeout(240_000);
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

const idle = new Map(); // pages that checks have left, by what they show
/** Leaves a page to the next check that opens the same one. */
export const leave = (page) => idle.set(page.shows, page);

/** Opens a page as `load` does, in the tab of an earlier check if there is one: the page follows the link, the width and the scheme. */
export async function open(which, link = "", { width = 1440, scheme = "light", file = "page" } = {}) {
  const shows = `${which} ${file}`;
  let page = idle.get(shows);
  idle.delete(shows);
  if (!page) page = Object.assign(await load(which, link, { width, scheme, file }), { shows });
  else {
    await page.bringToFront();
    await page.setViewport({ width, height: 900 });
    await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
    await page.evaluate((link) => {
      document.activeElement?.blur();
      history.replaceState(null, "", link || location.pathname);
      if (window.explorer) dispatchEvent(new PopStateEvent("popstate"));
      else // a report, as it is loaded
        document.querySelectorAll("details").forEach((one) => (one.open = one.matches(".fold, #errors") && innerWidth > 760));
      scrollTo(0, 0);
    }, link);
    await drawn(page);
  }
  return page;
}

/** Waits until figures are drawn: they are in the frame after the one that knows their widths. */
export const drawn = (page) =>
  page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => requestAnimationFrame(done)))));

/** Whether two numbers are equal but for rounding. */
export const near = (a, b) =>
  a === null || b === null ? a === b : Math.abs(a - b) <= 1e-9 * Math.max(Math.abs(a), Math.abs(b));

/** Expects a ratio of the page to be that of Python: [middle, low, high, paired, is an interval], or null. */
export function sameRatio(own, python, place) {
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

/** Ends the browser and says how the checks were; returns the number of complaints. */
export async function finish() {
  await browser.close();
  took.sort((a, b) => b[0] - a[0]);
  console.log(`slowest: ${took.slice(0, 6).map(([time, what]) => `${what} ${(time / 1000).toFixed(1)} s`).join("; ")}`);
  console.log(`${checks} checks passed, ${complaints.length} complaints`);
  return complaints.length;
}
