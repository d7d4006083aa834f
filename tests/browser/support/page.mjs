// Opens the built page of the lab in Chromium, without a network, and gives tests handles to it.

import { existsSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath, pathToFileURL } from 'node:url';

import { startBrowser as startChromium } from './chromium.mjs';

const root = fileURLToPath(new URL('../../..', import.meta.url));

/** The page as built by experiments/lab. */
export const built = join(root, 'build/lab/index.html');
if (!existsSync(built)) throw new Error(`${built} is missing: run experiments/lab`);

/** Starts a browser that draws WebGL in software, and the same page without WebGL; `open` gives pages, `close` ends it. */
export async function startBrowser() {
  const { browser, close } = await startChromium(['--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--disable-gpu-compositing']);
  return { open: (options) => open(browser, options), close };
}

/**
 * Opens the page with a hash and waits until the lab shows a state. `problems` collects errors of the console, exceptions
 * and requests that leave the machine.
 */
async function open(browser, { hash = '', width = 1440, height = 900, scheme = 'light', file = built } = {}) {
  const page = await browser.newPage();
  page.setDefaultTimeout(240000); // a busy machine is slow
  const problems = [];
  page.on('console', (message) => { if (message.type() === 'error') problems.push(message.text()); });
  page.on('pageerror', (error) => problems.push(String(error.stack ?? error)));
  page.on('request', (request) => { if (/^(https?|wss?):/.test(request.url())) problems.push(`request of ${request.url()}`); });
  await page.setOfflineMode(true);
  await page.setViewport({ width, height });
  await page.emulateMediaFeatures([{ name: 'prefers-color-scheme', value: scheme }]);
  await page.goto(pathToFileURL(file).href + hash);
  await page.waitForFunction(() => document.querySelector('[data-kbvh-lab-page]')?.lab?.state.at);
  return {
    page, problems,
    /** Runs a function in the page with the lab and arguments. */
    lab: (body, ...args) => page.evaluate(`(${body})(document.querySelector('[data-kbvh-lab-page]').lab, ...${JSON.stringify(args)})`),
    /** Waits until the engine has answered everything that was asked, and the views have been drawn. */
    settle: () => page.evaluate(async () => {
      const { lab } = document.querySelector('[data-kbvh-lab-page]');
      for (let chain = null; chain !== lab.chain;) { chain = lab.chain; await chain; await new Promise((resolve) => setTimeout(resolve, 20)); }
      await new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve)));
    }),
    /** Shows another scene in this tab, in a window and a scheme of its own: a lab that is kept costs less than one that is loaded. */
    async show({ hash = '', width = 1440, height = 900, scheme = 'light' }) {
      problems.length = 0;
      await page.bringToFront();
      await page.setViewport({ width, height });
      await page.emulateMediaFeatures([{ name: 'prefers-color-scheme', value: scheme }]);
      await this.lab(async (lab, sceneId) => {
        document.activeElement?.blur();
        lab.view({ theme: 'auto' });
        lab.store.set({ error: '', choice: null, notice: '', speed: 1 });
        await lab.comparison.set(null);
        await lab.setState({ format: 'kbvh-lab', version: 1, sceneId });
        scrollTo(0, 0);
      }, /^#scene=([\w-]+)$/.exec(hash)?.[1] ?? 'overtake-8');
      await this.settle();
    },
  };
}
