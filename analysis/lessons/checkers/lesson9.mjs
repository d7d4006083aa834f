import { points, scene } from "../scenes/build.mjs";
import { scenes } from "../scenes/scenes.mjs";
import { count, no, path, play, state, yes } from "./parts.mjs";

export const noDuration = {
  title: "a realiser for no time at all",
  start: () => state(scenes.race4()),
  async check(lab, api) {
    const { steps } = await api.trace(play(lab.getState()));
    const changes = steps.flatMap((step) => step.touched.map((change) => ({ ...change, time: step.event.time })));
    const twice = changes.find((a, i) => changes.some((b, j) => j > i && b.time === a.time && b.body === a.body && b.node === a.node && b.side === a.side));
    return twice ? yes(`At ${twice.time} s node ${twice.node} changes the realiser of one side twice: vertex ${twice.newVertex} holds the bound for no time.`)
      : no("No bound changes twice at one instant. Let three lines of one subtree meet in one point, in an order that the tree notices one by one.");
  },
  solution: () => state(scene("three in one point", [points("points", [0, 1], [[[4, 0], [2, 4], [0, 40], [-9, 44]], [[4, 0], [6, 4], [8, 40], [-9, 44]]])])),
  wrong: () => [state(scenes.race4()), state(scene("two by two", [points("points", [0, 1], [[[0, 0], [4, 4]], [[4, 0], [0, 4]]])]))],
};

export const breakT10 = {
  title: "break the claim T10",
  start: () => state(scenes.carried(), "kinetic_aabb", { precision: "float32" }),
  async check(lab, api) {
    const given = lab.getState();
    for (const body of given.scene.bodies) {
      const steps = (v) => path(body, v).map((at) => at.map((x, axis) => x - path(body, v)[0][axis]));
      const first = steps(0);
      for (let v = 1; v < body.vertices; ++v)
        if (steps(v).some((row, k) => row.some((x, axis) => Math.abs(x - first[k][axis]) > 1e-6 * Math.max(1, Math.abs(first[k][axis])))))
          return no(`Vertex ${v} of '${body.name}' is not translated as vertex 0 is.`);
      if (!first.some((row) => row.some((x) => x !== 0))) return no(`The body '${body.name}' rests.`);
    }
    const [coarse, fine] = [await api.trace(play(given, "kinetic_aabb", { precision: "float32" })), await api.trace(play(given))];
    if (coarse.steps.length === 0) return no("No event in float: all coordinates are exact there. Go further from the origin.");
    return yes(`A translation of all vertices, and ${count(coarse.steps.length, "event")} in float (${fine.steps.length} in double).`);
  },
  solution: () => state(scenes.carried(1000000), "kinetic_aabb", { precision: "float32" }),
  wrong: () => [state(scenes.carried(), "kinetic_aabb", { precision: "float32" }), state(scenes.wander(8), "kinetic_aabb", { precision: "float32" })],
};
