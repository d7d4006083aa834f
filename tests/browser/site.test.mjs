// The built site in Chromium, from its folder and without a network, in both colour schemes: no page has an error in its console, asks for
// a file that is not there or for another machine; colours follow the scheme; no page of the site is wider than a phone. $KBVH_SITE is the
// folder with index.html. One tab visits every page once: loading a page costs far more than to look at it in another scheme or width.
import assert from 'node:assert/strict';
import { existsSync, readFileSync, readdirSync } from 'node:fs';
import { join, relative, resolve } from 'node:path';
import { after, before, test } from 'node:test';
import { pathToFileURL } from 'node:url';

import { startBrowser } from './support/chromium.mjs';

const site = resolve(process.env.KBVH_SITE);
const schemes = ['light', 'dark'];
let chromium, page, wrong = [];

before(async () => {
  chromium = await startBrowser();
  page = await chromium.browser.newPage();
  page.setDefaultTimeout(240000); // a busy machine is slow
  page.on('console', (message) => message.type() === 'error' && wrong.push(`console: ${message.text()}`));
  page.on('pageerror', (error) => wrong.push(`error: ${error.message}`));
  page.on('requestfailed', (request) => wrong.push(`missing: ${request.url().replace(pathToFileURL(site).href, '')}`));
  page.on('request', (request) => { if (/^(https?|wss?):/.test(request.url())) wrong.push(`asks for ${request.url()}`); });
  await page.setOfflineMode(true);
});
after(() => chromium?.close());

/** The pages of a folder, but those of Doxygen: of its thousands only the first one and those that the page cpp.html names. */
function pagesOf(folder) {
  const found = readdirSync(folder, { withFileTypes: true }).flatMap((entry) =>
    entry.isDirectory() ? (entry.name === '_static' || folder === site && entry.name === 'api' ? [] : pagesOf(join(folder, entry.name)))
      : entry.name.endsWith('.html') ? [relative(site, join(folder, entry.name))] : []);
  if (folder !== site || !existsSync(join(site, 'cpp.html'))) return found.sort();
  return [...found, ...new Set(readFileSync(join(site, 'cpp.html'), 'utf8').match(/api\/\w+\.html/g) ?? [])].sort();
}
const pages = pagesOf(site);
/** Pages made by Sphinx: the site's own look. */
const own = pages.filter((name) => !/^(api|lab|report)\//.test(name));

const emulate = (scheme) => page.emulateMediaFeatures([{ name: 'prefers-color-scheme', value: scheme }, { name: 'prefers-reduced-motion', value: 'reduce' }]);
const size = (width) => page.setViewport({ width, height: 900 });
const drawn = () => page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));

/** Opens a page in the tab; from then on `wrong` collects what goes wrong in it. */
async function open(name, scheme, width = 1280) {
  await page.goto('about:blank'); // what the page before still asks for ends here
  wrong = [];
  await size(width);
  await emulate(scheme);
  await page.goto(pathToFileURL(join(site, name)).href);
  await drawn();
}

/** How bright the middle of the page is, from 0 to 1: the background of what stands there, or of the nearest element around that has one. */
const brightness = () => page.evaluate(() => {
  for (let element = document.elementFromPoint(innerWidth / 2, 300); element; element = element.parentElement) {
    if (element.closest('pre, svg, canvas, img, figure')) continue;
    const [r, g, b, a = 1] = getComputedStyle(element).backgroundColor.match(/[\d.]+/g).map(Number);
    if (a > 0.5) return (r + g + b) / 765;
  }
  return 1;
});

/** Returns how bright the page is once it has the look of the scheme, or else after three seconds. */
async function brightnessIn(scheme) {
  for (const began = performance.now();;) {
    const bright = await brightness();
    if ((scheme === 'dark' ? bright <= 0.3 : bright >= 0.8) || performance.now() - began > 3000) return bright;
    await drawn();
  }
}

let seen = null;
/** Visits every page once: {faults: {light, dark}, wide}, each a list of texts. */
function visits() {
  return seen ??= (async () => {
    const faults = { light: [], dark: [] }, wide = [];
    for (const name of pages) {
      await open(name, 'light');
      for (const scheme of schemes) {
        if (scheme === 'dark') await emulate('dark').then(drawn);
        // Doxygen of Debian 12 knows one scheme only.
        const bright = name.startsWith('api/') ? null : await brightnessIn(scheme);
        if (bright !== null && (scheme === 'dark' ? bright > 0.3 : bright < 0.8)) wrong.push(`its background is ${scheme === 'dark' ? 'bright' : 'dark'} (${bright.toFixed(2)})`);
        if (wrong.length) faults[scheme].push(`${name}: ${[...new Set(wrong)].join('; ')}`);
        wrong = [];
      }
      if (!own.includes(name)) continue;
      await size(390).then(drawn);
      const [whole, window] = await page.evaluate(() => [document.documentElement.scrollWidth, document.documentElement.clientWidth]);
      if (whole > window + 1) wide.push(`${name}: ${whole}`);
      const cut = await page.$$eval('.error-table', (all) => all.filter((table) => table.scrollWidth > table.parentElement.clientWidth + 1).length);
      if (cut) wide.push(`${name}: ${cut} tables of time against error are cut`);
      if (wrong.length) wide.push(`${name}: ${[...new Set(wrong)].join('; ')}`);
    }
    return { faults, wide };
  })();
}

const firstPages = new Map();
/** What the first page shows after its comparison has been measured. */
function firstPage(scheme, width) {
  const key = `${scheme} ${width}`;
  if (!firstPages.has(key)) firstPages.set(key, (async () => {
    await open('index.html', scheme, width);
    await page.waitForFunction(() => document.querySelector('[data-comparison]')?.dataset.told);
    const found = await page.evaluate(async () => {
      const waysEnd = document.querySelector('.ways').getBoundingClientRect().bottom + scrollY;
      document.querySelector('.panel-tabs').scrollIntoView({ block: 'center' });
      await new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve)));
      const { x, y, width, height } = document.querySelector('.transport .play').getBoundingClientRect();
      return { waysEnd, hit: document.elementFromPoint(x + width / 2, y + height / 2)?.className, finding: document.querySelector('.finding').textContent,
        ways: [...document.querySelectorAll('.ways a')].map((a) => a.getAttribute('href')), lab: document.querySelectorAll('.comparison-lab canvas').length };
    });
    return { ...found, wrong: [...wrong] };
  })());
  return firstPages.get(key);
}

test('there is a site', () => assert.ok(own.length > 60 && existsSync(join(site, 'index.html')), `${own.length} pages in ${site}`));

for (const scheme of schemes)
  test(`${pages.length} pages load without an error, ${scheme}`, async () => assert.deepEqual((await visits()).faults[scheme], []));

test('at 390 pixels no page of the site scrolls sideways', async () => assert.deepEqual((await visits()).wide, []));

test('the switch of colours works', async () => {
  await open('start.html', 'light');
  const before = await brightness();
  await page.evaluate(() => [...document.querySelectorAll('.theme-toggle')].find((button) => button.offsetParent !== null).click());
  assert.ok(before > 0.8 && await brightnessIn('dark') < 0.3, 'the page stays as it was');
  await page.evaluate(() => localStorage.clear());
});

test('the first page compares two strategies and says what it found', async () => {
  for (const [scheme, width] of [['light', 1280], ['dark', 390]]) {
    const { finding, ways, lab, wrong } = await firstPage(scheme, width);
    assert.match(finding, /^On this cloth a kinetic AABB tree writes [\d.,]+ times fewer values than a refit, and is [\d.,]+ times (slower|faster)\.$/);
    assert.equal(ways.length, 3);
    for (const way of ways) assert.ok(existsSync(join(site, way)), way);
    assert.ok(lab > 3, `${lab} canvases`);
    assert.deepEqual(wrong, []);
  }
});

test('the first page is short, and on a phone the comparison keeps its transport in sight', async () => {
  const { waysEnd } = await firstPage('light', 1280);
  assert.ok(waysEnd < 1300, `the ways on end at ${waysEnd} of a window of 900 pixels`);
  assert.equal((await firstPage('dark', 390)).hit, 'play');
});

test('on a phone the report is at most three screens long, and all of it unfolds', async () => {
  await open('report/report.html', 'light', 390);
  const [tall, parts] = await page.evaluate(() => [document.documentElement.scrollHeight, document.querySelectorAll('.part:not([open])').length]);
  assert.ok(tall <= 3 * 844, `${tall} pixels`);
  assert.ok(parts > 5, `${parts} parts`);
  await page.evaluate(() => document.querySelectorAll('details').forEach((one) => { one.open = true; }));
  await drawn();
  const [whole, width] = await page.evaluate(() => [document.documentElement.scrollWidth, innerWidth]);
  assert.ok(whole <= width + 1, `unfolded it is ${whole} pixels wide`);
});

test('lab, course, report, explorer, Python and C++ are part of the site', () => {
  for (const name of ['lab/index.html', 'lab/lessons/index.html', 'report/report.html', 'report/explorer.html', 'python.html', 'notebooks.html', 'cpp.html', 'api/index.html'])
    assert.ok(existsSync(join(site, name)), name);
  const text = (name) => readFileSync(join(site, name), 'utf8');
  for (const method of ['World.advance', 'World.pairs', 'World.contacts']) assert.ok(text('python.html').includes(`>${method}<`), method);
  const notebooks = readdirSync(join(site, 'notebooks')).filter((name) => name.endsWith('.html'));
  assert.equal(notebooks.length, 4);
  for (const name of notebooks) assert.match(text(`notebooks/${name}`), /class="output"|highlight-text/, `${name} has no output`);
  assert.ok((text('cpp.html').match(/href="api\/(class|struct)kbvh/g) ?? []).length >= 12);
});
