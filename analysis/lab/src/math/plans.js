/**
 * Flight plans as the page draws them: polylines of one coordinate of one vertex over time, read from the scene. In a
 * world of float32 the scene's numbers are rounded first, as the engine stores them.
 */

/** The value of a scene's number in the world's precision. */
export const stored = (x, precision) => precision === 'float32' ? Math.fround(x) : x;

/** The polyline of one coordinate: {times, values}; before its begin and after its end the vertex rests. */
export function polyline(body, vertex, axis, precision = 'float64') {
  const times = body.times, values = new Float64Array(times.length);
  for (let k = 0; k < times.length; ++k) values[k] = stored(body.positions[k][3 * vertex + axis], precision);
  return {times, values};
}

/** The value of a polyline at a time. */
export function valueAt({times, values}, t) {
  const last = times.length - 1;
  if (t <= times[0]) return values[0];
  if (t >= times[last]) return values[last];
  let low = 0, high = last;
  while (high - low > 1) { const mid = (low + high) >> 1; if (times[mid] <= t) low = mid; else high = mid; }
  const u = (t - times[low]) / (times[high] - times[low]);
  return values[low] + u * (values[high] - values[low]);
}

/** The position [x, y, z] of a vertex of a body at a time. */
export function positionAt(body, vertex, t, precision) {
  return [0, 1, 2].map((axis) => valueAt(polyline(body, vertex, axis, precision), t));
}

/** All keyframe times of the bodies between `begin` and `end`, in order, each once. */
export function overlay(bodies, begin, end) {
  const all = new Set([begin, end]);
  for (const body of bodies) for (const t of body.times) if (t > begin && t < end) all.add(t);
  return [...all].sort((a, b) => a - b);
}

/** The times of a scene's frames: l per interval between keyframes, and the last keyframe. */
export function frameTimes(keyframes, l) {
  const frames = [];
  for (let k = 0; k + 1 < keyframes.length; ++k)
    for (let i = 0; i < l; ++i) frames.push(keyframes[k] + (keyframes[k + 1] - keyframes[k]) * (i / l));
  if (keyframes.length) frames.push(keyframes[keyframes.length - 1]);
  return frames;
}

/** The index of the last frame at or before t (0 if none). */
export function frameAt(frames, t) {
  let low = 0, high = frames.length - 1;
  while (low < high) { const mid = (low + high + 1) >> 1; if (frames[mid] <= t) low = mid; else high = mid - 1; }
  return low;
}

/** The begin and the end of a scene's clip. */
export function clip(scene) {
  let begin = Infinity, end = -Infinity;
  for (const body of scene.bodies) { begin = Math.min(begin, body.times[0]); end = Math.max(end, body.times[body.times.length - 1]); }
  return {begin, end};
}

/** The side's axis and sense: side 2 a is the lower end on axis a, 2 a + 1 the upper. */
export const axisOf = (side) => side >> 1;
export const isUpper = (side) => (side & 1) === 1;
export const axisNames = ['x', 'y', 'z'];
export const sideName = (side) => side > 5 ? `slanted side ${side}` : `${isUpper(side) ? 'upper' : 'lower'} ${axisNames[axisOf(side)]}`;
