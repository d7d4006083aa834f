import { strip, triangles } from "../scenes/build.mjs";
import { scenes } from "../scenes/scenes.mjs";
import { no, perFrame, play, state, yes } from "./parts.mjs";

function withSag(depth) {
  const scene = scenes.ribbon();
  scene.bodies[0] = strip("ribbon", [0, 1, 2], 8, (u, v, k) => [u, 3.5 + 0.5 * v - [0, depth / 2, depth][k] * u * (8 - u)]);
  return scene;
}

export const threePairs = {
  title: "three pairs at the last frame",
  start: () => state(scenes.ribbon(), "bottom_up"),
  async check(lab, api) {
    const given = lab.getState();
    if (given.scene.bodies.length < 2) return no("The scene needs two bodies.");
    const trace = await api.trace(play(given, "bottom_up"));
    const pairs = trace.frames.at(-1).pairs.length;
    return pairs === 3 ? yes("Three pairs of triangles intersect at the last frame.")
      : no(`At the last frame ${pairs} pairs intersect. Raise or lower single vertices of the last keyframe.`);
  },
  solution() {
    const scene = scenes.ribbon();
    scene.bodies[0] = triangles("ribbon", [0, 1], [[[0, 3], [1, 3], [0, 4], [6, 3], [7, 3], [6, 4]], [[2.25, 0.75], [2.5, 1.5], [2, 1.5], [6, 3], [7, 3], [6, 4]]],
      [[0, 1, 2], [3, 4, 5]]);
    scene.bodies[1] = triangles("table", [0], [[[2, 0.5], [6, 0.5], [2, 1], [6, 1], [2, 0.875], [3, 0.75]]], [[0, 1, 2], [1, 3, 2], [0, 5, 4]]);
    return state(scene, "bottom_up");
  },
  wrong: () => [state(withSag(0), "bottom_up"), state(withSag(0.1875), "bottom_up")],
};

export const agedTree = {
  title: "a tree that ages",
  start: () => state(scenes.ageing(), "bottom_up"),
  async check(lab, api) {
    const given = lab.getState();
    if (given.scene.bodies.length < 2) return no("The scene needs two bodies.");
    const tests = async (strategy) => perFrame(await api.trace(play(given, strategy)), "box_tests").at(-1);
    const [refitted, rebuilt] = [await tests("bottom_up"), await tests("rebuild")];
    if (rebuilt === 0) return no("A new tree tests no box at the last frame: the bodies are too far apart.");
    return refitted >= 2 * rebuilt
      ? yes(`At the last frame the refitted tree tests ${refitted} boxes, a new tree ${rebuilt}.`)
      : no(`At the last frame the refitted tree tests ${refitted} boxes, a new tree ${rebuilt}: less than twice as many. Let neighbours in the tree end far from each other.`);
  },
  solution() {
    const scene = scenes.ageing(), order = [0, 8, 4, 12, 2, 10, 6, 14, 1, 9, 5, 13, 3, 11, 7, 15];
    const row = (at) => order.flatMap((to, i) => [[0, 0], [1, 0], [0, 1]].map(([a, b]) => [2 * (at ? to : i) + a, b]));
    scene.bodies[0] = triangles("tiles", [0, 1], [row(0), row(1)], order.map((_, i) => [3 * i, 3 * i + 1, 3 * i + 2]));
    scene.bodies[1] = triangles("probe", [0], [[[16, 0.25], [17, 0.25], [16, 0.75]]], [[0, 1, 2]]);
    return state(scene, "bottom_up");
  },
  wrong() {
    const still = scenes.ageing();
    still.bodies[0].positions[1] = still.bodies[0].positions[0];
    const far = scenes.ageing();
    far.bodies[1].positions[0] = far.bodies[1].positions[0].map((x, i) => (i % 3 === 1 ? x + 100 : x));
    return [state(still, "bottom_up"), state(far, "bottom_up")];
  },
};
