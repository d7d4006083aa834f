/** The chosen box: which vertex realises each side, since when and until when. */
import {html, Unfilled, useMemo} from './dom.js';
import {sideName} from '../math/plans.js';
import {short} from '../math/exact.js';
import {tenure} from '../text/tenure.js';
import {primitiveWord} from '../math/hierarchy.js';
import {isLit} from '../state/lit.js';

/** A node in words. */
export function plainNode(tree, node, side) {
  const v = tree.realiser(node, side);
  const what = tree.isLeaf(node) ? `leaf ${node} with ${count(tree.primitivesBelow(node).length, primitiveWord(tree.info))}` : `node ${node} with ${count(tree.kids(node).length, 'child', 'children')}`;
  return `${what}, level ${tree.depth[node]}` + (v === null ? '' : `; ${sideName(side)} side realised by vertex ${v}`);
}

export const count = (n, one, many = `${one}${/(s|x|ch)$/.test(one) ? 'es' : 's'}`) => `${n} ${n === 1 ? one : many}`;

export function BoxPanel({lab, state}) {
  const {selection, trees, history, at, info, scene, precision, lit} = state;
  const tree = trees[selection.body], node = selection.node;
  const sides = scene?.dimension === 2 ? [0, 1, 2, 3] : [0, 1, 2, 3, 4, 5];
  const rows = useMemo(() => {
    if (!tree || !at || node >= tree.size) return [];
    const context = {scene, tree, history, queue: at.queue, at, info, precision};
    return sides.map((side) => ({side, bound: tree.bound(node, side), ...tenure(context, node, side)}));
  }, [tree, node, history, at]);
  if (!tree) return html`<${Unfilled} lab=${lab} why="This strategy keeps no tree." would="With one, the sides of the chosen box stand here: their values, and who realises them since when." />`;
  const primitives = tree.isLeaf(node) ? tree.primitivesBelow(node) : null;
  return html`<div class="box-panel">
    <p class="lead"><strong>${tree.isLeaf(node) ? 'Leaf' : 'Node'} ${node}</strong> of ${info.bodies[selection.body].name}, level ${tree.depth[node]},
      ${tree.isLeaf(node) ? html` holds ${primitiveWord(info.bodies[selection.body])}${primitives.length > 1 ? 's' : ''} ${primitives.slice(0, 8).join(', ')}${primitives.length > 8 ? ' …' : ''}`
                          : html` with the children ${Array.from(tree.kids(node)).map((kid) => html`<button class="ref ref-node" onClick=${() => lab.select({node: kid})}>node ${kid}</button> `)}`}
      ${node !== 0 && html` below <button class="ref ref-node" onClick=${() => lab.select({node: tree.parent[node]})}>node ${tree.parent[node]}</button>`}.
      ${tree.stale[node] ? ' This box is stale: no query has read it at this time.' : ''}</p>
    <div class="scroll-x"><table class="sides">
      <thead><tr><th scope="col">Side</th><th scope="col" class="number" title="in the units of the scene">Value, units</th><th scope="col">Realised by</th><th scope="col" class="number">Since, s</th><th scope="col" class="number">Until, s</th></tr></thead>
      <tbody>${rows.map((row) => html`<tr class=${[selection.side === row.side && 'chosen', isLit(lit, selection.body, node, row.side) && 'lit'].filter(Boolean).join(' ')}>
        <th scope="row"><button class="side-button" aria-pressed=${selection.side === row.side} onClick=${() => lab.select({side: row.side})}>${sideName(row.side)}</button></th>
        <td class="number">${short(row.bound, 5)}</td>
        <td>${row.vertex === null ? html`<span class="muted">${tree.realisers ? 'inherited from above' : 'not kept'}</span>` : html`<button class="ref ref-vertex" onClick=${() => lab.select({vertex: row.vertex})}>vertex ${row.vertex}</button>`}</td>
        <td class="number">${row.vertex === null || !info.hasEvents ? '–' : row.sinceStep === null ? 'start' : html`<button class="ref" onClick=${() => lab.goToEvent(row.sinceStep)}>${short(row.since, 5)}</button>`}</td>
        <td class="number">${row.vertex === null ? '–' : row.until === Infinity || row.until >= info.end ? 'end' : html`<button class="ref" onClick=${() => lab.seek(row.until)}>${short(row.until, 5)}</button>`}</td>
      </tr>`)}</tbody></table></div>
    <div class="row"><button onClick=${() => lab.runTo({body: selection.body, node})} disabled=${!info.hasEvents}>Run to this node’s next event</button></div>
    ${!tree.realisers && html`<p class="hint">This strategy stores numbers, not realisers: after every frame it has written the bounds again.</p>`}
  </div>`;
}
