// Numbers of the small scenes: counted by the strategies themselves, through the façade.
import { scenes } from "../scenes/scenes.mjs";
import { last, perFrame, play } from "../checkers/parts.mjs";
import { walk } from "../trace.mjs";

const changesOf = (trace, node, side) => trace.steps.flatMap((step) => step.touched)
  .filter((change) => change.body === 0 && change.node === node && change.side === side).length;
const eventsOf = (trace, side) => trace.steps.filter((step) => step.event.side === side).length;
/// Pairs of vertices that swap their order on x between the two keyframes of a body: the events of a sorted list.
const swaps = ({ vertices, positions: [from, to] }) => {
  let count = 0;
  for (let i = 0; i < vertices; ++i)
    for (let j = 0; j < i; ++j) count += (from[3 * i] - from[3 * j]) * (to[3 * i] - to[3 * j]) < 0;
  return count;
};
/// The most changes of all bounds in one segment: one less than the vertices below, for every node and side in the plane.
const forcedMost = (hierarchy, sides) => {
  const below = hierarchy.nodes.map((node) => (node.leaf ? node.count : 0));
  for (let n = hierarchy.nodes.length - 1; n > 0; --n) below[hierarchy.nodes[n].parent] += below[n];
  return below.reduce((sum, count) => sum + sides * (count - 1), 0);
};
const surfaces = (trace) => trace.frames.map((frame) => frame.hierarchies.reduce((sum, { nodes }) => sum
  + nodes.reduce((part, { lower, upper }) => part + (upper[0] - lower[0]) + (upper[1] - lower[1]), 0), 0));

export function smallNumbers(walker) {
  const requests = [], asked = new Map();
  const ask = (name, scene, strategy, more = {}) => {
    asked.set(name, requests.length);
    requests.push(play({ scene }, strategy, more));
  };
  ask("ribbon.refit", scenes.ribbon(), "bottom_up", { nodes: true });
  ask("ribbon.brute", scenes.ribbon(), "brute_force");
  ask("ribbon.kinetic", scenes.ribbon());
  for (const strategy of ["bottom_up", "rebuild"]) ask("ageing." + strategy, scenes.ageing(), strategy, { nodes: true });
  ask("dart", scenes.dart(), "bottom_up", { nodes: true });
  ask("dart.keyframes", scenes.dart(), "bottom_up", { l: 1 });
  ask("race4", scenes.race4(), "kinetic_aabb", { nodes: true });
  ask("race4.list", scenes.race4(), "bottom_up");
  ask("race", scenes.race());
  ask("flag", scenes.flag(), "kinetic_aabb", { nodes: true });
  for (const strategy of ["kinetic_aabb", "bottom_up"]) {
    ask("shoal." + strategy, scenes.shoal(), strategy);
    ask("tangents." + strategy, scenes.tangents(), strategy);
    ask("tangents10." + strategy, scenes.tangents(), strategy, { l: 10 });
  }
  for (const n of [4, 8, 16, 32, 64]) for (const order of ["sorted", "mixed"]) ask(`relay${n}.${order}`, scenes.relay(n, order));
  for (const n of [8, 16, 32, 64, 128, 256]) ask("wander" + n, scenes.wander(n));
  for (const strategy of ["kinetic_aabb", "kinetic_boxtree"]) ask("drape." + strategy, scenes.drape(), strategy, { nodes: true });
  ask("combs", scenes.combs(), "kinetic_separation_list", { nodes: true });
  ask("combs.refit", scenes.combs(), "bottom_up", { l: 10 });
  for (const l of [1, 3, 10, 30, 100]) for (const strategy of ["kinetic_aabb", "bottom_up"]) ask(`sheet${l}.${strategy}`, scenes.sheet(), strategy, { l });
  ask("tie", scenes.tie());
  ask("carried", scenes.carried(), "kinetic_aabb", { precision: "float32" });
  ask("carried.far", scenes.carried(1000000), "kinetic_aabb", { precision: "float32" });
  ask("carried.double", scenes.carried(1000000));
  const traces = walk(walker, requests);
  const data = Object.fromEntries([...asked].map(([name, at]) => [name, { request: requests[at], trace: traces[at] }]));
  const numbers = {};
  const put = (key, value) => {
    numbers[key] = { value, source: "walker" };
  };
  const trace = (name) => data[name].trace;

  const ribbon = scenes.ribbon(), nodes = (name, body = 0) => trace(name).start[body].nodes.length;
  const primitives = (body) => (body.offsets ? body.offsets.length - 1 : body.indices.length / 3);
  put("ribbon.triangles", primitives(ribbon.bodies[0]));
  put("ribbon.table", primitives(ribbon.bodies[1]));
  put("ribbon.products", primitives(ribbon.bodies[0]) * primitives(ribbon.bodies[1]));
  put("ribbon.nodes", nodes("ribbon.refit"));
  put("ribbon.table_nodes", nodes("ribbon.refit", 1));
  put("ribbon.bounds", 6 * nodes("ribbon.refit"));
  put("ribbon.frames", trace("ribbon.refit").frames.length - 1);
  put("ribbon.values_per_frame", perFrame(trace("ribbon.refit"), "values_written").at(-1));
  put("ribbon.values", last(trace("ribbon.refit"), "values_written"));
  put("ribbon.box_tests_start", trace("ribbon.refit").frames[0].counters.box_tests);
  put("ribbon.box_tests_end", perFrame(trace("ribbon.refit"), "box_tests").at(-1));
  put("ribbon.triangle_tests_end", perFrame(trace("ribbon.refit"), "triangle_tests").at(-1));
  put("ribbon.brute_tests", perFrame(trace("ribbon.brute"), "box_tests").at(-1));
  put("ribbon.pairs_end", trace("ribbon.refit").frames.at(-1).pairs.length);
  put("ribbon.first_contact", trace("ribbon.refit").frames.find((frame) => frame.pairs.length > 0).time);
  put("ribbon.kinetic_values", last(trace("ribbon.kinetic"), "values_written"));
  put("ribbon.kinetic_events", trace("ribbon.kinetic").steps.length);
  put("ageing.triangles", primitives(scenes.ageing().bodies[0]));
  put("ageing.start", trace("ageing.bottom_up").frames[0].counters.box_tests);
  put("ageing.refit_end", perFrame(trace("ageing.bottom_up"), "box_tests").at(-1));
  put("ageing.rebuild_end", perFrame(trace("ageing.rebuild"), "box_tests").at(-1));

  const hits = trace("dart").frames.filter((frame) => frame.pairs.length > 0);
  put("dart.keyframes", trace("dart.keyframes").frames.length);
  put("dart.keyframe_pairs", trace("dart.keyframes").frames.reduce((sum, frame) => sum + frame.pairs.length, 0));
  put("dart.frames", trace("dart").frames.length);
  put("dart.hits", hits.length);
  put("dart.first_hit", hits[0].time);
  put("dart.second_hit", hits[1].time);
  put("dart.pairs", hits[1].pairs.length);

  for (const name of ["race4", "race"]) {
    const scene = name === "race" ? scenes.race() : scenes.race4(), n = scene.bodies[0].vertices;
    put(name + ".runners", n);
    put(name + ".swaps", swaps(scene.bodies[0]));
    put(name + ".internal", swaps(scene.bodies[0]) - changesOf(trace(name), 0, 1));
    put(name + ".pairs", (n * (n - 1)) / 2);
    put(name + ".events", trace(name).steps.length);
    put(name + ".upper_events", eventsOf(trace(name), 1));
    put(name + ".lead_changes", changesOf(trace(name), 0, 1));
    put(name + ".nodes", nodes(name));
    put(name + ".values", last(trace(name), "values_written"));
    put(name + ".scheduled", trace(name).scheduled.length);
    put(name + ".discarded", last(trace(name), "certificates_discarded"));
  }
  for (const name of ["flag", "shoal.kinetic_aabb"]) {
    const key = name.split(".")[0], of = trace(name), touched = of.steps.map((step) => step.touched.length);
    put(key + ".nodes", nodes(name));
    put(key + ".bounds", 6 * nodes(name));
    put(key + ".events", of.steps.length);
    put(key + ".values", last(of, "values_written"));
    put(key + ".scheduled", of.scheduled.length);
    put(key + ".discarded", last(of, "certificates_discarded"));
    put(key + ".made", last(of, "certificates_made"));
    put(key + ".most_touched", Math.max(...touched));
    put(key + ".mean_touched", touched.reduce((a, b) => a + b) / touched.length);
  }
  put("shoal.triangles", 8);
  put("flag.triangles", primitives(scenes.flag().bodies[0]));
  put("flag.vertices", scenes.flag().bodies[0].vertices);
  put("shoal.refit_values", last(trace("shoal.bottom_up"), "values_written"));
  put("shoal.refit_per_frame", perFrame(trace("shoal.bottom_up"), "values_written")[0]);
  put("tangents.vertices", scenes.tangents().bodies[0].vertices);
  put("tangents.events", trace("tangents.kinetic_aabb").steps.length);
  put("tangents.upper", changesOf(trace("tangents.kinetic_aabb"), 0, 1));
  put("tangents.values", last(trace("tangents.kinetic_aabb"), "values_written"));
  put("tangents.refit", last(trace("tangents.bottom_up"), "values_written"));
  put("tangents10.values", last(trace("tangents10.kinetic_aabb"), "values_written"));
  put("tangents10.refit", last(trace("tangents10.bottom_up"), "values_written"));
  put("tangents10.most", Math.max(...perFrame(trace("tangents10.kinetic_aabb"), "values_written")));

  for (const n of [4, 8, 16, 32, 64]) {
    const all = forcedMost(trace(`relay${n}.sorted`).start[0], 1);
    put(`relay${n}.bound`, all);
    for (const order of ["sorted", "mixed"]) {
      put(`relay${n}.${order}_events`, eventsOf(trace(`relay${n}.${order}`), 1));
      put(`relay${n}.${order}_values`, trace(`relay${n}.${order}`).steps.flatMap((step) => step.touched).filter((change) => change.side === 1).length);
    }
    put(`relay${n}.lead_changes`, changesOf(trace(`relay${n}.sorted`), 0, 1));
  }
  for (const n of [8, 16, 32, 64, 128, 256]) {
    put(`wander${n}.points`, n);
    put(`wander${n}.events`, trace("wander" + n).steps.length);
    put(`wander${n}.values`, last(trace("wander" + n), "values_written"));
    put(`wander${n}.bound`, forcedMost(trace("wander" + n).start[0], 4));
    put(`wander${n}.share`, last(trace("wander" + n), "values_written") / forcedMost(trace("wander" + n).start[0], 4));
    put(`wander${n}.per_n_log_n`, trace("wander" + n).steps.length / (n * Math.log2(n)));
  }

  for (const [key, name] of [["boxtree", "drape.kinetic_boxtree"], ["aabb", "drape.kinetic_aabb"]]) {
    put(`drape.${key}_events`, trace(name).steps.length);
    put(`drape.${key}_values`, last(trace(name), "values_written"));
    put(`drape.${key}_bytes`, last(trace(name), "bytes"));
  }
  put("drape.triangles", primitives(scenes.drape().bodies[0]));
  put("drape.nodes", nodes("drape.kinetic_aabb"));
  const [loose, tight] = ["drape.kinetic_boxtree", "drape.kinetic_aabb"].map((name) => surfaces(trace(name)));
  put("drape.loose_start", loose[0] / tight[0]);
  put("drape.loose_end", loose.at(-1) / tight.at(-1));
  put("drape.searches", last(trace("drape.kinetic_boxtree"), "certificate_searches"));
  put("drape.most_searched", last(trace("drape.kinetic_boxtree"), "most_nodes_searched"));

  const combs = trace("combs");
  put("combs.teeth", primitives(scenes.combs().bodies[0]));
  put("combs.products", primitives(scenes.combs().bodies[0]) ** 2);
  put("combs.nodes", nodes("combs"));
  put("combs.events", combs.steps.length);
  for (const kind of ["overlap_events", "parents_apart_events", "leaves_apart_events", "bound_change_events", "list_peak"]) put("combs." + kind, last(combs, kind));
  put("combs.frames_with_pairs", combs.frames.filter((frame) => frame.pairs.length > 0).length);
  put("combs.frames", combs.frames.length);
  put("combs.refit_box_tests", last(trace("combs.refit"), "box_tests"));

  const sheet = scenes.sheet();
  put("sheet.triangles", primitives(sheet.bodies[0]));
  put("sheet.nodes", nodes("sheet1.kinetic_aabb"));
  put("sheet.bounds", 6 * nodes("sheet1.kinetic_aabb"));
  put("sheet.keyframes", sheet.bodies[0].times.length);
  put("sheet.segments", sheet.bodies[0].times.length - 1);
  for (const l of [1, 3, 10, 30, 100]) {
    const [kinetic, refit] = ["kinetic_aabb", "bottom_up"].map((strategy) => last(trace(`sheet${l}.${strategy}`), "values_written"));
    put(`sheet${l}.events`, trace(`sheet${l}.kinetic_aabb`).steps.length);
    put(`sheet${l}.kinetic`, kinetic);
    put(`sheet${l}.refit`, refit);
    put(`sheet${l}.ratio`, refit / kinetic);
    put(`sheet${l}.budget`, refit / trace(`sheet${l}.kinetic_aabb`).steps.length);
  }

  put("tie.events", trace("tie").steps.length);
  put("tie.instants", new Set(trace("tie").steps.map((step) => step.event.time)).size);
  put("carried.points", scenes.carried().bodies[0].vertices);
  put("carried.events", trace("carried").steps.length);
  put("carried.far_events", trace("carried.far").steps.length);
  put("carried.double_events", trace("carried.double").steps.length);
  return { numbers, data };
}
