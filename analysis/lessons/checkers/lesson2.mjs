import { points, scene, triangles } from "../scenes/build.mjs";
import { scenes } from "../scenes/scenes.mjs";
import { count, moves, no, play, state, yes } from "./parts.mjs";

export const tunnel = {
  title: "meet between keyframes only",
  start() {
    const made = scenes.dart();
    made.bodies[0] = triangles("dart", [0, 1], [0, 1].map(() => [[0, 1], [1, 1.25], [0, 1.5]]), [[0, 1, 2]]);
    return state(made, "bottom_up");
  },
  async check(lab, api) {
    const given = lab.getState();
    const coarse = await api.trace(play(given, "bottom_up", { l: 1 }));
    const met = coarse.frames.find((frame) => frame.pairs.length > 0);
    if (met) return no(`At the keyframe at ${met.time} s the bodies intersect already.`);
    const fine = await api.trace(play(given, "bottom_up", { l: 64 }));
    const hit = fine.frames.find((frame) => frame.pairs.length > 0);
    return hit ? yes(`No pair at any keyframe, and ${count(hit.pairs.length, "pair")} at ${hit.time} s.`)
      : no("At none of 64 frames per interval do the bodies intersect.");
  },
  solution: () => state(scenes.dart(), "bottom_up"),
  wrong() {
    const inside = scenes.dart();
    inside.bodies[0] = triangles("dart", [0, 1, 2], [0, 3, 6].map((x) => [[x, 1], [x + 1, 1.25], [x, 1.5]]), [[0, 1, 2]]);
    return [tunnel.start(), state(inside, "bottom_up")];
  },
};

export const stillBox = {
  title: "a box that rests while its content moves",
  start: () => state(scenes.wander(8), "bottom_up"),
  async check(lab, api) {
    const given = lab.getState(), body = given.scene.bodies[0];
    const moving = Array.from({ length: body.vertices }, (_, v) => v).filter((v) => moves(body, v)).length;
    if (moving < 4) return no(`Only ${count(moving, "vertex").replace("vertexs", "vertices")} of the first body move${moving === 1 ? "s" : ""}; at least four should.`);
    const trace = await api.trace(play(given, "bottom_up", { l: 32, nodes: true }));
    const box = (frame) => JSON.stringify([frame.hierarchies[0].nodes[0].lower, frame.hierarchies[0].nodes[0].upper]);
    const changed = trace.frames.find((frame) => box(frame) !== box(trace.frames[0]));
    if (changed) return no(`The root's box has changed at ${changed.time} s.`);
    const writes = trace.frames.at(-1).counters.values_written;
    return yes(`The root's box is the same at all ${trace.frames.length} frames. The refit wrote ${writes} values all the same.`);
  },
  solution: () => state(scene("still box", [points("points", [0, 1], [
    [[0, 0], [16, 16], [4, 4], [8, 4], [4, 8], [8, 8]], [[0, 0], [16, 16], [8, 8], [4, 8], [8, 4], [4, 4]]])]), "bottom_up"),
  wrong: () => [stillBox.start(), state(scene("all at rest", [points("points", [0, 1], [
    [[0, 0], [16, 16], [4, 4], [8, 4]], [[0, 0], [16, 16], [4, 4], [8, 4]]])]), "bottom_up")],
};
