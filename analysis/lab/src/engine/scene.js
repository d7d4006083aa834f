// Scenes of the format kbvh-scene: what links and files keep (README.md describes it).

const SHAPES = ['points', 'polygons', 'control_nets'];

function refuse(what) {
  throw new Error(`scene: ${what}`);
}
const isList = (value) => Array.isArray(value) || ArrayBuffer.isView(value);
const shown = (value) => {
  const text = JSON.stringify(value) ?? String(value);
  return text.length > 40 ? `${text.slice(0, 37)}...` : text;
};

function wholeNumbers(list, least, below, place) {
  if (!isList(list)) refuse(`${place} is ${shown(list)}, not a list of numbers`);
  const out = new Uint32Array(list.length);
  for (let i = 0; i < list.length; ++i) {
    if (!Number.isInteger(list[i]) || list[i] < least || list[i] >= below)
      refuse(`${place}[${i}] is ${shown(list[i])}, not a whole number from ${least} to ${below - 1}`);
    out[i] = list[i];
  }
  return out;
}
function numbers(list, place) {
  if (!isList(list)) refuse(`${place} is ${shown(list)}, not a list of numbers`);
  for (let i = 0; i < list.length; ++i)
    if (!Number.isFinite(list[i])) refuse(`${place}[${i}] is ${shown(list[i])}, not a finite number`);
  return Float64Array.from(list);
}

function checkedBody(body, b, dimension) {
  const place = `bodies[${b}]`;
  if (body === null || typeof body !== 'object') refuse(`${place} is ${shown(body)}, not an object`);
  const name = body.name ?? `body ${b}`;
  if (typeof name !== 'string') refuse(`${place}.name is ${shown(name)}, not a text`);
  const shape = body.shape ?? 'polygons';
  if (!SHAPES.includes(shape)) refuse(`${place}.shape is ${shown(shape)}, not one of ${SHAPES.join(', ')}`);
  const { vertices } = body;
  if (!Number.isInteger(vertices) || vertices < 1)
    refuse(`${place}.vertices is ${shown(vertices)}, not a number of at least 1`);

  let given = body.indices;
  let ends = body.offsets ?? null;
  if (given === undefined && shape === 'points') given = Uint32Array.from({ length: vertices }, (_, i) => i);
  const indices = wholeNumbers(given, 0, vertices, `${place}.indices`);
  if (ends === null && shape === 'points') ends = Uint32Array.from({ length: indices.length + 1 }, (_, i) => i);
  let offsets = null;
  if (ends !== null) {
    offsets = wholeNumbers(ends, 0, indices.length + 1, `${place}.offsets`);
    if (offsets[0] !== 0 || offsets[offsets.length - 1] !== indices.length)
      refuse(`${place}.offsets run from ${offsets[0]} to ${offsets[offsets.length - 1]} instead of 0 to ${indices.length}`);
    for (let p = 1; p < offsets.length; ++p)
      if (offsets[p] <= offsets[p - 1]) refuse(`${place}.offsets[${p}] is ${offsets[p]}, not above ${offsets[p - 1]}`);
  } else if (indices.length % 3 !== 0) {
    refuse(`${place}.indices has ${indices.length} numbers, which do not make triangles; other primitives need offsets`);
  }

  const times = numbers(body.times, `${place}.times`);
  if (times.length === 0) refuse(`${place}.times is empty`);
  for (let k = 1; k < times.length; ++k)
    if (!(times[k] > times[k - 1])) refuse(`${place}.times[${k}] is ${times[k]}, not later than ${times[k - 1]}`);
  let positions;
  if (ArrayBuffer.isView(body.positions)) {
    positions = numbers(body.positions, `${place}.positions`);
    if (positions.length !== 3 * vertices * times.length)
      refuse(`${place}.positions has ${positions.length} numbers, not ${3 * vertices * times.length} for ${times.length} keyframes of ${vertices} vertices`);
  } else {
    if (!Array.isArray(body.positions) || body.positions.length !== times.length)
      refuse(`${place}.positions has ${body.positions?.length ?? 'no'} keyframes for ${times.length} times`);
    positions = new Float64Array(3 * vertices * times.length);
    body.positions.forEach((frame, k) => {
      const keyframe = numbers(frame, `${place}.positions[${k}]`);
      if (keyframe.length !== 3 * vertices)
        refuse(`${place}.positions[${k}] has ${keyframe.length} numbers, not ${3 * vertices} for ${vertices} vertices`);
      positions.set(keyframe, 3 * vertices * k);
    });
  }
  if (dimension === 2) {
    const flat = positions.findIndex((x, i) => i % 3 === 2 && x !== 0);
    if (flat !== -1)
      refuse(`${place}: vertex ${Math.floor(flat / 3) % vertices} has z = ${positions[flat]} in a scene of two dimensions`);
  }
  return { name, shape, vertices, indices, offsets, times, positions };
}

/** Checks a scene; throws an Error with the place and the value, or returns its bodies as typed arrays. */
export function checkedScene(scene) {
  if (scene === null || typeof scene !== 'object') refuse(`${shown(scene)} is not an object`);
  if (scene.format !== 'kbvh-scene') refuse(`format is ${shown(scene.format)}, not "kbvh-scene"`);
  if (scene.version !== 1) refuse(`version is ${shown(scene.version)}; this lab reads version 1`);
  const dimension = scene.dimension ?? 3;
  if (dimension !== 2 && dimension !== 3) refuse(`dimension is ${shown(dimension)}, not 2 or 3`);
  if (!Array.isArray(scene.bodies) || scene.bodies.length === 0) refuse('it has no bodies');
  const bodies = scene.bodies.map((body, b) => checkedBody(body, b, dimension));
  let pairs = [];
  if (scene.pairs !== undefined) {
    if (!Array.isArray(scene.pairs)) refuse(`pairs is ${shown(scene.pairs)}, not a list`);
    pairs = scene.pairs.map((pair, i) => {
      if (!isList(pair) || pair.length !== 2) refuse(`pairs[${i}] is ${shown(pair)}, not two bodies`);
      return [...wholeNumbers(pair, 0, bodies.length, `pairs[${i}]`)];
    });
  }
  const l = scene.frames?.l ?? 10;
  if (!Number.isInteger(l) || l < 1 || l > 10000) refuse(`frames.l is ${shown(l)}, not a whole number from 1 to 10000`);
  return { name: scene.name ?? 'scene', dimension, bodies, pairs, l };
}

/** The times of all keyframes of moving bodies, as the program overlays them. */
export function overlaidKeyframes(bodies) {
  const times = new Set();
  for (const body of bodies) if (body.times.length > 1) for (const t of body.times) times.add(t);
  return times.size === 0 ? [bodies[0].times[0]] : [...times].sort((a, b) => a - b);
}

/** The times of the frames, l for each keyframe interval, with the program's own rounding. */
export function frameTimes(keyframes, l) {
  const frames = [];
  for (let k = 0; k + 1 < keyframes.length; ++k)
    for (let j = 0; j < l; ++j) {
      const t = keyframes[k] + ((keyframes[k + 1] - keyframes[k]) * j) / l;
      if (t < keyframes[k + 1] && (frames.length === 0 || frames[frames.length - 1] < t)) frames.push(t);
    }
  frames.push(keyframes[keyframes.length - 1]);
  return frames;
}
