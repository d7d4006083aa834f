/**
 * The four criteria of a kinetic data structure, as numbers of the present state with the bound that theory gives.
 */
import {primitiveVertices} from './hierarchy.js';

/** Certificates of each vertex of a body: in how many (node, side) it is the realiser or a candidate. */
export function certificatesPerVertex(tree, vertices) {
  const count = new Uint32Array(vertices);
  const members = new Set();
  for (let node = 0; node < tree.size; ++node)
    for (let side = 0; side < 6; ++side) {
      members.clear();
      if (tree.isLeaf(node)) for (const v of tree.verticesBelow(node)) members.add(v);
      else for (const child of tree.kids(node)) { const v = tree.realiser(child, side); if (v !== null) members.add(v); }
      if (members.size > 1) for (const v of members) ++count[v];
    }
  return count;
}

/** Whether each node of a tree keeps a realiser for all of its sides: only then are the candidates of certificates those of the children. */
function knowsAllSides(tree) {
  if (!tree.realisers) return false;
  for (let node = 0; node < tree.size; ++node) for (let side = 0; side < 6; ++side) if (tree.realiser(node, side) === null) return false;
  return true;
}

/** The largest number of leaves that one vertex occurs in. */
export function mostLeaves(tree, info) {
  const last = new Int32Array(info.vertices).fill(-1), leaves = new Uint32Array(info.vertices);
  let most = 0;
  for (let node = 0; node < tree.size; ++node) {
    if (!tree.isLeaf(node)) continue;
    for (let i = tree.first[node]; i < tree.first[node] + tree.count[node]; ++i)
      for (const v of primitiveVertices(info, tree.primitives[i]))
        if (last[v] !== node) { last[v] = node; most = Math.max(most, ++leaves[v]); }
  }
  return most;
}

/**
 * @returns list of gauges {id, title, value, bound, unit, about, formula, ok: true|false|null}; value null: not known for this strategy
 */
export function gauges({trees, at, info, step, history}) {
  const known = trees.filter(Boolean);
  const boxes = known.reduce((sum, tree) => sum + tree.size, 0);
  const m = info.bodies.reduce((sum, body) => sum + body.primitives, 0);
  const log = Math.log2(Math.max(2, m));
  const bounds = at.queue.filter((event) => event.kind === 'bound').length;
  const kinetic = info.hasEvents;
  const counters = at.counters ?? {};
  const result = [];
  result.push(gauge('compact', 'Compact', kinetic && boxes ? bounds / boxes : null, 6, 'events per box',
      `${bounds} certificates that fail, in ${boxes} boxes`, 'at most 6 events for each box'));

  const steps = counters.certificates_failed || 0;
  const work = steps ? ((counters.values_written ?? 0) + (counters.queue_steps ?? 0)) / steps : null;
  const latest = step ? `; the last one changed ${step.touched.length} ${step.touched.length === 1 ? 'side' : 'sides'} and scheduled ${step.rescheduled.length}` : '';
  result.push(gauge('responsive', 'Responsive', kinetic ? work : null, responsiveBound(log), 'sides changed and queue steps per event',
      `mean of ${steps} events${latest}`, `O(log² m); drawn is 6 log₂² m + 6 with m = ${m}`, 'no event has happened yet'));

  let most = 0, total = 0, vertices = 0, leaves = 1, levels = 1, haveRealisers = false;
  if (kinetic && boxes <= 6000)
    for (const tree of known) {
      if (!knowsAllSides(tree)) continue;
      haveRealisers = true;
      const body = info.bodies[tree.body];
      const counts = certificatesPerVertex(tree, body.vertices);
      for (const n of counts) { most = Math.max(most, n); total += n; }
      vertices += body.vertices;
      leaves = Math.max(leaves, mostLeaves(tree, body));
      levels = Math.max(levels, tree.levels);
    }
  result.push(gauge('local', 'Local', haveRealisers ? most : null, 6 * leaves * levels, 'certificates of one vertex',
      haveRealisers ? `the busiest vertex; the mean is ${(total / Math.max(1, vertices)).toFixed(1)}` : 'realisers are not known',
      `6 sides × ${levels} levels × ${leaves} ${leaves === 1 ? 'leaf' : 'leaves'} of a vertex`));

  const internal = counters.internal_events ?? history.filter((s) => s.event.kind === 'bound' && !s.touched.length).length;
  result.push(gauge('efficient', 'Efficient', kinetic ? internal : null, 0, 'events that change no bound',
      `of ${steps} events`, 'none: every event changes a bound'));
  return result;
}

const responsiveBound = (log) => 6 * log * log + 6;

/** `unknown`: why there is no value. */
function gauge(id, title, value, bound, unit, about, formula, unknown = 'not known for this strategy') {
  return {id, title, value, bound, unit, about, formula, unknown, ok: value === null ? null : value <= bound};
}
