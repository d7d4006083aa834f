// Takes pictures of every page: node tests/lessons/screenshots.mjs PAGES OUT [name part]
import { mkdirSync, readdirSync } from "node:fs";
import { join, resolve } from "node:path";
import { launch } from "./browser.mjs";

const [pages, out, part = ""] = process.argv.slice(2);
mkdirSync(out, { recursive: true });
const browser = await launch();
for (const name of readdirSync(pages).filter((file) => file.endsWith(".html") && file.includes(part)))
  for (const scheme of ["light", "dark"])
    for (const width of [390, 820, 1440]) {
      if (process.env.ONLY && process.env.ONLY !== `${scheme}-${width}`) continue;
      const page = await browser.newPage();
      await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
      await page.setViewport({ width, height: 900 });
      await page.goto("file://" + join(resolve(pages), name));
      if (process.env.ANSWERED) await page.evaluate(() => {
        for (const form of document.querySelectorAll(".predict")) form.querySelectorAll("input")[globalThis.kbvhLessons.unseal(form.dataset.sealed, form.dataset.predict)].click(), form.querySelector("button").click();
      });
      await page.screenshot({ path: join(out, `${name.replace(".html", "")}-${scheme}-${width}.png`), fullPage: true });
      await page.close();
    }
await browser.close();
