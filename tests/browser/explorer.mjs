// Looks at the pages that explorer.py made, in a headless Chromium: explorer.mjs EXPECTED.json
import { finish } from "./support/explorer.mjs";

for (const part of ["numbers", "questions", "points", "widths"]) await import(`./explorer/${part}.mjs`);
process.exit((await finish()) ? 1 : 0);
