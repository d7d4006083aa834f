import { points, scene } from "../scenes/build.mjs";
import { scenes } from "../scenes/scenes.mjs";
import { bySide, count, no, play, state, when, yes } from "./parts.mjs";

/// Eight runners from `from` to `to` along x.
function runners(from, to) {
  return state(scene("runners", [points("runners", [0, 1], [from, to].map((xs) => xs.map((x, i) => [x, i])))]));
}
const eight = [0, 1, 2, 3, 4, 5, 6, 7];

export const twelveEvents = {
  title: "exactly twelve events",
  start: () => state(scenes.race()),
  async check(lab, api) {
    const { steps } = await api.trace(play(lab.getState()));
    const sides = steps.length > 0 ? `: ${bySide(steps)}` : "";
    return steps.length === 12 ? yes(`Exactly twelve events${sides}.`) : no(`This scene has ${count(steps.length, "event")}${sides}.`);
  },
  solution: () => runners(eight, [6, 5, 4, 3, 10, 8, 9, 7]),
  wrong: () => [state(scenes.race()), runners(eight, eight)],
};

export const sevenLeaders = {
  title: "the lead changes seven times among eight",
  start: () => state(scenes.race()),
  async check(lab, api) {
    const given = lab.getState(), body = given.scene.bodies[0];
    if (body.vertices !== 8 || body.times.length !== 2) return no("Use eight points and two keyframes.");
    const { steps } = await api.trace(play(given));
    const leads = (change) => change.body === 0 && change.node === 0 && change.side === 1;
    const changes = steps.filter((step) => step.touched.some(leads)), times = changes.map((step) => step.event.time);
    return changes.length === 7 ? yes("The root's upper side in x changes hands seven times: once less than there are runners.")
      : no(`The lead in x changes ${count(changes.length, "time")}${times.length > 0 ? ", " + when(times) : ""}.`);
  },
  solution: () => state(scenes.relay(8)),
  wrong: () => [state(scenes.race()), runners(eight, [...eight].reverse())],
};

export const hiddenEvents = {
  title: "events that the lead does not see",
  start: () => state(scenes.race()),
  async check(lab, api) {
    const { steps } = await api.trace(play(lab.getState()));
    const upper = steps.filter((step) => step.event.side === 1);
    const lead = steps.flatMap((step) => step.touched).filter((change) => change.body === 0 && change.node === 0 && change.side === 1).length;
    if (lead > 0) return no(`The lead in x changes ${count(lead, "time")}; it should never change.`);
    return upper.length >= 3 ? yes(`${count(upper.length, "event")} of upper x sides, and none of them changes the lead.`)
      : no(`Only ${count(upper.length, "event")} of upper x sides; at least three are wanted.`);
  },
  solution: () => runners(eight, [1.5, 0.5, 3.5, 2.5, 5.5, 4.5, 6, 9]),
  wrong: () => [state(scenes.race4()), runners(eight, eight)],
};
