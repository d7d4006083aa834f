import { points, scene } from "../scenes/build.mjs";
import { scenes } from "../scenes/scenes.mjs";
import { count, no, play, state, yes } from "./parts.mjs";

/// The summed half perimeter of all boxes of the first body at the end.
function perimeter(trace) {
  return trace.end[0].nodes.reduce((sum, { lower, upper }) => sum + upper.reduce((part, x, axis) => part + x - lower[axis], 0), 0);
}

export const looseBoxes = {
  title: "boxes three times as large as tight ones",
  start: () => state(scenes.wander(16), "kinetic_boxtree"),
  async check(lab, api) {
    const given = lab.getState();
    const loose = perimeter(await api.trace(play(given, "kinetic_boxtree"))), tight = perimeter(await api.trace(play(given)));
    const ratio = (loose / tight).toFixed(2);
    return loose >= 3 * tight ? yes(`At the end the boxes of the BoxTree have ${ratio} times the perimeter of tight ones.`)
      : no(`At the end the boxes of the BoxTree have ${ratio} times the perimeter of tight ones; at least 3 is wanted. Planes are chosen at the start: change the direction in which the body extends.`);
  },
  solution: () => state(turning(16), "kinetic_boxtree"),
  wrong: () => [state(scenes.wander(16), "kinetic_boxtree"), state(still(), "kinetic_boxtree")],
};

/// Points in a row along x that turn into a row along y.
function turning(n) {
  const along = Array.from({ length: n }, (_, i) => i);
  return scene("turning row", [points("points", [0, 1], [along.map((i) => [i, (i * 5) % 7 / 8]), along.map((i) => [(i * 3) % 5 / 8, (i * 13) % n])])]);
}
function still() {
  const row = Array.from({ length: 16 }, (_, i) => [i, (i * 5) % 7 / 8]);
  return scene("row", [points("points", [0, 1], [row, row.map(([x, y]) => [x + 1, y])])]);
}

export const silentBoxTree = {
  title: "events for the AABB tree only",
  start: () => state(scenes.race(), "kinetic_boxtree"),
  async check(lab, api) {
    const given = lab.getState();
    const boxtree = (await api.trace(play(given, "kinetic_boxtree"))).steps.length, aabb = (await api.trace(play(given))).steps.length;
    if (boxtree > 0) return no(`The BoxTree has ${count(boxtree, "event")}; it should have none.`);
    return aabb >= 5 ? yes(`No event in the BoxTree, ${aabb} in the AABB tree.`) : no(`The AABB tree has ${count(aabb, "event")}; at least five are wanted.`);
  },
  solution() {
    const x = [0, 1, 4, 5, 8, 9], y0 = [0, 0.25, 0.5, 0.25, 0, 0.25], y1 = [0.25, 0, 0.25, 0.5, 0.25, 0];
    const at = (ys) => [...x.map((a, i) => [a, ys[i]]), [12, -1], [13, 2]];
    return state(scene("quiet planes", [points("points", [0, 1], [at(y0), at(y1)])]), "kinetic_boxtree");
  },
  wrong: () => [state(scenes.race(), "kinetic_boxtree"), state(still(), "kinetic_boxtree")],
};
