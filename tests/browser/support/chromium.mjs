// Headless Chromium without a network, and pages that note what goes wrong in them.

import { existsSync, mkdtempSync, rmSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { join } from 'node:path';

const require = createRequire(new URL('../../../analysis/lab/package.json', import.meta.url));
const puppeteer = require('puppeteer-core');

/** Starts a browser with an empty profile and perhaps more flags; `close` ends it and removes the profile. */
export async function startBrowser(flags = ['--disable-gpu']) {
  const profile = mkdtempSync(join(tmpdir(), 'kbvh-chromium-'));
  const browser = await puppeteer.launch({
    executablePath: process.env.KBVH_CHROMIUM ?? '/usr/bin/chromium',
    headless: true,
    userDataDir: profile,
    args: ['--no-sandbox', ...flags, '--disable-quic', '--no-first-run', '--disable-background-networking',
      '--disable-component-update', '--disable-sync', '--allow-file-access-from-files=false'],
    timeout: 300000,  // a busy machine takes minutes to start it
    protocolTimeout: 300000,
  });
  return {
    browser,
    async close() {
      await browser.close();
      if (existsSync(profile)) rmSync(profile, { recursive: true, force: true, maxRetries: 5 });
    },
  };
}

/** Opens a page from a file with the network off. `page.wrong` lists errors and requests that leave the page. */
export async function openFile(browser, file) {
  const page = await browser.newPage();
  page.setDefaultTimeout(240000);
  page.wrong = [];
  page.on('console', (message) => {
    if (['error', 'warn'].includes(message.type())) page.wrong.push(`console: ${message.text()}`);
  });
  page.on('pageerror', (error) => page.wrong.push(`error: ${error.message}`));
  page.on('request', (request) => {
    if (!/^(file|blob|data):/.test(request.url())) page.wrong.push(`request: ${request.url()}`);
  });
  await page.setOfflineMode(true);
  await page.goto(`file://${file}`);
  return page;
}
