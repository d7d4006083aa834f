// The engine's functions in the thread where the module runs: in the worker, or in the tests.

import { steps } from './decode.js';
import { Timeline } from './timeline.js';

export class Host {
  #newModule;
  #timeline = null;
  #strategies = null;

  /** `newModule` makes a fresh instance of the compiled engine (module.js). */
  constructor(newModule) {
    this.#newModule = newModule;
  }

  async strategies() {
    this.#strategies ??= (await this.#newModule()).call('strategies');
    return this.#strategies;
  }
  async counters() {
    return (await this.#newModule()).call('counters');
  }
  async load(config) {
    const timeline = new Timeline(await this.#newModule(), config);
    this.#timeline = timeline; // the old one stays if the new one fails
    return timeline.loaded;
  }
  async readScene(files, options = {}) {
    return sceneOf(await this.#newModule(), files, options);
  }
  frame(t, want) {
    this.#line.frame(t);
    return this.#line.state(want);
  }
  state(want) {
    return this.#line.state(want);
  }
  time() {
    return this.#line.time();
  }
  event(until, want) {
    const step = this.#line.event(until);
    return { step, state: this.#line.state(want) };
  }
  back(want) {
    this.#line.back();
    return this.#line.state(want);
  }
  history(from) {
    return this.#line.history(from);
  }
  run(until, stopAt, want) {
    if (stopAt?.pair) {
      const begun = this.#line.runToPair(until);
      return { stopped: null, begun, state: this.#line.state(want) };
    }
    const stopped = this.#line.runEvents(until, (packed) => matches(steps(packed)[0], stopAt ?? {}));
    return { stopped, begun: false, state: this.#line.state(want) };
  }
  changePlans(plans, want) {
    this.#line.change({ plans });
    return this.#line.state(want);
  }
  edit(edit, want) {
    this.#line.change({ edit });
    return this.#line.state(want);
  }
  checkpoint() {
    return this.#line.checkpoint();
  }

  get #line() {
    if (this.#timeline === null) throw new Error('the engine has no scene: call load first');
    return this.#timeline;
  }
}

/** Whether an event concerns the body, the node and the vertex that are named. */
function matches({ event, touched }, { body, node, vertex }) {
  const isNode = (b, n) => (body === undefined || b === body) && (node === undefined || n === node);
  const boxes = event.kind === 'boxes_meet' || event.kind === 'boxes_separate' || event.kind === 'review';
  if (vertex === undefined)
    return isNode(event.body, event.node) || (boxes && isNode(event.otherBody, event.otherNode)) ||
      touched.some((change) => isNode(change.body, change.node));
  return (isNode(event.body, event.node) && (event.winner === vertex || event.loser === vertex)) ||
    touched.some((change) => isNode(change.body, change.node) && (change.oldVertex === vertex || change.newVertex === vertex));
}

/** Reads mesh files, given as {name, bytes}, with the program's own readers, as a scene of the format kbvh-scene. */
function sceneOf(module, files, { clip = '', framesPerSecond = 0, l = 10, selfPairs = false }) {
  const ending = (name) => name.slice(name.lastIndexOf('.') + 1).toLowerCase();
  const known = new Set();
  for (const { name, bytes } of files) {
    if (typeof name !== 'string' || name === '' || name.split('/').includes('..')) throw new Error(`"${name}" is not the name of a file`);
    if (known.has(name)) throw new Error(`two files have the name ${name}`);
    known.add(name);
    module.writeFile(`/files/${name}`, new Uint8Array(bytes));
  }
  const meshes = files.filter(({ name }) => ['obj', 'ply', 'gltf', 'glb'].includes(ending(name)));
  const caches = files.filter(({ name }) => ending(name) === 'pc2');
  if (meshes.length === 0)
    throw new Error(`there is no mesh among ${files.map(({ name }) => name).join(', ') || 'no files'}: the lab reads .obj (with .pc2), .ply, .gltf and .glb`);
  const stem = (name) => name.slice(0, name.lastIndexOf('.'));
  const bodies = meshes.map(({ name }) => {
    const cache = caches.find((file) => stem(file.name) === stem(name)) ?? (meshes.length === 1 ? caches[0] : undefined);
    const mesh = module.call('read', { mesh: `/files/${name}`, motion: cache === undefined ? '' : `/files/${cache.name}`, clip, framesPerSecond });
    return { ...mesh, name: mesh.name || stem(name) };
  });
  return {
    format: 'kbvh-scene', version: 1, name: stem(meshes[0].name), dimension: 3, bodies, frames: { l },
    ...(selfPairs ? { pairs: bodies.flatMap((_, a) => bodies.slice(a).map((__, b) => [a, a + b])) } : {}),
  };
}
