/**
 * Which vertex realises a side, since when and until when: from the history of events, the flight plans and the queue.
 */
import {axisOf, isUpper, polyline} from '../math/plans.js';
import {envelope} from '../math/envelope.js';

/** Above this many vertices the end of a tenure is read from the queue only. */
const manyVertices = 400;

/**
 * The lines of the vertices below a node, on the axis of a side. With more than `most` vertices, an even sample and the
 * vertices of `always`.
 */
export function linesBelow(scene, tree, node, side, precision, most = Infinity, always = []) {
  const body = scene.bodies[tree.body], all = tree.verticesBelow(node);
  const step = Math.ceil(all.length / most);
  const chosen = step > 1 ? [...new Set([...always, ...all.filter((_, i) => i % step === 0)])] : all;
  return chosen.map((id) => ({id, ...polyline(body, id, axisOf(side), precision)}));
}

/** Index of the last performed step that changed this side; -1 if none did. */
export function lastChange(history, body, node, side) {
  for (let i = history.length - 1; i >= 0; --i)
    if (history[i].touched.some((c) => c.body === body && c.node === node && c.side === side)) return i;
  return -1;
}

/**
 * @returns {vertex, since, sinceStep: index|null, until: seconds|Infinity, exact: whether `until` is from the plans}
 */
export function tenure({scene, tree, history, queue, at, info, precision}, node, side) {
  const realiser = tree.realiser(node, side);
  const last = lastChange(history, tree.body, node, side);
  const since = last >= 0 ? history[last].event.time : info.begin;
  let until = Infinity, exact = false;
  const count = tree.verticesBelow(node).length;
  if (count <= manyVertices && realiser !== null) {
    const lines = linesBelow(scene, tree, node, side, precision);
    const ahead = envelope(rotate(lines, realiser), isUpper(side), at.time, Math.max(info.end, at.time));
    exact = true;
    if (ahead.length > 1) until = ahead[0].id === realiser ? ahead[0].end : at.time;
  } else {
    for (const event of queue)
      if (event.kind === 'bound' && event.body === tree.body && event.side === side && event.winner === realiser && below(tree, event.node, node)) { until = event.time; break; }
  }
  return {vertex: realiser, since, sinceStep: last >= 0 ? last : null, until, exact};
}

/** Puts the present realiser first, so that a tie does not take its side away. */
function rotate(lines, id) {
  const i = lines.findIndex((line) => line.id === id);
  return i > 0 ? [lines[i], ...lines.slice(0, i), ...lines.slice(i + 1)] : lines;
}

function below(tree, inner, node) {
  for (let n = inner; ; n = tree.parent[n]) { if (n === node) return true; if (n === 0) return false; }
}
