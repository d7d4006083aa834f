// Parts of checkers. A checker is a module with
//   title                 a few words
//   start()               the state of the lab that a student begins with
//   check(lab, api)       => {ok, message}; reads lab.getState(), plays scenes by api.trace(request)
//   solution(), wrong()   a state that is accepted; states that are refused
// api.trace plays a request of the walker (walker/walker.cpp), natively or by the lab's engine.

export { binary, paper, state } from "../scenes/state.mjs";
import { binary, paper } from "../scenes/state.mjs";

export const no = (message) => ({ ok: false, message });
export const yes = (message) => ({ ok: true, message });

/// The request that plays the scene of a state by one of the paper's structures, or by any strategy.
export function play(state, strategy = "kinetic_aabb", more = {}) {
  return { scene: state.scene, ...(paper[strategy] ?? { strategy, params: {} }), topology: binary,
    precision: "float64", l: state.scene.frames?.l ?? 1, ...more };
}

/// Differences of a counter from frame to frame.
export function perFrame(trace, counter) {
  const values = trace.frames.map((frame) => frame.counters[counter] ?? 0);
  return values.slice(1).map((value, i) => value - values[i]);
}

export const last = (trace, counter) => trace.frames.at(-1).counters[counter] ?? 0;

/// Positions of one vertex at every keyframe: [keyframe][axis].
export const path = (body, vertex) => body.positions.map((row) => Array.from(row).slice(3 * vertex, 3 * vertex + 3));

/// The velocity of a vertex in every segment.
export function velocities(body, vertex) {
  const at = path(body, vertex);
  return at.slice(1).map((to, k) => to.map((x, axis) => (x - at[k][axis]) / (body.times[k + 1] - body.times[k])));
}

export const moves = (body, vertex) => velocities(body, vertex).some((v) => v.some((x) => x !== 0));
export const count = (n, noun) => `${n} ${noun}${n === 1 ? "" : "s"}`;
export const sideNames = ["lower x", "upper x", "lower y", "upper y", "lower z", "upper z"];

/// Events by side, in words: "5 at upper x, 4 at lower x".
export function bySide(steps) {
  const of = sideNames.map((name, side) => [steps.filter((step) => step.event.side === side).length, name]);
  return of.filter(([n]) => n > 0).map(([n, name]) => `${n} at ${name}`).join(", ");
}

/// When things happen, in words: "at 0.5 s and 0.75 s"; three decimals are enough to find them in the lab.
export function when(times) {
  const words = times.map((time) => `${Number(time.toFixed(3))} s`);
  return words.length < 2 ? `at ${words.join("")}` : `at ${words.slice(0, -1).join(", ")} and ${words.at(-1)}`;
}
