import {createEngine} from '../engine/client.js';
import {Tree} from '../math/hierarchy.js';
import {medianClip} from '../math/clips.js';
import {difference, nothingLit} from './lit.js';
import {titleOf} from '../text/words.js';

/** The counters that the comparison draws, with their meaning, in the order of the menu. */
export const workMetrics = [
  {id: 'values_written', title: 'Bound values written', about: 'six per box written; one per realiser changed'},
  {id: 'nodes_visited', title: 'Nodes visited', about: 'nodes whose bounds an update visited'},
  {id: 'box_tests', title: 'Box tests', about: 'box against box tests of the query'},
  {id: 'triangle_tests', title: 'Primitive tests', about: 'exact tests of primitives'},
  {id: 'certificates_failed', title: 'Events', about: 'certificates that failed'},
  {id: 'queue_operations', title: 'Queue operations', about: 'insert, erase, pop and re-key on the event queue'},
  {id: 'milliseconds', title: 'Time in the engine, ms', about: 'milliseconds in WebAssembly; depends on this machine and its load'},
];

/** Rounds of timing, and the milliseconds after which no further one begins. */
const mostRounds = 7, timingBudget = 4000;

/**
 * A second strategy on the same clock, with an engine of its own, and the work of both strategies frame by frame, measured
 * by a third engine in the background.
 */
export class Comparison {
  constructor(lab) {
    this.lab = lab;
    this.engine = null;
    this.meter = null;
    this.measuring = 0;  // number of the newest measurement; an older one stops
  }

  /** Chooses the second strategy: {strategy, params?, topology?}, or null for none. */
  async set(choice) {
    if (!choice) {
      this.lab.store.set({compare: null, work: null});
      ++this.measuring;
      return;
    }
    const topology = this.lab.defaultTopology(choice.strategy, this.lab.state.scene);
    this.lab.store.set({compare: {params: {}, topology, ...choice, info: null, at: null, trees: [], lit: nothingLit}});
    await this.reload();
  }

  /** Loads the current scene again, after the scene or a strategy changed. */
  async reload({quiet = false} = {}) {
    const {compare, scene, precision, at} = this.lab.state;
    ++this.measuring;
    if (!compare) return;
    await this.lab.enqueue(quiet ? null : 'loading', `Loading the second strategy, ${titleOf(this.lab.state.strategies, compare.strategy)}`, async () => {
      this.engine ??= await createEngine();
      const info = await this.engine.load({scene: this.lab.sceneFor(scene, compare.strategy), strategy: compare.strategy, params: compare.params, topology: compare.topology, precision});
      this.lab.store.set({compare: {...this.lab.state.compare, info, at: null, trees: [], lit: nothingLit}});
      if (at) await this.frame(at.time);
    });
    this.measure();
  }

  /** Brings the second strategy to the lab's time. */
  async frame(t) {
    const {compare, phase} = this.lab.state;
    if (!compare?.info || !this.engine) return;
    const at = await this.engine.frame(t, {positions: true, nodes: true, flat: true, pairs: true, queue: phase !== 'playing', counters: true, queueLimit: 4000, pairsLimit: 20000});
    const now = this.lab.state.compare;
    if (!now) return;
    const flats = at.hierarchies?.map((hierarchy) => hierarchy?.flat ?? null);
    const trees = flats ? flats.map((flat, b) => !flat ? null
        : now.trees[b] ? now.trees[b].next(flat, now.info.bodies[b]) : new Tree(flat, b, now.info.bodies[b])) : now.trees;
    this.lab.store.set({compare: {...now, at: {...at, queue: at.queue ?? now.at?.queue ?? []}, trees, lit: now.at && flats ? difference(now.trees, trees) : nothingLit}});
  }

  /**
   * Plays the clip with each strategy in the background and keeps the counters of every frame. The first round counts, and lets the browser
   * compile what it has only translated so far. Then the strategies are timed by turns, without a log of events; the clip of median time of
   * each is shown.
   */
  async measure() {
    const {compare, scene, precision, strategy, params, topology, frames} = this.lab.state;
    if (!compare || frames.length < 2) return;
    const number = ++this.measuring;
    const chosen = [{strategy, params, topology}, compare].map(({strategy, params, topology}) => ({strategy, params, topology}));
    const series = chosen.map(({strategy}) => ({strategy, frames, done: 0, counters: {}}));
    let timed = false;
    const show = () => { if (number === this.measuring) this.lab.store.set({work: {timed, series: series.map((s) => ({...s}))}}); };
    const load = (choice) => this.meter.load({scene: this.lab.sceneFor(scene, choice.strategy), precision, ...choice});
    const play = async (choice, visit) => {
      await load(choice);
      for (let f = 0; f < frames.length; ++f) {
        if (number !== this.measuring) return;
        visit(f, await this.meter.frame(frames[f], {positions: false, nodes: false, flat: false, pairs: true, queue: false, counters: true, pairsLimit: 0}));
      }
    };
    show();
    try {
      this.meter ??= await createEngine();
      for (const [k, choice] of chosen.entries()) {
        let before = {}, shown = performance.now();
        await play(choice, (f, at) => {
          for (const {id} of workMetrics) if (id !== 'milliseconds') (series[k].counters[id] ??= new Float64Array(frames.length))[f] = (at.counters[id] ?? 0) - (before[id] ?? 0);
          before = at.counters;
          series[k].done = f + 1;
          if (performance.now() - shown > 120) { shown = performance.now(); show(); }
        });
        show();
      }
      const clips = chosen.map(() => []), began = performance.now();
      for (let round = 0; round < mostRounds && (round === 0 || performance.now() - began < timingBudget); ++round)
        for (const [k, choice] of chosen.entries()) {
          await load(choice);
          if (number !== this.measuring) return; // a newer measurement has loaded its own clip, which must not be played
          const times = await this.meter.time();
          if (number !== this.measuring) return;
          clips[k].push(times);
        }
      clips.forEach((all, k) => { series[k].counters.milliseconds = medianClip(all); });
      timed = true;
      show();
    } catch (error) {
      console.error(error);
      if (number === this.measuring) this.lab.store.set({error: `Work per frame could not be measured: ${error.message}`});
    }
  }

  close() {
    ++this.measuring;
    this.engine?.close();
    this.meter?.close();
  }
}
