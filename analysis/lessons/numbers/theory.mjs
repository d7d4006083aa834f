// Numbers of `kbvh theory` on small clips (seconds), and of the reference run in analysis/reference.
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const reference = join(dirname(dirname(dirname(fileURLToPath(import.meta.url)))), "reference");

/// Returns the text of a file that is packed by xz, which Node cannot read.
function unpacked(file) {
  const script = "import lzma, sys; sys.stdout.buffer.write(lzma.open(sys.argv[1]).read())";
  return execFileSync("python3", ["-c", script, file], { encoding: "utf8", maxBuffer: 2 ** 30 });
}

/// Runs the checks of the theory and returns its theory.json.
function run(kbvh) {
  const folder = mkdtempSync(join(tmpdir(), "kbvh-lessons-"));
  try {
    execFileSync(kbvh, ["theory", "--scenes", "waving_sheet", "random_soups", "--sizes", "50,100,200,400,800,1600", "--keyframes", "8",
      "--exact-limit", "100", "--instants", "20", "--no-figures", "--out", folder], { stdio: ["ignore", "ignore", "pipe"] });
    return JSON.parse(readFileSync(join(folder, "theory.json"), "utf8"));
  } finally {
    rmSync(folder, { recursive: true });
  }
}

/// The parts of theory.json that the lessons use.
function extract(theory, prefix, source, put) {
  const claims = Object.fromEntries(theory.claims.map((claim) => [claim.id, claim]));
  for (const { id, verdict, measured, why, condition } of theory.claims)
    for (const [key, value] of Object.entries({ verdict, measured, why, condition })) put(`${prefix}.${id}.${key}`, value, source);
  const sum = (list, of) => list.reduce((total, one) => total + of(one), 0);
  const most = (list, of) => Math.max(...list.map(of));
  const { counts, exact } = claims.T6.data;
  put(prefix + ".clips", counts.length, source);
  put(prefix + ".exact_clips", exact.length, source);
  put(prefix + ".changes", sum(exact, (run) => run.logged), source);
  put(prefix + ".exact_bounds", sum(exact, (run) => run.bounds), source);
  put(prefix + ".exact_events", sum(exact, (run) => run.events), source);
  put(prefix + ".envelopes", sum(exact, (run) => run.pieces), source);
  put(prefix + ".most_breakpoints", most(exact, (run) => run.most_breakpoints), source);
  put(prefix + ".fullest", most(exact, (run) => run.fullest), source);
  put(prefix + ".over_lambda", sum(exact, (run) => run.over_lambda), source);
  put(prefix + ".net", sum(exact, (run) => run.net), source);
  put(prefix + ".breakpoints", sum(exact, (run) => run.envelope), source);
  put(prefix + ".tie_changes", sum(exact, (run) => run.logged - run.net), source);
  put(prefix + ".bound_share", most(counts, (run) => run.values / run.breakpoint_bound), source);
  put(prefix + ".events", sum(counts, (run) => run.events), source);
  put(prefix + ".silent", sum(counts, (run) => run.silent_events), source);
  put(prefix + ".most_of_node", most(counts, (run) => run.most_of_node), source);
  put(prefix + ".alive_per_node", most(counts, (run) => run.queue_peak / run.nodes), source);
  for (const fit of claims.T6.data.fits) {
    put(`${prefix}.${fit.scene}.exponent`, fit.exponent, source);
    put(`${prefix}.${fit.scene}.low`, fit.low, source);
    put(`${prefix}.${fit.scene}.high`, fit.high, source);
  }
  for (const [name, key] of [["one axis", "one"], ["root x, else y", "adversarial"], ["mixed", "mixed"]]) {
    const search = claims.T12.data.searches.filter((run) => run.tree === name).at(-1);
    put(`${prefix}.search.${key}.most`, search.most_searched, source);
    put(`${prefix}.search.${key}.mean`, search.searched / search.searches, source);
    put(`${prefix}.search.${key}.root`, search.searched_by_root / search.events_of_root, source);
    put(`${prefix}.search.leaves`, search.leaves, source);
    put(`${prefix}.search.nodes`, 2 * search.leaves - 1, source);
  }
  const far = claims.T10.data.find((run) => !run.exact);
  put(prefix + ".translated_far", far.events, source);
  put(prefix + ".translated_ties", far.separated_ties, source);
  put(prefix + ".translated_vertices", far.vertices, source);
  const plans = claims.T15.data;
  put(prefix + ".plan_updates_at_keyframes", sum(plans, (run) => run.updates_at_keyframes), source);
  put(prefix + ".plan_updates_between", sum(plans, (run) => run.updates - run.updates_at_keyframes), source);
  put(prefix + ".plan_moved_at_keyframes", sum(plans, (run) => run.moved_at_keyframes), source);
  put(prefix + ".plan_moved_between", sum(plans, (run) => run.moved_between), source);
  const loose = claims.T16.data;
  put(prefix + ".linear_values", sum(loose, (run) => run.linear_values), source);
  put(prefix + ".linear_updates", sum(loose, (run) => run.linear_updates), source);
  put(prefix + ".linear_looseness", most(loose, (run) => run.linear_looseness), source);
  put(prefix + ".swept_values", sum(loose, (run) => run.swept_values), source);
  put(prefix + ".swept_looseness_most", most(loose, (run) => run.swept_looseness), source);
  put(prefix + ".loose_kinetic_values", sum(loose, (run) => run.kinetic_values), source);
  put(prefix + ".loose_bottom_up_values", sum(loose, (run) => run.bottom_up_values), source);
  const lists = claims.T13.data;
  const events = (kind) => sum(lists, (run) => run[kind].events);
  const pairs = (kind) => sum(lists, (run) => run[kind].pairs);
  put(prefix + ".list.entries", sum(lists, (run) => run.entries), source);
  put(prefix + ".list.audits", sum(lists, (run) => run.audits), source);
  put(prefix + ".list.differences", sum(lists, (run) => run.differences), source);
  put(prefix + ".list.most_of_box", most(lists, (run) => run.most_of_box), source);
  for (const kind of ["overlap", "parents", "leaves", "changes"]) {
    put(`${prefix}.list.${kind}_events`, events(kind), source);
    put(`${prefix}.list.${kind}_pairs`, pairs(kind) / Math.max(1, events(kind)), source);
    put(`${prefix}.list.${kind}_most`, most(lists, (run) => run[kind].most_pairs), source);
  }
  const boxtrees = claims.T11.data.filter((run) => run.aabb_events > 0);
  put(prefix + ".boxtree_events_share", most(boxtrees, (run) => run.events / run.aabb_events), source);
  put(prefix + ".boxtree_bytes_share", most(claims.T11.data, (run) => run.bytes / run.aabb_bytes), source);
  put(prefix + ".boxtree_clips", boxtrees.length, source);
}

const median = (values) => {
  const sorted = [...values].sort((a, b) => a - b), middle = sorted.length >> 1;
  return sorted.length % 2 ? sorted[middle] : (sorted[middle - 1] + sorted[middle]) / 2;
};

/// Counts and times of the reference run: the tablecloth of 16k triangles at l = 10.
function tablecloth(put) {
  const source = "analysis/reference/results.jsonl.xz";
  const lines = unpacked(join(reference, "results.jsonl.xz")).trim().split("\n").filter((line) => line.includes("tablecloth-16"));
  const records = lines.map((line) => JSON.parse(line))
    .filter((record) => record.kind === "run" && record.study === "tablecloth" && record.scene.name.startsWith("tablecloth-16")
      && record.scene.per_keyframe === 10 && record.times?.repetitions);
  const labels = { refit: "bottom_up", period: "bottom_up_period", kinetic2006: "kinetic_aabb [queue=avl query=nodes width=2 leaf=1]",
    kinetic: "kinetic_aabb", boxtree2006: "kinetic_boxtree [queue=avl planes=start candidates=searched leaf_boxes=inherited leaf=1]",
    list2006: "kinetic_separation_list [queue=avl leaf=1]", join: "interval_join", envelope: "kinetic_envelope", rebuild: "rebuild" };
  for (const [key, label] of Object.entries(labels)) {
    const record = records.find((one) => one.strategy.label === label);
    if (!record) throw new Error(`reference: no record of '${label}' on the tablecloth`);
    const { frames } = record.scene, update = median(record.times.repetitions.map((times) => times.update));
    const query = median(record.times.repetitions.map((times) => times.traversal + times.triangle_tests));
    put(`cloth.${key}.values`, record.counters.values_written / frames, source);
    put(`cloth.${key}.events`, record.counters.certificates_failed / frames, source);
    put(`cloth.${key}.update`, update, source);
    put(`cloth.${key}.query`, query, source);
    put(`cloth.${key}.total`, update + query, source);
    put(`cloth.${key}.bytes_each`, record.bytes / 18248, source);
    if (record.counters.certificates_failed > 0) put(`cloth.${key}.event_us`, (1000 * update * (frames - 1)) / record.counters.certificates_failed, source);
  }
  put("cloth.triangles", records[0].scene.bodies[0].primitives, source);
  put("cloth.table", records[0].scene.bodies[1].primitives, source);
  const at = (key) => records.find((one) => one.strategy.label === labels[key]);
  const update = (key) => median(at(key).times.repetitions.map((times) => times.update));
  const events = at("kinetic2006").counters.certificates_failed / at("kinetic2006").scene.frames;
  put("cloth.break_even_ns", (1e6 * update("refit")) / events, source);
  put("cloth.break_even_period_ns", (1e6 * update("period")) / events, source);
  put("cloth.values_ratio", at("period").counters.values_written / at("kinetic2006").counters.values_written, source);
  put("cloth.time_ratio_2006", update("period") / update("kinetic2006"), source);
  put("cloth.time_ratio_best", update("period") / update("kinetic"), source);
  put("cloth.time_ratio_today", update("refit") / update("kinetic"), source);
  put("cloth.period_over_refit", update("period") / update("refit"), source);
  put("cloth.refit_ns_per_triangle", (1e6 * update("refit")) / at("refit").scene.bodies[0].primitives, source);
  put("cloth.period_ns_per_triangle", (1e6 * update("period")) / at("refit").scene.bodies[0].primitives, source);
  put("cloth.join_total_ratio", (update("refit") + query(at("refit"))) / (update("join") + query(at("join"))), source);
  const commit = records[0].commit.slice(0, 12);
  put("reference.commit", commit, source);
  put("reference.cpu", records[0].machine.cpu, source);
}
const query = (record) => median(record.times.repetitions.map((times) => times.traversal + times.triangle_tests));

export function theoryNumbers(kbvh) {
  const numbers = {};
  const put = (key, value, source) => {
    if (value === undefined || Number.isNaN(value)) throw new Error(`number '${key}' has no value`);
    numbers[key] = { value, source };
  };
  const here = run(kbvh);
  extract(here, "theory", "kbvh theory", put);
  extract(JSON.parse(readFileSync(join(reference, "theory.json"), "utf8")), "reference", "analysis/reference/theory.json", put);
  const claims = JSON.parse(readFileSync(join(reference, "claims.json"), "utf8")).claims;
  for (const { id, verdict } of claims) put(`claim.${id}`, verdict, "analysis/reference/claims.json");
  tablecloth(put);
  return { numbers, data: { theory: { counts: here.counts, fits: here.fits } } };
}
