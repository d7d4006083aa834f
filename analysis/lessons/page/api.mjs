// What a checker gets in a page: api.trace(request), played by an engine of the lab. The result is that of the
// native walker (walker/walker.cpp).

const everything = { positions: false, nodes: true, pairs: true, queue: false, counters: true };

/// The times of the frames: l per keyframe interval of all bodies, and the last keyframe.
export function frameTimes(scene, l) {
  const keyframes = [...new Set(scene.bodies.flatMap((body) => Array.from(body.times)))].sort((a, b) => a - b);
  const frames = keyframes.slice(0, -1).flatMap((from, k) =>
    Array.from({ length: l }, (_, i) => from + ((keyframes[k + 1] - from) * i) / l));
  return [...frames, keyframes.at(-1)];
}

const plain = (hierarchies) => hierarchies.map((hierarchy) => hierarchy && { primitives: Array.from(hierarchy.primitives),
  nodes: hierarchy.nodes.map(({ parent, first, count, leaf, stale, lower, upper }) => ({ parent, first, count, leaf, stale, lower: Array.from(lower), upper: Array.from(upper) })) });

const tuples = (pairs) => Array.from({ length: pairs.length / 4 }, (_, i) => Array.from(pairs.slice(4 * i, 4 * i + 4)));

/// Plays a request on an engine.
async function trace(engine, request) {
  const { scene, strategy, params, topology, precision = "float64", l = 1 } = request, times = frameTimes(scene, l);
  const { hasEvents } = await engine.load({ scene: { ...scene, frames: { l } }, strategy, params, topology, precision, t0: times[0] });
  const result = { frames: [], steps: [], hasEvents };
  for (const time of times) {
    const state = await engine.frame(time, everything);
    result.frames.push({ time, pairs: tuples(state.pairs), counters: { ...state.counters }, ...(request.nodes ? { hierarchies: plain(state.hierarchies) } : {}) });
    if (time === times[0]) result.start = plain(state.hierarchies);
    if (time === times.at(-1)) result.end = plain(state.hierarchies);
  }
  if (hasEvents) result.steps = await engine.history();
  return result;
}

/// Returns the function that plays requests, one after the other, all on one engine: to start one takes longer than to play a small scene.
export function player(createEngine) {
  let engine = null, last = Promise.resolve();
  return (request) => {
    const played = last.then(async () => {
      engine ??= await createEngine();
      return trace(engine, request);
    });
    last = played.catch(() => {});
    return played;
  };
}
