/**
 * Edits of scenes, as functions from a scene to a new scene. Nothing is changed in place; wrong input throws an Error that
 * names the value.
 */
import {positionAt, polyline, valueAt} from '../math/plans.js';
import {primitiveCount, primitiveVertices} from '../math/hierarchy.js';

/** The largest scene that can be edited by hand. */
export const editable = (scene) => scene && scene.bodies.reduce((sum, body) => sum + body.vertices, 0) <= 2000;

function withBody(scene, index, change) {
  const body = scene.bodies[index];
  if (!body) throw new Error(`there is no body ${index}`);
  return {...scene, bodies: scene.bodies.map((old, b) => b === index ? {...old, ...change(old)} : old)};
}

function checkVertex(body, vertex) {
  if (!(vertex >= 0 && vertex < body.vertices)) throw new Error(`body '${body.name}' has no vertex ${vertex}`);
}

function checkPosition(position) {
  for (const x of position) if (!Number.isFinite(x)) throw new Error(`a coordinate must be a finite number, not '${x}'`);
}

/** Sets the position of a vertex at one keyframe. */
export function setKeyframe(scene, {body, vertex, keyframe, position}) {
  checkPosition(position);
  return withBody(scene, body, (old) => {
    checkVertex(old, vertex);
    if (!old.positions[keyframe]) throw new Error(`body '${old.name}' has no keyframe ${keyframe}`);
    return {positions: old.positions.map((p, k) => {
      if (k !== keyframe) return p;
      const copy = Array.from(p);
      position.forEach((x, axis) => { copy[3 * vertex + axis] = x; });
      return copy;
    })};
  });
}

/** Moves the whole flight plan of a vertex by a vector. */
export function shiftPlan(scene, {body, vertex, by}) {
  checkPosition(by);
  return withBody(scene, body, (old) => {
    checkVertex(old, vertex);
    return {positions: old.positions.map((p) => {
      const copy = Array.from(p);
      by.forEach((x, axis) => { copy[3 * vertex + axis] += x; });
      return copy;
    })};
  });
}

/** The keyframe of a body that is nearest to time t. */
export function nearestKeyframe(body, t) {
  let best = 0;
  body.times.forEach((time, k) => { if (Math.abs(time - t) < Math.abs(body.times[best] - t)) best = k; });
  return best;
}

/** Adds a keyframe at t to a body, on the present paths (positions are rounded to doubles there). */
export function addKeyframe(scene, {body, time}) {
  if (!Number.isFinite(time)) throw new Error(`the time of a keyframe must be a number of seconds, not '${time}'`);
  return withBody(scene, body, (old) => {
    if (old.times.includes(time)) throw new Error(`body '${old.name}' has a keyframe at ${time} s already`);
    const made = Array.from({length: old.vertices}, (_, v) => positionAt(old, v, time)).flat();
    const all = old.times.map((t, k) => ({t, p: old.positions[k]})).concat({t: time, p: made}).sort((a, b) => a.t - b.t);
    return {times: all.map(({t}) => t), positions: all.map(({p}) => p)};
  });
}

/** Removes a keyframe of a body; one must stay. */
export function removeKeyframe(scene, {body, keyframe}) {
  return withBody(scene, body, (old) => {
    if (old.times.length < 2) throw new Error(`body '${old.name}' has one keyframe only; it cannot be removed`);
    const keep = (_, k) => k !== keyframe;
    return {times: old.times.filter(keep), positions: old.positions.filter(keep)};
  });
}

/** Moves a keyframe of a body to another time, between its neighbours. */
export function setKeyframeTime(scene, {body, keyframe, time}) {
  return withBody(scene, body, (old) => {
    const before = old.times[keyframe - 1] ?? -Infinity, after = old.times[keyframe + 1] ?? Infinity;
    if (!(time > before && time < after)) throw new Error(`keyframe ${keyframe} must stay between ${before} s and ${after} s; ${time} s is not`);
    return {times: old.times.map((t, k) => k === keyframe ? time : t)};
  });
}

/** Adds a vertex that rests at a position at t and moves in parallel with `like`, if given. Points become a primitive. */
export function addVertex(scene, {body, position, like = null, time = 0}) {
  checkPosition(position);
  return withBody(scene, body, (old) => {
    const at = like === null ? null : positionAt(old, like, time);
    const positions = old.positions.map((p) => Array.from(p).concat(position.map((x, axis) => at ? p[3 * like + axis] + x - at[axis] : x)));
    const vertex = old.vertices;
    if (old.shape !== 'points') return {vertices: vertex + 1, positions};
    return {vertices: vertex + 1, positions, indices: Array.from(old.indices).concat(vertex),
            offsets: Array.from(old.offsets).concat(old.indices.length + 1)};
  });
}

/** Adds a triangle over three vertices of a body of polygons. */
export function addTriangle(scene, {body, vertices}) {
  return withBody(scene, body, (old) => {
    if (old.shape === 'points') throw new Error(`body '${old.name}' consists of points and takes no triangles`);
    vertices.forEach((v) => checkVertex(old, v));
    if (new Set(vertices).size !== 3) throw new Error('a triangle needs three different vertices');
    return {indices: Array.from(old.indices).concat(vertices),
            ...(old.offsets ? {offsets: Array.from(old.offsets).concat(old.indices.length + 3)} : {})};
  });
}

/** Adds a triangle of three new vertices around a position. */
export function addFreeTriangle(scene, {body, position, size}) {
  const corners = [[size, 0, 0], [-size / 2, size, 0], [-size / 2, -size, 0]];
  const first = scene.bodies[body].vertices;
  let next = scene;
  for (const corner of corners) next = addVertex(next, {body, position: position.map((x, axis) => x + corner[axis])});
  return addTriangle(next, {body, vertices: [first, first + 1, first + 2]});
}

/** Removes a primitive, and the vertices that only it used. */
export function removePrimitive(scene, {body, primitive}) {
  const old = scene.bodies[body];
  if (primitiveCount(old) < 2) throw new Error(`body '${old.name}' has one primitive only; it cannot be removed`);
  const keep = Array.from({length: primitiveCount(old)}, (_, p) => p).filter((p) => p !== primitive);
  return withBody(scene, body, () => rebuilt(old, keep));
}

/** Removes a vertex and all primitives that use it. */
export function removeVertex(scene, {body, vertex}) {
  const old = scene.bodies[body];
  checkVertex(old, vertex);
  const keep = Array.from({length: primitiveCount(old)}, (_, p) => p).filter((p) => !primitiveVertices(old, p).includes(vertex));
  if (!keep.length) throw new Error(`without vertex ${vertex}, body '${old.name}' would have no primitive`);
  return withBody(scene, body, () => rebuilt(old, keep));
}

/** A body of some of its primitives; vertices that no primitive uses are dropped, the others renumbered in order. */
function rebuilt(old, keep) {
  const used = [...new Set(keep.flatMap((p) => Array.from(primitiveVertices(old, p))))].sort((a, b) => a - b);
  const id = new Map(used.map((v, i) => [v, i]));
  const lists = keep.map((p) => Array.from(primitiveVertices(old, p), (v) => id.get(v)));
  const offsets = [0];
  for (const list of lists) offsets.push(offsets[offsets.length - 1] + list.length);
  return {vertices: used.length, indices: lists.flat(), ...(old.offsets ? {offsets} : {}),
          positions: old.positions.map((p) => used.flatMap((v) => Array.from(p.slice(3 * v, 3 * v + 3))))};
}

/** Adds a body: a copy of the kind `points` or `polygons` with one primitive at a position. */
export function addBody(scene, {shape, position, times, size = 0.5}) {
  const name = `body ${scene.bodies.length + 1}`;
  const keyframes = times.map(() => Array.from(position));
  const body = shape === 'points'
    ? {name, shape, vertices: 1, indices: [0], offsets: [0, 1], times: [...times], positions: keyframes}
    : {name, shape, vertices: 3, indices: [0, 1, 2], times: [...times],
       positions: times.map(() => [[size, 0, 0], [-size / 2, size, 0], [-size / 2, -size, 0]].flatMap((c) => position.map((x, a) => x + c[a])))};
  return {...scene, bodies: [...scene.bodies, body], pairs: undefined};
}

/** Removes a body; one must stay. */
export function removeBody(scene, {body}) {
  if (scene.bodies.length < 2) throw new Error('a scene needs a body');
  return {...scene, bodies: scene.bodies.filter((_, b) => b !== body), pairs: undefined};
}

/** Gives a vertex the same coordinate as another one at one keyframe: an exact tie. */
export function tie(scene, {body, vertex, like, axis, keyframe}) {
  const old = scene.bodies[body];
  checkVertex(old, like);
  const position = [0, 1, 2].map((a) => old.positions[keyframe][3 * (a === axis ? like : vertex) + a]);
  return setKeyframe(scene, {body, vertex, keyframe, position});
}

/** Sets the number of frames per interval between keyframes. */
export function setFrames(scene, {l}) {
  if (!(Number.isInteger(l) && l >= 1 && l <= 1000)) throw new Error(`frames per keyframe interval must be 1 to 1000, not '${l}'`);
  return {...scene, frames: {...scene.frames, l}};
}

/** Renames a scene. */
export const rename = (scene, {name}) => ({...scene, name});

/** The exact value of a coordinate at t on the present path. */
export const coordinate = (scene, body, vertex, axis, t) => valueAt(polyline(scene.bodies[body], vertex, axis), t);
