/** Page states in links and files: JSON, deflated, in base64 for URLs. */

/** The text after `#s=` for a page state. */
export async function encodeState(state) {
  const bytes = await pipe(new TextEncoder().encode(JSON.stringify(state)), new CompressionStream('deflate-raw'));
  let text = '';
  for (let i = 0; i < bytes.length; i += 8192) text += String.fromCharCode(...bytes.subarray(i, i + 8192));
  return btoa(text).replaceAll('+', '-').replaceAll('/', '_').replaceAll('=', '');
}

/** The address of a page of the lab with a state: the whole lab, or with `embed` a compact one. */
export const addressOf = (page, text, {embed = false} = {}) => `${new URL(page, location.href).href.replace(/#.*$/, '')}#${embed ? 'embed' : 's'}=${text}`;

/** The element that shows a state inside another page. */
export const embedCode = (address, name) =>
  `<iframe src="${address}" title="kbvh lab: ${name.replaceAll('&', '&amp;').replaceAll('"', '&quot;')}" width="100%" height="720" loading="lazy"></iframe>`;

/** Reads what `encodeState` wrote. Throws an Error that says what is wrong. */
export async function decodeState(text) {
  let json;
  try {
    const bytes = Uint8Array.from(atob(text.replaceAll('-', '+').replaceAll('_', '/')), (c) => c.charCodeAt(0));
    json = new TextDecoder().decode(await pipe(bytes, new DecompressionStream('deflate-raw')));
  } catch {
    throw new Error('this link is damaged: its text after #s= could not be unpacked. Was it cut off?');
  }
  return checkState(JSON.parse(json));
}

/** Returns a page state or throws an Error that names what is missing. */
export function checkState(state) {
  if (state?.format === 'kbvh-scene') return {format: 'kbvh-lab', version: 1, scene: checkScene(state)};
  if (state?.format !== 'kbvh-lab') throw new Error(`not a state of the lab: format is '${state?.format}', expected 'kbvh-lab' or 'kbvh-scene'`);
  if (state.version !== 1) throw new Error(`a lab state of version ${state.version}; this page reads version 1`);
  if (state.scene) checkScene(state.scene);
  else if (typeof state.sceneId !== 'string') throw new Error("a lab state needs 'scene' or 'sceneId'");
  return state;
}

/**
 * Returns a scene whose bodies have a list of keyframes (one array of positions may hold them all), or throws an Error
 * that names the wrong field.
 */
export function checkScene(given) {
  const scene = given?.bodies?.some?.((body) => ArrayBuffer.isView(body.positions)) ? {...given, bodies: given.bodies.map(cut)} : given;
  const fail = (what) => { throw new Error(`scene '${scene?.name ?? '?'}': ${what}`); };
  if (scene?.format !== 'kbvh-scene') fail(`format is '${scene?.format}', expected 'kbvh-scene'`);
  if (!Array.isArray(scene.bodies) || !scene.bodies.length) fail('it has no bodies');
  scene.bodies.forEach((body, b) => {
    const where = `body ${b} ('${body.name}')`;
    if (!(body?.vertices > 0)) fail(`${where} has no vertices`);
    if (!body.times?.length || body.times.length !== body.positions?.length) fail(`${where} has ${body.times?.length} times and ${body.positions?.length} keyframes`);
    for (let k = 1; k < body.times.length; ++k) if (!(body.times[k] > body.times[k - 1])) fail(`${where}: keyframe times must increase, but ${body.times[k]} follows ${body.times[k - 1]}`);
    body.positions.forEach((p, k) => {
      if (p.length !== 3 * body.vertices) fail(`${where}, keyframe ${k}: ${p.length} numbers for ${body.vertices} vertices`);
      for (let i = 0; i < p.length; ++i) if (!Number.isFinite(p[i])) fail(`${where}, keyframe ${k}, vertex ${Math.floor(i / 3)}: ${p[i]} is not a finite number`);
    });
    for (const v of body.indices ?? (body.shape === 'points' ? [] : fail(`${where} has no indices`))) if (!(v >= 0 && v < body.vertices)) fail(`${where}: index ${v} with ${body.vertices} vertices`);
  });
  return scene;
}

/** Cuts one array of positions into keyframes. */
function cut(body) {
  if (!ArrayBuffer.isView(body.positions)) return body;
  const size = 3 * body.vertices;
  return {...body, times: Array.from(body.times), positions: Array.from(body.times, (_, k) => body.positions.subarray(k * size, (k + 1) * size))};
}

async function pipe(bytes, transform) {
  return new Uint8Array(await new Response(new Blob([bytes]).stream().pipeThrough(transform)).arrayBuffer());
}
