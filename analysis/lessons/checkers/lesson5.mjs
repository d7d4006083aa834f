import { points, scene } from "../scenes/build.mjs";
import { scenes } from "../scenes/scenes.mjs";
import { count, no, play, state, yes } from "./parts.mjs";

export const moreThanN = {
  title: "more changes than a line allows",
  start: () => state(scenes.race4()),
  async check(lab, api) {
    const given = lab.getState(), n = given.scene.bodies[0].vertices;
    const { steps } = await api.trace(play(given));
    const changes = steps.flatMap((step) => step.touched).filter((change) => change.body === 0 && change.node === 0 && change.side === 1).length;
    const segments = given.scene.bodies[0].times.length - 1;
    return changes > n - 1 ? yes(`${n} vertices, ${changes} changes of the root's upper side in x, over ${count(segments, "segment")}.`)
      : no(`${n} vertices and ${count(changes, "change")} of the root's upper side in x; more than ${n - 1} are wanted.`);
  },
  solution: () => state(scene("there and back", [points("runners", [0, 1, 2, 3], [[0, 2], [3, 2], [0, 2], [3, 2]].map((xs) => xs.map((x, i) => [x, i])))])),
  wrong: () => [state(scenes.race4()), state(scenes.relay(4))],
};

export const fullTree = {
  title: "seventeen events on one side",
  start: () => state(scenes.relay(8)),
  async check(lab, api) {
    const given = lab.getState(), body = given.scene.bodies[0];
    if (body.vertices > 8 || body.times.length !== 2) return no("Use at most eight points and two keyframes.");
    const { steps } = await api.trace(play(given));
    const events = steps.filter((step) => step.event.side === 1).length;
    return events >= 17 ? yes(`${events} events of upper sides in x: every node's envelope is as long as it can be, and no event serves two nodes.`)
      : no(`${count(events, "event")} of upper sides in x. Which runners share a subtree decides how many nodes one event serves.`);
  },
  solution: () => state(scenes.relay(8, "mixed")),
  wrong: () => [state(scenes.relay(8)), state(scenes.race())],
};
