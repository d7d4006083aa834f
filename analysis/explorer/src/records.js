// Reads results.jsonl in the page: what load.py and explorer_data.py make of it, without claims. A test compares both.
import { looks } from "./looks.js";
import { lazyDraws, middles } from "./clips.js";
import { doubts } from "./statistics.js";

const PHASES = ["motion", "update", "traversal", "triangle_tests", "plan_changes"];
const MACHINE = ["cpu", "kernels", "simd", "compiler", "flags", "build_type", "os", "cores", "memory_gb"];
const OF_GROUP = ["cpu", "os", "compiler", "flags", "build_type", "simd", "kernels"];
const COUNTERS = ["certificates_failed", "values_written", "nodes_visited", "box_tests", "triangle_tests"];
const VERIFIED = ["pairs", "candidates", "missed_candidates", "missed", "extra"];
/** The ending of a scene's name that says that something other than pairs at frames was asked: ANSWER of scene_names.py. */
const ANSWER = /( \((contacts|changes of (candidates|pairs)|(in)?coherent rays(, any)?|within [\d.e-]+|\w+ kernels)\))*$/;

const number = (value, digits) => {
  if (typeof value !== "number" || !Number.isFinite(value)) return null;
  return digits ? Number(value.toPrecision(digits)) : value;
};

/** Numbers values in the order of their first appearance. */
function indexer() {
  const known = new Map();
  const index = (key, value = key) => {
    if (!known.has(key)) known.set(key, [known.size, value]);
    return known.get(key)[0];
  };
  index.values = () => [...known.values()].map(([, value]) => value);
  return index;
}

/** Writes a value as Python's json.dumps(value, sort_keys=True): the order of looks depends on it. */
function dumps(value) {
  if (Array.isArray(value)) return `[${value.map(dumps).join(", ")}]`;
  if (value === null || typeof value !== "object") return JSON.stringify(value);
  return `{${Object.keys(value)
    .sort()
    .map((key) => `${JSON.stringify(key)}: ${dumps(value[key])}`)
    .join(", ")}}`;
}

/** Reads lines; returns records and sentences on the lines that were skipped. */
function parse(text) {
  const records = [];
  const notes = [];
  text.split("\n").forEach((line, at) => {
    if (!line.trim()) return;
    try {
      records.push(rowOf(JSON.parse(line), records.length));
    } catch (problem) {
      notes.push(`Line ${at + 1} was skipped: ${problem instanceof SyntaxError ? "it is not JSON" : problem.message}.`);
    }
  });
  return { records, notes };
}

function need(record, path) {
  const found = path.split(".").reduce((value, step) => value?.[step], record);
  if (found === undefined || found === null) throw new Error(`the field ${path} is missing`);
  return found;
}

/** Flattens one record, as _row of load.py. */
function rowOf(record, index) {
  if (record === null || typeof record !== "object" || !("schema" in record)) throw new Error("it is no result");
  if (record.schema !== 1 && record.schema !== 2) throw new Error(`schema ${record.schema} is not known`);
  const scene = need(record, "scene");
  const strategy = need(record, "strategy");
  const verified = need(record, "verified");
  for (const path of ["scene.name", "scene.scalar", "scene.per_keyframe", "scene.primitives", "strategy.id", "strategy.guarantee", "verified.holds"])
    need(record, path);
  const machine = Object.fromEntries(MACHINE.map((name) => [name, String(record.machine?.[name] ?? "")]));
  if (Array.isArray(record.machine?.simd)) machine.simd = record.machine.simd.join(", ");
  const params = strategy.params ?? {};
  const builder = strategy.builder ?? null;
  let refused = "";
  if (!verified.holds) refused = `its declared guarantee or tightness is broken: ${verified.first_violation || "no detail was recorded"}`;
  else if (!record.times) refused = record.refused || "no time was taken";
  const repetitions = refused ? [] : timesOf(record);
  const row = {
    ...{ index, record, scene, strategy, verified, params, builder, refused, repetitions },
    machineParts: machine,
    machine: OF_GROUP.map((name) => machine[name]).filter(Boolean).join(" · "),
    commit: record.commit ?? "",
    dirty: record.dirty ?? false,
    when: timeOf(record.when ?? ""),
    bodies: Array.isArray(scene.bodies) ? scene.bodies : [],
    contestant: strategy.id + dumps([params, builder]),
    title: strategy.title ?? strategy.id,
    family: strategy.family ?? "unknown",
    session: String(record.run ?? ""),
  };
  row.family_of_scene = familyOf(scene.name, row.bodies);
  row.group = JSON.stringify([scene.name, scene.hash ?? "", scene.primitives, scene.scalar, scene.per_keyframe, scene.frames ?? null, row.machine, record.schema]);
  return row;
}

function timeOf(text) {
  const known = new Date(text);
  return /^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ$/.test(text) && known.toJSON()?.startsWith(text.slice(0, 19)) ? text : "";
}

function timesOf(record) {
  const listed = need(record, "times.repetitions");
  return listed.map((one) => {
    const times = PHASES.map((phase) => one[phase] ?? (phase === "plan_changes" ? 0 : NaN));
    times[4] += one.geometry_changes ?? 0;
    if (!times.every((time) => time >= 0)) throw new Error("a repetition lacks a time");
    if (record.schema === 2 && !(Array.isArray(one.totals) && one.totals.length === one.motions?.length)) throw new Error("totals are missing");
    return times;
  });
}

function familyOf(name, bodies) {
  const answer = ANSWER.exec(name)[0];
  const counts = new Set(bodies.map((body) => String(body?.primitives)));
  const [head, ...rest] = name.slice(0, name.length - answer.length).split("-");
  return [head, ...rest.filter((part) => !counts.has(part))].join("-") + answer;
}

/** Groups rows by a key, in the order of first appearance. */
const grouped = (rows, key) => [...Map.groupBy(rows, key).values()];

/** Tells scenes of one name apart by their hashes, as scene_names.told_apart: the one measured last keeps the name. */
function tellApart(rows) {
  const cards = new Map(rows.filter(({ scene }) => scene.hash && scene.card).map(({ scene }) => [scene.hash, scene.card]));
  for (const row of rows) {
    const { scene } = row;
    const card = scene.card || cards.get(scene.hash) || "";
    row.identity = card || scene.hash || "";
    const oneSize = ["files", "shapes"].includes(scene.origin) && row.family_of_scene === scene.name;
    row.place = JSON.stringify([row.family_of_scene, oneSize ? 0 : scene.primitives, card ? "" : scene.scalar]);
    row.sceneName = row.family_of_scene;
  }
  for (const same of grouped(rows.filter((row) => row.identity), (row) => row.place)) {
    const newest = same.at(-1).identity;
    for (const older of grouped(same.filter((row) => row.identity !== newest), (row) => row.identity))
      for (const row of older) row.sceneName = `${row.family_of_scene} (hash ${older[0].scene.hash.slice(0, 8)})`;
  }
}

/** Names contestants by title and the settings that distinguish those of one strategy, as _labels of load.py. */
function label(rows) {
  const labels = new Map();
  const once = (list) => [...new Map(list.toReversed().map((row) => [row.contestant, row])).values()].reverse();
  for (const same of grouped(rows, (row) => row.strategy.id)) {
    const unique = once(same);
    const facts = unique.map(({ params, builder }) => ({
      ...params,
      ...Object.fromEntries(Object.entries(builder ?? {}).map(([name, value]) => [{ leaf_size: "leaf", method: "" }[name] ?? name, value])),
    }));
    const names = [...new Set(facts.flatMap(Object.keys))].sort();
    const varying = names.filter((name) => new Set(facts.map((fact) => String(fact[name] ?? ""))).size > 1);
    unique.forEach((row, i) => {
      const told = varying
        .filter((name) => String(facts[i][name] ?? "") !== "")
        .map((name) => `${name} ${facts[i][name]}`.replaceAll("_", " ").trim());
      labels.set(row.contestant, told.length ? `${row.title} (${told.join(", ")})` : row.title);
    });
  }
  const unique = once(rows);
  for (const same of grouped(unique, (row) => labels.get(row.contestant)))
    if (new Set(same.map((row) => row.strategy.id)).size > 1)
      for (const row of same) labels.set(row.contestant, `${row.title} [${row.strategy.id}]`);
  for (const row of rows) row.label = labels.get(row.contestant);
}

/** Keeps one row per configuration, commit and state of the tree: the newest. */
function newest(rows) {
  const last = new Map(rows.map((row) => [JSON.stringify([row.group, row.contestant, row.commit, row.dirty]), row]));
  const kept = new Set(last.values());
  return rows.filter((row) => kept.has(row));
}

function asks({ scene, bodies }) {
  if (scene.rays) return "rays";
  if (scene.within) return "primitives near points";
  if (scene.continuous) return "contacts between keyframes";
  if (scene.changes) return `changes of ${scene.changes}`;
  if (scene.script?.changes) return "pairs while plans change";
  return bodies.some((body) => body?.self === true) ? "pairs within a body, too" : "pairs of two bodies";
}

function again({ record, scene, sceneName, bodies }) {
  const scenes = record.again?.scenes ?? [];
  const options = [["builtin", "--scene"], ["triangles", "--triangles"], ["obstacle", "--obstacle"], ["keyframes", "--keyframes"], ["radius", "--radius"], ["seed", ""], ["order", "--order"]];
  if (scenes.length === 1 && scenes[0] && typeof scenes[0] === "object" && !Array.isArray(scenes[0])) {
    const [one] = scenes;
    const known = new Set([...options.map(([key]) => key), "optional"]);
    if (typeof one.builtin !== "string" || !Object.keys(one).every((key) => known.has(key))) return { scene: one };
    const words = options.filter(([key, option]) => option && key in one && one[key] !== "given").map(([key, option]) => `${option} ${one[key]}`);
    if ((one.seed ?? 1) !== 1) words.push(`--seed ${one.seed}`);
    return { options: words.join(" ") };
  }
  const name = sceneName.split(" (", 1)[0].replace(/-shuffled$/, "").replace(/-renumbered$/, "");
  if (scene.origin !== "built_in" || !bodies.length || !/^\w+$/.test(name))
    return { why: "The record is older than the field that names the files or shapes of a scene: its plan has them." };
  const words = [`--scene ${name}`, `--triangles ${bodies[0].primitives}`];
  if (bodies.length === 2 && bodies[1].moving === false) words.push(`--obstacle ${bodies[1].primitives}`);
  const seed = String(record.seed ?? "");
  if (seed && seed !== "1") words.push(`--seed ${seed}`);
  if (scene.order && scene.order !== "given") words.push(`--order ${scene.order}`);
  return { options: words.join(" ") };
}

/** Formats a number of primitives as 16k or 1.2M, as text.size. */
function size(value) {
  const short = (v, digits) => String(Number(v.toPrecision(digits)));
  if (value >= 999_500) return `${short(value / 1e6, value >= 1e8 ? 3 : 2)}M`;
  if (value >= 9_950) return `${Math.round(value / 1e3)}k`;
  return value >= 1_000 ? `${Number((value / 1e3).toFixed(1))}k` : String(value);
}

function machines(rows) {
  const unique = [...new Map(rows.toReversed().map((row) => [row.machine, row.machineParts])).entries()].reverse();
  const order = grouped(rows, (row) => row.machine).map((same) => same[0].machine);
  const parts = new Map(unique);
  const differing = MACHINE.filter((part) => new Set(order.map((key) => parts.get(key)[part])).size > 1);
  const found = order.map((key) => {
    const own = parts.get(key);
    const facts = Object.fromEntries(MACHINE.filter((part) => own[part]).map((part) => [part.replace("_gb", " (GB)").replaceAll("_", " "), own[part]]));
    const told = differing.filter((part) => part !== "cpu" && own[part]).map((part) => own[part]);
    return { key, label: [own.cpu || "unknown machine", ...told.slice(0, 2)].join(" · "), facts };
  });
  const labels = found.map((one) => one.label);
  found.forEach((one, i) => {
    if (labels.filter((other) => other === labels[i]).length > 1) one.label += ` (machine ${i + 1})`;
  });
  return found;
}

function commits(rows) {
  return grouped(rows, (row) => `${row.commit}~${row.dirty}`)
    .map((same) => ({ commit: same[0].commit, dirty: same[0].dirty, when: same.map((row) => row.when).filter(Boolean).sort()[0] ?? "" }))
    .sort((a, b) => (a.when < b.when ? -1 : a.when > b.when ? 1 : 0));
}

function contestantOf(row, look) {
  const { strategy, params, builder } = row;
  const single = String(params.threads ?? "1") === "1";
  const settings = Object.entries(params).sort(([a], [b]) => (a < b ? -1 : 1));
  return {
    id: strategy.id,
    title: row.title,
    label: row.label,
    tag: strategy.label || [strategy.id, ...settings.map(([name, value]) => `${name}=${value}`)].join(" "),
    family: row.family,
    guarantee: strategy.guarantee,
    baseline: strategy.baseline ?? row.family === "refit",
    foresight: (strategy.foresight ?? "").replaceAll("_", " "),
    citation: strategy.citation ?? "",
    params,
    builder,
    usual: single && strategy.guarantee !== "approximate" && !["oracle", "limit"].includes(row.family),
    look,
  };
}

function cellOf(row, machinesOf, commitsOf) {
  const { scene } = row;
  const asked = { continuous: scene.continuous ?? false, changes: scene.changes ?? "", rays: scene.rays ?? "", within: scene.within ?? "", kernels: scene.kernels ?? "" };
  return {
    scene: row.sceneName,
    name: scene.name,
    hash: String(scene.hash ?? ""),
    primitives: scene.primitives,
    size: size(scene.primitives),
    scalar: scene.scalar,
    l: scene.per_keyframe,
    frames: number(scene.frames),
    keyframes: number(scene.keyframes),
    continuous: scene.continuous ?? false,
    asks: asks(row),
    asked: Object.fromEntries(Object.entries(asked).filter(([, value]) => value)),
    machine: machinesOf.findIndex((one) => one.key === row.machine),
    commit: commitsOf.findIndex((one) => one.commit === row.commit && one.dirty === row.dirty),
    again: again(row),
  };
}

function runOf(row) {
  const { record, scene, verified, repetitions } = row;
  const times = row.refused ? {} : record.times;
  const frames = number(scene.frames);
  const counters = record.counters ?? {};
  const asked = record.again ?? {};
  const whole = frames === null ? NaN : (scene.keyframes - 1) * scene.per_keyframe + 1;
  const clips = !repetitions.length || record.schema === 1 || (times.by ?? "frames") !== "frames";
  const raw = { schema: record.schema, repetitions, listed: times.repetitions ?? [], clips };
  return {
    when: row.when,
    kind: record.kind ?? "",
    repetitions: repetitions.length,
    limit: asked.frames_limit ?? (frames < whole ? frames : 0),
    every: asked.oracle_every ?? verified.sampled_every ?? 1,
    rounds: Object.fromEntries(["repetitions", "interval_width", "seconds"].filter((key) => key in asked).map((key) => [key, asked[key]])),
    p50: number(record.times?.total_p50),
    p99: number(record.times?.total_p99),
    worst: number(record.times?.total_worst),
    bytes: number(record.bytes),
    build_ms: number(record.times?.build_ms),
    ...Object.fromEntries(VERIFIED.map((name) => [name, number(verified[name])])),
    protrusion: verified.audited ? number(verified.protrusion) : null,
    looseness: verified.audited ? number(verified.looseness) : null,
    verified_frames: number(verified.frames),
    ...Object.fromEntries(COUNTERS.map((name) => [name, number(frames > 0 ? counters[name] / frames : counters[name], 5)])),
    refused: row.refused,
    disturbed: doubts(times?.repetitions ?? [], times?.disturbed ?? ""),
    clips,
    times: repetitions,
    middle: repetitions.length ? middles(raw) : [],
    draws: clips ? [] : lazyDraws(raw),
    pace: (record.times?.over_time ?? []).map((one) => [number(one.begin, 4), number(one.update, 4), number(one.query, 4)]),
    quality: (verified.over_time ?? [])
      .filter((one) => one.sah > 0 && one.sah_rebuilt > 0)
      .map((one) => [number(one.t, 5), number(one.sah / one.sah_rebuilt, 4), number(one.looseness, 4)]),
  };
}

/** Returns the data of a page of results; `palette` is that of the page. Throws an Error with a sentence if there are none. */
export function dataOf(text, source, palette) {
  const { records, notes } = parse(text);
  if (!records.length) throw new Error(`${source} has no result that can be used. ${notes[0] ?? ""}`.trim());
  tellApart(records);
  label(records);
  const rows = newest(records);
  if (rows.length < records.length) notes.push(`${records.length - rows.length} older measurements of the same configuration are not shown: the newest counts.`);
  const look = looks(rows, palette);
  const [cells, contestants, plans, sessions] = [indexer(), indexer(), indexer(), indexer()];
  const columns = {};
  for (const row of rows) {
    const plan = row.record.plan ?? {};
    const one = {
      cell: cells(JSON.stringify([row.group, row.commit, row.dirty]), row),
      contestant: contestants(row.contestant, row),
      session: sessions(row.session),
      plan: plans(JSON.stringify([plan.name ?? "", plan.description ?? ""]), { name: plan.name ?? "", description: plan.description ?? "" }),
      ...runOf(row),
    };
    for (const [name, value] of Object.entries(one)) (columns[name] ??= []).push(value);
  }
  const [machinesOf, commitsOf] = [machines(cells.values()), commits(rows)];
  return {
    title: "",
    source,
    plans: plans.values(),
    notes,
    phases: PHASES,
    machines: machinesOf.map(({ label, facts }) => ({ label, facts })),
    commits: commitsOf,
    contestants: contestants.values().map((row) => contestantOf(row, look.get(row.contestant))),
    cells: cells.values().map((row) => cellOf(row, machinesOf, commitsOf)),
    runs: columns,
    claims: [],
    reference: "",
    report: "",
    palette,
  };
}
