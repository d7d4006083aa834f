// Headless Chromium for the tests and for screenshots, through the packages of the lessons.
import { createRequire } from "node:module";

const puppeteer = createRequire(new URL("../../analysis/lessons/package.json", import.meta.url))("puppeteer-core");

export const launch = () => puppeteer.launch({ executablePath: process.env.KBVH_CHROMIUM ?? "/usr/bin/chromium", headless: true,
  timeout: 300000, protocolTimeout: 300000, // a busy machine takes minutes to start it
  args: ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--no-first-run"] });
