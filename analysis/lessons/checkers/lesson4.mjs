import { triangles } from "../scenes/build.mjs";
import { scenes } from "../scenes/scenes.mjs";
import { bySide, count, no, perFrame, play, state, yes } from "./parts.mjs";

export const breakT9 = {
  title: "break the claim T9",
  start: () => state(scenes.shoal()),
  async check(lab, api) {
    const given = lab.getState();
    const kinetic = perFrame(await api.trace(play(given)), "values_written");
    const refit = perFrame(await api.trace(play(given, "bottom_up")), "values_written");
    const at = kinetic.findIndex((value, frame) => value > refit[frame]);
    if (at >= 0) return yes(`On the way to frame ${at + 1} the kinetic tree writes ${kinetic[at]} values, the refit ${refit[at]}.`);
    const close = kinetic.reduce((best, value, frame) => (value / refit[frame] > kinetic[best] / refit[best] ? frame : best), 0);
    return no(`In every frame the kinetic tree writes at most as many values as the refit; the closest is frame ${close + 1} with ${kinetic[close]} against ${refit[close]}. ${given.scene.frames.l > 1 ? "Fewer frames put more events into each."
      : "There is one frame per segment already: fewer nodes make the refit cheaper, more vertices per polygon make more changes possible."}`);
  },
  solution: () => state(scenes.tangents(16)),
  wrong: () => [state(scenes.shoal()), state(scenes.tangents(6))],
};

/// Triangles in a row, the first the tallest. One vertex moves by (dx, dy): by default the second of the first triangle.
function row(dx, dy, { triangles: m = 4, vertex = 1 } = {}) {
  const all = Array.from({ length: m }, (_, i) => i), from = all.flatMap((i) => [[3 * i, 0.125 * i], [3 * i + 1, 0.5], [3 * i + 0.25, i === 0 ? 1 : 0.75]]);
  const to = from.map(([x, y], v) => (v === vertex ? [x + dx, y + dy] : [x, y]));
  const faces = all.map((i) => [3 * i, 3 * i + 1, 3 * i + 2]);
  return state({ ...scenes.shoal(), name: "row", bodies: [triangles("row", [0, 1], [from, to], faces)] });
}

export const climber = {
  title: "one event that climbs to the root",
  start: () => row(0, 0),
  async check(lab, api) {
    const { steps, start } = await api.trace(play(lab.getState()));
    if (steps.length !== 1) return no(`This scene has ${count(steps.length, "event")}${steps.length > 0 ? ` (${bySide(steps)})` : ""}; exactly one is wanted.`);
    const [{ touched, event }] = steps;
    const top = touched.some((change) => change.node === 0);
    if (start[event.body].nodes.length < 7) return no("The tree is too small: use four triangles or more.");
    if (!start[event.body].nodes[event.node].leaf) return no(`The event begins at the inner node ${event.node}; it should begin at a leaf.`);
    return top ? yes(`The only event begins at node ${event.node} and changes ${touched.length} nodes, up to the root.`)
      : no(`The event changes ${count(touched.length, "node")}; it begins at a leaf, as it should, but does not reach the root.`);
  },
  solution: () => row(0, 1),
  wrong: () => [row(-2, 0), row(0, 1, { triangles: 8, vertex: 5 }), state(scenes.flag())],
};
