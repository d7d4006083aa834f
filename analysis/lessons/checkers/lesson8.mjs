import { points, scene } from "../scenes/build.mjs";
import { scenes } from "../scenes/scenes.mjs";
import { count, last, no, play, state, velocities, yes } from "./parts.mjs";

const withFrames = (l) => state({ ...scenes.sheet(), frames: { l } });

export const tenthOfValues = {
  title: "a tenth of the refit's values",
  start: () => withFrames(1),
  async check(lab, api) {
    const given = lab.getState();
    const kinetic = last(await api.trace(play(given)), "values_written"), refit = last(await api.trace(play(given, "bottom_up")), "values_written");
    if (kinetic === 0) return no("The kinetic tree writes nothing here: let vertices overtake each other.");
    const share = (kinetic / refit).toFixed(3), l = given.scene.frames.l;
    return 10 * kinetic <= refit ? yes(`With l = ${l} the kinetic tree writes ${kinetic} values, the refit ${refit}: a share of ${share}.`)
      : no(`With l = ${l} the kinetic tree writes ${kinetic} values, the refit ${refit}: a share of ${share}. Which of the two depends on l?`);
  },
  solution: () => withFrames(30),
  wrong: () => [withFrames(1), state({ ...scenes.tangents(16), frames: { l: 2 } })],
};

export const silentMotion = {
  title: "all different, and no event",
  start: () => state(scenes.wander(8)),
  async check(lab, api) {
    const given = lab.getState(), body = given.scene.bodies[0];
    if (body.vertices < 8) return no("Use at least eight vertices.");
    const seen = new Set(Array.from({ length: body.vertices }, (_, v) => JSON.stringify(velocities(body, v))));
    if (seen.size < body.vertices) return no("Two vertices move alike; every vertex should have a velocity of its own.");
    const { steps } = await api.trace(play(given));
    return steps.length === 0 ? yes("Every vertex moves in its own way, and no certificate fails.") : no(`This scene has ${count(steps.length, "event")}.`);
  },
  solution() {
    const from = Array.from({ length: 8 }, (_, i) => [i, (3 * i) % 8]);
    return state(scene("expansion", [points("points", [0, 1], [from, from.map(([x, y]) => [2 * x + 1, 2 * y + 1])])]));
  },
  wrong() {
    const from = Array.from({ length: 8 }, (_, i) => [i, (3 * i) % 8]);
    return [state(scenes.wander(8)), state(scene("translation", [points("points", [0, 1], [from, from.map(([x, y]) => [x + 1, y])])]))];
  },
};
