import { scene, triangles } from "../scenes/build.mjs";
import { scenes } from "../scenes/scenes.mjs";
import { count, last, moves, no, play, state, yes } from "./parts.mjs";

const list = "kinetic_separation_list";
const shape = (x, y) => [[x, y], [x + 1, y], [x, y + 1]];

/// Two triangles, each with a path of positions.
function two(name, a, b, times = a.map((_, k) => k)) {
  return state(scene(name, [triangles("first", times, a.map(([x, y]) => shape(x, y)), [[0, 1, 2]]),
    triangles("second", times, b.map(([x, y]) => shape(x, y)), [[0, 1, 2]])]), list);
}

export const quietList = {
  title: "a list that never changes",
  start: () => state(scenes.combs(), list),
  async check(lab, api) {
    const given = lab.getState();
    if (given.scene.bodies.length !== 2) return no("Use two bodies.");
    for (const body of given.scene.bodies)
      if (!Array.from({ length: body.vertices }, (_, v) => v).some((v) => moves(body, v))) return no(`The body '${body.name}' rests.`);
    const trace = await api.trace(play(given, list));
    const changes = trace.steps.filter((step) => step.event.kind.startsWith("boxes")).length;
    return changes === 0 ? yes("Both bodies move, and no pair of boxes begins or ceases to overlap.")
      : no(`${count(changes, "time")} a pair of boxes begins or ceases to overlap.`);
  },
  solution: () => two("side by side", [[0, 0], [4, 0]], [[0, 3], [4, 3]]),
  wrong: () => [state(scenes.combs(), list), two("one rests", [[0, 0], [4, 0]], [[0, 3], [0, 3]])],
};

export const axesTakeTurns = {
  title: "the axes take turns",
  start: () => two("passing by", [[0, 0], [8, 0]], [[4, 3], [4, 3]]),
  async check(lab, api) {
    const given = lab.getState();
    if (given.scene.bodies.length !== 2) return no("Use two bodies.");
    const trace = await api.trace(play(given, "bottom_up", { l: 128, nodes: true }));
    const overlap = (frame, axis) => {
      const [a, b] = frame.hierarchies.map((hierarchy) => hierarchy.nodes[0]);
      return a.lower[axis] <= b.upper[axis] && b.lower[axis] <= a.upper[axis];
    };
    const [x, y] = [0, 1].map((axis) => trace.frames.filter((frame) => overlap(frame, axis)));
    if (x.length === 0 || y.length === 0) return no(`The boxes of the bodies never overlap in ${x.length === 0 ? "x" : "y"}.`);
    const both = x.find((frame) => y.includes(frame));
    if (both) return no(`At ${both.time} s the boxes overlap in both axes.`);
    const met = (await api.trace(play(given, list))).steps.find((step) => step.event.kind === "boxes_meet");
    return met ? no(`At ${met.event.time} s two boxes begin to overlap.`)
      : yes("Each axis overlaps for a while, never both at once, and the list has no event. The maximum of the axes' first overlaps would have been a false alarm.");
  },
  solution: () => two("turns", [[0, 0], [8, 0], [8, 4]], [[4, 4], [4, 4], [4, 4]]),
  wrong: () => [axesTakeTurns.start(), two("hit", [[0, 0], [8, 0]], [[4, 0], [4, 0]])],
};

export const meetAndPart = {
  title: "one pair meets and parts",
  start: () => two("passing by", [[0, 0], [8, 0]], [[4, 3], [4, 3]]),
  async check(lab, api) {
    const given = lab.getState();
    const trace = await api.trace(play(given, list));
    const [overlaps, leaves] = [last(trace, "overlap_events"), last(trace, "leaves_apart_events")];
    return overlaps === 1 && leaves === 1 ? yes("One pair of leaves begins to overlap, and ceases to overlap.")
      : no(`Boxes began to overlap ${count(overlaps, "time")}, and leaves ceased to overlap ${count(leaves, "time")}; once each is wanted.`);
  },
  solution: () => two("hit", [[0, 0], [8, 0]], [[4, 0], [4, 0]]),
  wrong: () => [meetAndPart.start(), two("stay", [[0, 0], [4, 0]], [[4, 0], [4, 0]])],
};
