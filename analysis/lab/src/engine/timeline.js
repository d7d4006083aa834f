// A world and its time line: every state is a function of the scene, the edits and the place on the line, however
// the line was walked. Going back restores a copy of the module's memory and replays from there.
//
// The line has stops: the frames, and the times of edits. The canonical way to a stop is to advance and query at every
// stop before it. A place is a stop, a time between this stop and the next one, or some single events after either.

import { difference, hashOf, merged } from './packed.js';
import { checkedScene, frameTimes, overlaidKeyframes } from './scene.js';

const SNAPSHOT_AFTER = 25; // milliseconds of replay
const SNAPSHOT_PER_MIB = 2; // and as many for each MiB to copy
const SNAPSHOT_BYTES = 192 << 20; // of all of them
const NOTHING = { positions: false, nodes: false, pairs: false, queue: false, counters: false };

export class Timeline {
  #module;
  #bodies; // number
  #hasEvents = false;
  #end = 0;
  #stops = []; // {t, frame: number or null, edits: [], log, events: performed up to here, cost: milliseconds up to here}
  #stop = 0;
  #time = null; // between two stops, or null
  #steps = 0; // single events after that
  #logs = []; // of the events since the stop
  #eventsSinceStop = 0;
  #snapshots = new Map(); // stop -> memory
  #seconds = 0;
  #snapshotBytes;
  #shownPairs = new Uint32Array(0);

  /** Loads a scene into a fresh module and starts a strategy. */
  constructor(module, { scene, strategy, params = {}, topology = {}, precision = 'float64', t0, snapshotBytes = SNAPSHOT_BYTES }) {
    const { bodies, pairs, l } = checkedScene(scene);
    if (precision !== 'float64' && precision !== 'float32')
      throw new Error(`the precision is "${precision}", not float64 or float32`);
    const texts = (map) => Object.fromEntries(Object.entries(map).map(([key, value]) => [key, String(value)]));
    const keyframes = overlaidKeyframes(bodies);
    this.#module = module;
    this.#snapshotBytes = snapshotBytes;
    this.#bodies = bodies.length;
    this.#end = keyframes[keyframes.length - 1];
    const begin = t0 ?? keyframes[0];
    if (!Number.isFinite(begin)) throw new Error(`t0 is ${begin}, not a time`);

    module.call('open', { precision });
    for (const body of bodies)
      module.withArrays([body.indices, body.offsets, body.times, body.positions], ([indices, offsets, times, positions]) =>
        module.call('body', { name: body.name, shape: body.shape, indices, offsets, times, positions }));
    const started = performance.now();
    this.#hasEvents = module.call('start', { strategy, params: texts(params), topology: texts(topology), pairs, t: begin }).hasEvents;
    this.#seconds = (performance.now() - started) / 1000;

    const frames = frameTimes(keyframes, l).filter((t) => t > begin);
    this.#stops = [begin, ...frames].map((t, frame) => ({ t, frame, edits: [], log: null, events: 0, cost: 0 }));
    this.#snapshot();
    this.loaded = {
      bodies: bodies.map(({ name, vertices, indices, offsets, shape }) =>
        ({ name, vertices, primitives: offsets === null ? indices.length / 3 : offsets.length - 1, indices, offsets, shape })),
      begin,
      end: Math.max(begin, this.#end),
      keyframes,
      frames: Float64Array.from(this.#stops, (stop) => stop.t),
      hasEvents: this.#hasEvents,
    };
  }

  /** Goes to time t, as frames do: all events up to t are done, and the pairs are those at t. */
  frame(t) {
    if (!(t >= this.#stops[0].t)) throw new Error(`there is no frame at t = ${t} before the start at t = ${this.#stops[0].t}`);
    if (!Number.isFinite(t)) throw new Error(`there is no frame at t = ${t}`);
    let stop = this.#stops.length - 1;
    while (this.#stops[stop].t > t) --stop;
    this.#go(stop, t === this.#stops[stop].t ? null : t, 0);
  }

  /** Performs the next event due by `until` and returns it, packed; null if there is none. */
  event(until) {
    if (!this.#hasEvents) throw new Error('this strategy has no events to step through');
    if (!Number.isFinite(until)) throw new Error(`there are no events until t = ${until}`);
    for (;;) {
      const next = this.#module.call('next');
      const last = this.#stop + 1 === this.#stops.length;
      const limit = last ? Math.max(until, this.#now) : this.#stops[this.#stop + 1].t;
      if (next !== null && next <= until && next <= limit + 1e-9 * Math.max(1, Math.abs(limit))) {
        this.#leaveStop();
        if (this.#step(limit)) {
          ++this.#steps;
          return this.#packed(this.#logs[this.#logs.length - 1], this.eventsDone - 1);
        }
      }
      if (last || limit > until) return null;
      this.#go(this.#stop + 1, null, 0);
    }
  }

  /** Goes to the state right before the last event that was performed; to the start if there was none. */
  back() {
    if (this.#steps > 0) return this.#go(this.#stop, this.#time, this.#steps - 1);
    if (this.#eventsSinceStop > 0) return this.#go(this.#stop, null, this.#eventsSinceStop - 1);
    for (let stop = this.#stop; stop > 0; --stop) {
      const performed = this.#stops[stop].events - this.#stops[stop - 1].events;
      if (performed > 0) return this.#go(stop - 1, null, performed - 1);
    }
    return this.#go(0, null, 0);
  }

  /** Continues, event by event, to the first one that `matches`; returns it, packed, or stops at `until` and returns null. */
  runEvents(until, matches) {
    for (;;) {
      const step = this.event(until);
      if (step === null) {
        if (until > this.#now) this.frame(until);
        return null;
      }
      if (matches(step)) return step;
    }
  }

  /** Continues, frame by frame, until a pair begins; returns whether one did. */
  runToPair(until) {
    let before = this.#pairs();
    for (;;) {
      const stop = this.#stops[this.#stop + 1];
      if (stop === undefined || stop.t > until) {
        if (until > this.#now) this.frame(until);
        return difference(this.#pairs(), before).length > 0;
      }
      this.#go(this.#stop + 1, null, 0);
      const now = this.#pairs();
      if (difference(now, before).length > 0) return true;
      before = now;
    }
  }

  /** All events performed since the start, from the given one on, as a list of packed logs. */
  history(from = 0) {
    const logs = [];
    let first = 0;
    const add = (log) => {
      const count = log === null ? 0 : log.touchedEnds.length;
      if (first + count > from && count > 0) logs.push(this.#packed(log, first));
      first += count;
    };
    for (let stop = 1; stop <= this.#stop; ++stop) add(this.#stops[stop].log);
    this.#logs.forEach(add);
    return logs;
  }

  /** Applies an edit, {plans: [...]} or {edit: {...}}, at the current time. Edits at later times are taken back. */
  change(edit) {
    const request = normalEdit(edit);
    const place = [this.#stop, this.#time, this.#steps];
    if (this.#steps > 0) this.frame(this.#now); // single events end at the time of the last one
    this.#leaveStop();
    try {
      this.#module.call(...request);
    } catch (error) {
      this.#go(...place);
      throw error;
    }
    if (this.#time !== null) {
      const stop = { t: this.#time, frame: null, edits: [], log: merged(this.#logs), events: this.eventsDone, cost: this.#stops[this.#stop].cost + 1 };
      this.#stops.splice(++this.#stop, 0, stop);
    }
    const stop = this.#stops[this.#stop];
    stop.edits.push(request);
    this.#time = null;
    this.#logs = [];
    this.#eventsSinceStop = 0;
    this.#stops = this.#stops.filter((later, i) => i <= this.#stop || later.frame !== null);
    for (const later of this.#stops.slice(this.#stop + 1)) Object.assign(later, { edits: [], log: null });
    for (const at of [...this.#snapshots.keys()]) if (at >= this.#stop) this.#snapshots.delete(at);
    this.#snapshot();
  }

  /**
   * Plays all frames of a scene just loaded, without a log of events and without snapshots. Returns the milliseconds of each: of the
   * first one, the start. Load the scene again before asking for anything but the state.
   */
  time() {
    return [1000 * this.#seconds, ...this.#module.call('time', { times: this.#stops.slice(1).map(({ t }) => t) })];
  }

  /** The state at the current place. `want` says which parts; without it, all of them. */
  state(want) {
    const parts = wanted(want);
    const state = this.#module.call('state', parts);
    Object.assign(state, {
      eventsDone: this.eventsDone,
      frame: this.#stops[this.#stop].frame,
      atStop: this.#time === null && this.#steps === 0,
      seconds: this.#seconds,
      bytes: state.counters?.bytes,
    });
    if (state.pairs && state.pairsCount * 4 === state.pairs.length) {
      state.begun = difference(state.pairs, this.#shownPairs);
      state.ended = difference(this.#shownPairs, state.pairs);
      this.#shownPairs = state.pairs.slice();
    }
    return state;
  }

  /** A hash of everything that a state shows. */
  checkpoint() {
    const state = this.#module.call('state', wanted());
    return hashOf({ ...state, eventsDone: this.eventsDone });
  }

  get eventsDone() {
    return this.#stops[this.#stop].events + this.#eventsSinceStop;
  }

  get #now() {
    return this.#module.call('state', { ...NOTHING, mostPairs: 0, mostEvents: 0 }).time;
  }
  #pairs() {
    return this.#module.call('state', { ...wanted(NOTHING), pairs: true }).pairs;
  }
  #packed(log, first) {
    return { first, log };
  }

  #go(stop, time, steps) {
    if (stop === this.#stop && time === this.#time && steps === this.#steps && (time !== null || steps === this.#eventsSinceStop)) return;
    this.#enter(stop);
    if (time === null && steps === 0) return;
    this.#leaveStop();
    if (time !== null) {
      this.#advance(time);
      this.#time = time;
      this.#keepLog();
    }
    const next = this.#stops[stop + 1];
    for (let i = 0; i < steps; ++i, ++this.#steps)
      if (!this.#step(next === undefined ? Number.MAX_SAFE_INTEGER : next.t))
        throw new Error(`the engine lost an event: ${i} of ${steps} after t = ${this.#stops[stop].t}`);
  }

  /** Walks the canonical way to a stop. */
  #enter(stop) {
    const clean = this.#time === null && this.#steps === 0;
    let nearest = -1;
    for (const at of this.#snapshots.keys()) if (at <= stop && at > nearest) nearest = at;
    if (!clean || this.#stop > stop || nearest > this.#stop) {
      this.#module.restore(this.#snapshots.get(nearest));
      this.#stop = nearest;
    }
    this.#time = null;
    this.#steps = 0;
    this.#logs = [];
    this.#eventsSinceStop = 0;
    while (this.#stop < stop) this.#nextStop();
  }
  #nextStop() {
    const before = this.#stops[this.#stop];
    const stop = this.#stops[this.#stop + 1];
    const started = performance.now();
    this.#advance(stop.t);
    for (const edit of stop.edits) this.#module.call(...edit);
    stop.cost = before.cost + performance.now() - started;
    const log = this.#hasEvents ? this.#module.call('log') : null;
    stop.log = log;
    stop.events = before.events + (log === null ? 0 : log.touchedEnds.length);
    ++this.#stop;
    let last = 0;
    for (const at of this.#snapshots.keys()) if (at <= this.#stop && at > last) last = at;
    if (stop.cost - this.#stops[last].cost > SNAPSHOT_AFTER + (SNAPSHOT_PER_MIB * this.#module.size) / (1 << 20)) this.#snapshot();
  }
  #advance(t) {
    const started = performance.now();
    this.#module.call('advance', { t });
    this.#seconds = (performance.now() - started) / 1000;
  }
  #step(until) {
    if (!this.#module.call('step', { until }).done) return false;
    this.#keepLog();
    return true;
  }
  #keepLog() {
    if (!this.#hasEvents) return;
    const log = this.#module.call('log');
    this.#logs.push(log);
    this.#eventsSinceStop += log.touchedEnds.length;
  }

  /** Before the canonical way is left: keeps the state of the stop. */
  #leaveStop() {
    if (this.#time === null && this.#steps === 0 && !this.#snapshots.has(this.#stop)) this.#snapshot();
  }
  #snapshot() {
    this.#snapshots.set(this.#stop, this.#module.snapshot());
    let bytes = 0;
    for (const memory of this.#snapshots.values()) bytes += memory.byteLength;
    while (bytes > this.#snapshotBytes) {
      // Drops the one whose absence costs least: the replay between its neighbours.
      const places = [...this.#snapshots.keys()].sort((a, b) => a - b);
      let cheapest = null;
      for (let i = 1; i < places.length; ++i) {
        if (places[i] === this.#stop) continue;
        const after = places[i + 1] ?? places[i];
        const cost = this.#stops[Math.min(after, this.#stops.length - 1)].cost - this.#stops[places[i - 1]].cost;
        if (cheapest === null || cost < cheapest.cost) cheapest = { at: places[i], cost };
      }
      if (cheapest === null) break;
      bytes -= this.#snapshots.get(cheapest.at).byteLength;
      this.#snapshots.delete(cheapest.at);
    }
  }
}

function wanted(want = {}) {
  const all = !['positions', 'nodes', 'pairs', 'queue', 'counters', 'flat'].some((part) => want[part] !== undefined);
  const part = (name) => all || Boolean(want[name]);
  return {
    positions: part('positions'),
    nodes: part('nodes') || Boolean(want.flat),
    pairs: part('pairs'),
    queue: part('queue'),
    counters: part('counters'),
    mostPairs: want.pairsLimit ?? 0xffffffff,
    mostEvents: want.queueLimit ?? 0xffffffff,
  };
}

function normalEdit({ plans, edit }) {
  const rest = [0, 0, 0];
  if (plans !== undefined) {
    if (!Array.isArray(plans)) throw new Error('changePlans takes a list of plans');
    return ['plans', plans.map(({ body = 0, vertex, times = [], positions = [], velocity = rest }) =>
      ({ body, vertex, times: [...times], positions: [...positions].flat(), velocity: [...velocity] }))];
  }
  const { vertices = [], primitives = [], removedPrimitives = [], removedVertices = [] } = edit;
  return ['edit', {
    vertices: vertices.map(({ body = 0, position, velocity = rest }) => ({ body, position: [...position], velocity: [...velocity] })),
    primitives: primitives.map(({ body = 0, vertices: of }) => ({ body, vertices: [...of] })),
    removedPrimitives: removedPrimitives.map(({ body = 0, id }) => ({ body, id })),
    removedVertices: removedVertices.map(({ body = 0, id }) => ({ body, id })),
  }];
}
