/**
 * The one store of a lab: a plain object that views read and that only `Lab` writes. Views subscribe; each change calls
 * them once, at the next animation frame at the latest.
 */

/** Allowed phases and where each may go. A lab is in exactly one of them. */
export const phases = {
  empty: ['loading'],
  loading: ['ready', 'failed'],
  ready: ['loading', 'working', 'playing', 'failed'],
  working: ['ready', 'loading', 'failed'],   // the engine is busy with something that the user waits for
  playing: ['ready', 'loading', 'failed'],
  failed: ['loading'],
};

/** The state of a new lab. See the fields' comments for their meaning. */
export function initialState() {
  return {
    phase: 'empty',
    task: '',                // what is being loaded or computed, in words
    error: '',               // the last error, in words
    choice: null,            // a question to the user: {text, options: [{title, act}]}
    notice: '',              // what the last action did, for the live region
    strategies: [],          // from the engine
    meanings: new Map(),     // of counters, by name
    study: [],               // scenes of a study next to the page: {name, framesPerSecond, files}
    scene: null, sceneId: null,
    strategy: 'kinetic_aabb', params: {}, topology: {}, precision: 'float64',
    info: null,              // what load() returned
    frames: [],              // times of the scene's frames, seconds
    at: null,                // the engine's State
    trees: [],               // Tree per body, or null
    lit: {sides: [], begun: null, ended: null},  // changes against the state before: bit mask of sides per node, per body
    step: null,              // the event performed last, if the last move was one event
    history: [],             // Steps since the begin
    selection: {body: 0, node: 0, side: 1, vertex: null, event: null},
    view: defaultView(),
    stop: {},                // break point: {node, body} | {body, vertex} | {pair: true}
    speed: 1,                // seconds of the clip per second of the wall clock, times the clip's natural speed
    compare: null,           // {strategy, params, topology, info, at, trees, lit, step} of the second engine
    work: null,              // {metric, series: [{strategy, frames, done, counters: {name: Float64Array}}]}
    undo: 0, redo: 0,        // how many edits can be undone and redone
  };
}

/** What is shown, and how. Kept in links. */
export function defaultView() {
  return {boxes: 'level', level: 'all', up: 'z', paths: true, labels: true, panel: 'why', theme: 'auto', follow: true, edit: false, drag: 'keyframe', zoom: null};
}

/** Creates a store. `set(patch)` merges and notifies; `subscribe(fn)` returns the function that ends it. */
export function createStore(state = initialState()) {
  const listeners = new Set();
  let scheduled = false;
  const notify = () => {
    scheduled = false;
    for (const listener of [...listeners]) listener(state);
  };
  return {
    get: () => state,
    set(patch) {
      if (patch.phase && patch.phase !== state.phase && !phases[state.phase].includes(patch.phase))
        throw new Error(`the lab cannot go from '${state.phase}' to '${patch.phase}'`);
      state = {...state, ...patch};
      if (!scheduled) {
        scheduled = true;
        queueMicrotask(notify);
      }
    },
    subscribe(listener) {
      listeners.add(listener);
      return () => listeners.delete(listener);
    },
  };
}
