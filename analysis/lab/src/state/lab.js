import {createEngine} from '../engine/client.js';
import {clip, frameAt, frameTimes} from '../math/plans.js';
import {Tree} from '../math/hierarchy.js';
import {Comparison} from './compare.js';
import {Editing} from './editing.js';
import {difference, nothingLit, touched} from './lit.js';
import {title, when} from '../text/why.js';
import {titleOf} from '../text/words.js';
import {checkScene, checkState} from './permalink.js';
import {createStore, defaultView} from './store.js';
import {sceneById} from './scenes.js';

/** A scene of more nodes, or vertices, is large: it is played on its frames and without the queue. */
const manyNodes = 4000, manyVertices = 3000;
/** History is followed while playing only up to this number of events. */
const manyEvents = 20000;

/**
 * The controller of one lab: drives the engine and writes the store. All calls of the engine go through one chain, so
 * that answers arrive in order; seeks that were overtaken by a newer one are dropped.
 */
export class Lab {
  constructor() {
    this.store = createStore();
    this.comparison = new Comparison(this);
    this.editing = new Editing(this);
    this.engine = null;
    this.chain = Promise.resolve();
    this.wanted = null;  // the newest choice that still loads
    this.pendingSeek = null;
    this.target = null;  // the time of the newest seek that has not arrived
    this.listeners = new Map();
    this.store.subscribe((state) => this.#emit('state', state));
  }

  get state() { return this.store.get(); }

  /** Calls `listener(state)` at every change of the store ('state'), after every load ('load') or answer ('arrive'). */
  on(name, listener) {
    if (!this.listeners.has(name)) this.listeners.set(name, new Set());
    this.listeners.get(name).add(listener);
    return () => this.listeners.get(name).delete(listener);
  }

  #emit(name, value) { for (const listener of this.listeners.get(name) ?? []) listener(value); }

  // ---- Opening

  /** Starts the engine and shows a page state. */
  async open(pageState) {
    await this.enqueue('loading', 'Starting the engine: the C++ of kbvh, as WebAssembly', async () => {
      if (!this.engine) {
        this.engine = await createEngine();
        const meanings = await this.engine.counters?.() ?? [];
        this.store.set({strategies: await this.engine.strategies(), meanings: new Map(meanings.map(({name, meaning}) => [name, meaning]))});
      }
    });
    if (this.state.phase !== 'failed') await this.setState(pageState);
  }

  /** Shows a page state (checked) on the running engine. */
  async setState(pageState) {
    const saved = checkState(pageState);
    const scene = saved.scene ?? sceneById(saved.sceneId);
    this.editing.forget();
    this.savedLevel = saved.view?.level !== undefined;
    this.store.set({view: {...defaultView(), theme: this.state.view.theme, ...saved.view}});
    await this.load({
      scene, sceneId: saved.scene ? null : saved.sceneId, strategy: saved.strategy ?? 'kinetic_aabb', params: saved.params ?? {},
      topology: saved.topology ?? this.defaultTopology(saved.strategy ?? 'kinetic_aabb', scene), precision: saved.precision ?? 'float64',
    }, {time: saved.time, events: saved.events, selection: saved.selection});
    await this.comparison.set(saved.compare ?? null);
  }

  /** The page state that a link or a file keeps. */
  getState() {
    const s = this.state, place = this.#place();
    return {
      format: 'kbvh-lab', version: 1, ...(s.sceneId ? {sceneId: s.sceneId} : {scene: plain(s.scene)}),
      strategy: s.strategy, params: s.params, topology: s.topology, precision: s.precision, ...place,
      selection: {...s.selection, event: s.selection.event?.done === undefined ? null : {done: s.selection.event.done}}, view: s.view,
      ...(s.compare ? {compare: {strategy: s.compare.strategy, params: s.compare.params, topology: s.compare.topology}} : {}),
    };
  }

  /**
   * The tree as in the paper, binary with one primitive a leaf, for scenes small enough to be looked at node by node and
   * strategies that take it; else the strategy's own best settings.
   */
  defaultTopology(strategy, scene) {
    const known = this.state.strategies.find(({id}) => id === strategy);
    const vertices = scene.bodies.reduce((sum, body) => sum + body.vertices, 0);
    return vertices <= 2000 && known?.widths?.includes(2) ? {width: 2, leaf_size: 1} : {};
  }

  /** The scene without requests for pairs within one body, if a strategy cannot answer them. */
  sceneFor(scene, strategy) {
    if (!scene.pairs || this.state.strategies.find(({id}) => id === strategy)?.selfPairs) return scene;
    const pairs = scene.pairs.filter(([a, b]) => a !== b);
    return pairs.length === scene.pairs.length ? scene : {...scene, pairs: pairs.length ? pairs : undefined};
  }

  /** Changes to another strategy at the present time. */
  choose(strategy) {
    return this.load({strategy, params: {}, topology: this.defaultTopology(strategy, this.asked.scene)}, {time: this.state.at?.time});
  }

  /** What was chosen last: what is shown, or what still loads. */
  get asked() {
    const {scene, sceneId, strategy, params, topology, precision} = this.wanted ?? this.state;
    return {scene, sceneId, strategy, params, topology, precision};
  }

  /** Where the clip stands, as a frame (any time) and the number of single events after it. */
  #place() {
    const {at, history, info} = this.state;
    if (!at) return {time: 0, events: 0};
    if (!at.betweenFrames) return {time: at.time, events: 0};
    const next = at.queue?.[0]?.time ?? Infinity;
    let frame = frameAt(this.state.frames, at.time);
    while (frame > 0 && this.state.frames[frame] >= next) --frame;
    const time = this.state.frames[frame] ?? info.begin;
    return {time, events: history.filter((step) => step.event.time > time).length};
  }

  /**
   * Loads a scene with a strategy and goes to `place`. With `quiet` (an edit) the phase does not change meanwhile, so that
   * views stay as they are until the new state has arrived.
   */
  async load(choice, place = {}, {quiet = false} = {}) {
    const s = this.state;
    // A choice that is made while another one loads adds to it.
    const wanted = this.wanted = {...this.asked, ...choice};
    const {scene: given, sceneId, strategy, params, topology, precision} = wanted;
    this.pause();
    const loaded = await this.enqueue(quiet ? null : 'loading', `Loading ‘${given?.name}’: ${titleOf(s.strategies, strategy)}`, async () => {
      const scene = checkScene(given);
      const info = await this.engine.load({scene: this.sceneFor(scene, strategy), strategy, params, topology, precision});
      const range = clip(scene);
      const begin = info.begin ?? range.begin, end = info.end ?? range.end;
      const time = Math.min(end, Math.max(begin, place.time ?? begin));
      const first = await this.engine.frame(time, this.#want());
      this.store.set({
        scene, sceneId, strategy, params, topology, precision, info: {...info, begin, end},
        frames: info.frames ? Array.from(info.frames) : frameTimes(info.keyframes.filter((t) => t >= begin && t <= end), Math.max(1, scene.frames?.l ?? 10)),
        at: null, trees: [], history: [], lit: nothingLit, step: null, work: null, stop: {}, error: '',
        selection: this.#checkedSelection(place.selection ?? (choice.scene ? null : s.selection), info),
      });
      this.#arrive(first);
      if (choice.scene && !quiet) this.#chooseLevel();
      for (let k = 0; k < (place.events ?? 0); ++k) {
        const {step, state} = await this.engine.event(end, this.#want());
        if (!step) break;
        this.#arrive(state, step);
      }
      await this.#followHistory();
      if (place.selection) this.store.set({selection: this.#checkedSelection(place.selection, info)});
    });
    if (this.wanted === wanted) this.wanted = null;
    if (!loaded) return false;
    this.#emit('load', this.state);
    await this.comparison.reload({quiet});
    return true;
  }

  #checkedSelection(selection, info) {
    const chosen = {body: 0, node: 0, side: 1, vertex: null, event: null, ...selection};
    if (chosen.body >= info.bodies.length) Object.assign(chosen, {body: 0, node: 0, vertex: null});
    if (chosen.vertex !== null && chosen.vertex >= info.bodies[chosen.body].vertices) chosen.vertex = null;
    return {...chosen, event: chosen.event?.done < this.state.history.length ? {done: chosen.event.done} : null};
  }

  // ---- Time

  /** Shows time t. While one seek runs, only the newest other one waits. */
  seek(t) {
    const {info} = this.state;
    if (!info) return Promise.resolve();
    const time = Math.min(info.end, Math.max(info.begin, t));
    const first = this.pendingSeek === null;
    this.pendingSeek = time;
    this.target = time;
    if (!first) return this.chain;
    return this.enqueue(null, '', async () => {
      const target = this.pendingSeek;
      this.pendingSeek = null;
      this.#arrive(await this.engine.frame(target, this.#want()));
      if (this.target === target) this.target = null;
      if (this.state.phase !== 'playing') await this.#followHistory();
      await this.comparison.frame(target);
    });
  }

  /** Moves by whole frames of the scene: to the next one, or to the one before. */
  frame(direction) {
    this.pause();
    const {frames, at} = this.state;
    if (!at) return Promise.resolve();
    const time = this.target ?? at.time, between = this.target === null && at.betweenFrames;
    let index = frameAt(frames, time);
    if (direction > 0) ++index;
    else if (frames[index] === time && !between) --index;
    return this.seek(frames[Math.max(0, Math.min(frames.length - 1, index))]);
  }

  /** Performs one event, or takes back the last one. */
  event(direction) {
    this.pause();
    return this.enqueue(null, '', async () => {
      const {info, at, history} = this.state;
      if (!info.hasEvents) { this.say('This strategy has no events: it works frame by frame.'); return; }
      if (direction > 0) {
        const {step, state} = await this.engine.event(info.end, this.#want());
        this.#arrive(state, step);
        this.say(step ? `Event ${step.index + 1} at ${when(step.event).text}: ${title(step.event, info.bodies)}.` : 'No further event in this clip.');
      } else {
        if (!at.eventsDone) { this.say('No event before this time.'); return; }
        const undone = history[at.eventsDone - 1] ?? null;
        this.#arrive(await this.engine.back(this.#want()));
        this.say(undone ? `Took back event ${undone.index + 1}.` : 'Took back one event.');
      }
      await this.#followHistory();
      await this.comparison.frame(this.state.at.time);
    });
  }

  /** Shows the state just after a performed event. */
  async goToEvent(index) {
    this.pause();
    await this.enqueue(null, '', async () => {
      const {history, info, frames} = this.state;
      const step = history[index];
      if (!step) return;
      let frame = frameAt(frames, step.event.time);
      if (frames[frame] >= step.event.time && frame > 0) --frame;
      const state = await this.engine.frame(frames[frame], this.#want());
      this.#arrive(state);
      for (let done = state.eventsDone; done <= index; ++done) {
        const answer = await this.engine.event(info.end, this.#want());
        if (!answer.step) break;
        this.#arrive(answer.state, answer.step);
      }
      await this.#followHistory();
      await this.comparison.frame(this.state.at.time);
    });
  }

  /** Performs events until one matches `stop`: {node, body}, {vertex, body} or {pair: true}. */
  runTo(stop) {
    this.pause();
    return this.enqueue('working', 'Running to the break point', async () => {
      const {info} = this.state;
      if (!info.hasEvents) { this.say('This strategy has no events to stop at.'); return; }
      const {stopped, begun, state} = await this.engine.run(info.end, stop, this.#want());
      this.#arrive(state, stopped && !stop.pair ? stopped : null);
      await this.#followHistory();
      await this.comparison.frame(this.state.at.time);
      const where = stop.pair ? 'a pair begins' : stop.node !== undefined ? `an event of node ${stop.node}` : `an event of vertex ${stop.vertex}`;
      this.say(stopped || begun ? `Stopped: ${where}.` : `The clip ended before ${where}.`);
      if (stopped) this.select({event: {done: stopped.index}});
    });
  }

  play() {
    if (this.state.phase !== 'ready' || !this.state.info) return;
    const {info, at} = this.state;
    this.store.set({phase: 'playing'});
    const natural = Math.max(1e-9, (info.end - info.begin) / 8);  // the clip in eight seconds at speed 1
    let time = at.time >= info.end ? info.begin : at.time, last = performance.now();
    const tick = async (now) => {
      if (this.state.phase !== 'playing') return;
      time = Math.min(info.end, time + Math.min(0.2, (now - last) / 1000) * this.state.speed * natural);
      last = now;
      await this.seek(this.#large() ? this.#frameBefore(time) : time);
      if (time >= info.end) this.pause();
      else this.playTimer = requestAnimationFrame(tick);
    };
    this.playTimer = requestAnimationFrame(tick);
  }

  /** Large scenes are played on their frames: the engine keeps those, a time between them costs a copy. */
  #frameBefore(time) { const {frames} = this.state; return frames[frameAt(frames, time)]; }

  pause() {
    if (this.state.phase !== 'playing') return;
    cancelAnimationFrame(this.playTimer);
    this.store.set({phase: 'ready'});
    this.enqueue(null, '', () => this.#refresh());
  }

  toggle() { if (this.state.phase === 'playing') this.pause(); else this.play(); }

  // ---- Choosing

  /** Merges into the selection; ids of another body reset node and vertex. */
  select(patch) {
    const selection = {...this.state.selection, ...patch};
    if (patch.body !== undefined && patch.body !== this.state.selection.body) {
      if (patch.node === undefined) selection.node = 0;
      if (patch.vertex === undefined) selection.vertex = null;
    }
    this.store.set({selection});
  }

  view(patch) { this.store.set({view: {...this.state.view, ...patch}}); }

  say(notice) { this.store.set({notice}); }

  // ---- The engine's answers

  /** What to ask of the engine: while a large scene plays, no queue, which is made of objects. */
  #want() {
    const light = this.state.phase === 'playing' && this.#large();
    return {positions: true, nodes: true, flat: true, pairs: true, queue: !light, counters: true, queueLimit: 4000, pairsLimit: 20000};
  }

  /** Whether times between the frames of the scene would cost too much while playing. */
  #large() { return this.#nodes() > manyNodes || this.state.scene.bodies.reduce((sum, body) => sum + body.vertices, 0) > manyVertices; }

  #nodes() { return this.state.trees.reduce((sum, tree) => sum + (tree?.size ?? 0), 0); }

  #arrive(at, step = null) {
    const old = this.state;
    const flats = at.hierarchies?.map((hierarchy) => hierarchy?.flat ?? null);
    const trees = flats ? flats.map((flat, b) => !flat ? null
        : old.trees[b] ? old.trees[b].next(flat, old.info.bodies[b]) : new Tree(flat, b, old.info.bodies[b])) : old.trees;
    const lit = step ? touched([step], trees) : old.at && flats ? difference(old.trees, trees) : nothingLit;
    const selection = this.#selectionIn(trees, old.selection);
    this.store.set({
      at: {...at, queue: at.queue ?? old.at?.queue ?? []}, trees, lit, step, notice: '',
      ...(selection !== old.selection ? {selection} : {}),
      ...(old.history.length > at.eventsDone ? {history: old.history.slice(0, at.eventsDone)} : {}),
      ...(step && step.index === old.history.length ? {history: [...old.history, step]} : {}),
    });
    if (step) this.#followStep(step);
    this.#emit('arrive', this.state);
  }

  /** Chooses an event that was just performed; with `follow`, its node and side, too. */
  #followStep({index, event}) {
    const place = this.state.view.follow ? {body: event.body, node: event.node, ...(event.kind === 'bound' && event.side < 6 ? {side: event.side} : {})} : {};
    this.select({...place, event: {done: index}});
  }

  /** With many nodes all levels hide each other: shows one of the upper levels, unless a saved view says otherwise. */
  #chooseLevel() {
    if (this.savedLevel) { this.savedLevel = false; return; }
    const nodes = this.#nodes(), levels = Math.max(1, ...this.state.trees.map((tree) => tree?.levels ?? 1));
    this.view({level: nodes <= 64 ? 'all' : String(Math.min(levels - 1, 3))});
  }

  /** Keeps the selected node inside a tree that became smaller. */
  #selectionIn(trees, selection) {
    const tree = trees[selection.body];
    return tree && selection.node >= tree.size ? {...selection, node: 0} : selection;
  }

  /** Fetches the events that the history lacks; after a move in time, lights what changed since the frame before. */
  async #followHistory() {
    const {info, at, history} = this.state;
    if (!info?.hasEvents || at.eventsDone - history.length > manyEvents) return;
    if (at.eventsDone > history.length) {
      const more = await this.engine.history(history.length);
      this.store.set({history: [...history, ...more.filter((step) => step.index >= history.length)]});
    }
    if (!this.state.step) this.#lightFrame();
  }

  #lightFrame() {
    const {at, frames, history, trees} = this.state;
    const frame = frameAt(frames, at.time), from = frames[frame] === at.time ? frames[frame - 1] ?? -Infinity : frames[frame];
    let first = history.length;
    while (first > 0 && history[first - 1].event.time > from) --first;
    this.store.set({lit: touched(history.slice(first), trees)});
  }

  async #refresh() {
    const {at} = this.state;
    if (!at) return;
    if (!at.betweenFrames) this.#arrive(await this.engine.frame(at.time, this.#want()));
    await this.#followHistory();
  }

  /**
   * Runs a job after all others. With a phase, the store says so and shows `task` meanwhile. An error is shown; a failed
   * load fails the lab, any other error leaves it as it was. Resolves to whether the job succeeded.
   */
  enqueue(phase, task, job) {
    this.chain = this.chain.then(async () => {
      if (phase) this.store.set({phase, task});
      try {
        await job();
        if (phase) this.store.set({phase: 'ready', task: ''});
        return true;
      } catch (error) {
        console.error(error);
        const canGoOn = this.state.at !== null;
        this.store.set({phase: canGoOn ? 'ready' : 'failed', task: '', error: error.message ?? String(error)});
        return false;
      }
    });
    return this.chain;
  }

  close() {
    this.pause();
    this.comparison.close();
    this.engine?.close();
  }
}

/** A scene without typed arrays, for JSON. */
function plain(scene) {
  return {...scene, bodies: scene.bodies.map((body) => ({
    ...body, indices: Array.from(body.indices), ...(body.offsets ? {offsets: Array.from(body.offsets)} : {}),
    times: Array.from(body.times), positions: body.positions.map((p) => Array.from(p))}))};
}
