// All numbers of the course, each with its source. They are made again when a program or a scene has changed.
import { createHash } from "node:crypto";
import { existsSync, readdirSync, readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { smallNumbers } from "./small.mjs";
import { theoryNumbers } from "./theory.mjs";

const root = dirname(dirname(fileURLToPath(import.meta.url)));

/// A hash of everything that decides the numbers.
function origin(files) {
  const hash = createHash("sha256");
  for (const folder of ["scenes", "numbers", "checkers"])
    for (const name of readdirSync(join(root, folder)).sort()) hash.update(readFileSync(join(root, folder, name)));
  for (const file of files) hash.update(readFileSync(file));
  return hash.digest("hex");
}

/// Returns {numbers: key => {value, source}, data: traces for pictures}. `cache` is a file for the results.
export function makeNumbers({ walker, kbvh, cache }) {
  const made_by = origin([walker, kbvh, ...["theory.json", "results.jsonl.xz", "claims.json"].map((name) => join(dirname(root), "reference", name))]);
  if (cache && existsSync(cache)) {
    const kept = JSON.parse(readFileSync(cache, "utf8"));
    if (kept.made_by === made_by) return kept;
  }
  const small = smallNumbers(walker), theory = theoryNumbers(kbvh);
  const made = { made_by, numbers: { ...small.numbers, ...theory.numbers }, data: { ...small.data, ...theory.data } };
  if (cache) writeFileSync(cache, JSON.stringify(made));
  return made;
}
