/** Pairs of primitives that intersect now, and the separation list of strategies that keep one. */
import {html, useState} from './dom.js';
import {count} from './box.js';
import {primitiveWord} from '../math/hierarchy.js';

const most = 200;

export function PairsPanel({lab, state}) {
  const {at, info, compare} = state;
  const [which, setWhich] = useState('pairs');
  if (!at || !info) return null;
  const watched = list(at.watched);
  return html`<div class="pairs">
    ${watched && html`<div class="tabs small" role="tablist" aria-label="Which list">
      <button role="tab" aria-selected=${which === 'pairs'} onClick=${() => setWhich('pairs')}>Pairs</button>
      <button role="tab" aria-selected=${which === 'list'} onClick=${() => setWhich('list')}>Separation list</button></div>`}
    ${watched && which === 'list' ? html`<${Separation} lab=${lab} state=${state} watched=${watched} />` : html`<${Pairs} lab=${lab} at=${at} info=${info} />`}
    ${compare?.at && html`<p class="hint">${same(at.pairs, compare.at.pairs) ? 'The second strategy reports the same pairs.' : `The second strategy reports ${compare.at.pairs.length / 4} pairs.`}</p>`}
  </div>`;
}

function Pairs({lab, at, info}) {
  const pairs = at.pairs ?? [], n = at.pairsCount ?? pairs.length / 4;
  const begun = new Set(rows(at.begun).map(String)), ended = rows(at.ended);
  const word = (b) => primitiveWord(info.bodies[b]);
  return html`<p class="lead"><b>${count(n, 'pair')}</b> of primitives ${n === 1 ? 'intersects' : 'intersect'}${at.betweenFrames ? ' (as of the last frame)' : ''}${begun.size ? `; ${begun.size} began` : ''}${ended.length ? `; ${ended.length} ended` : ''}.</p>
    <ul class="pair-list" tabIndex="0" aria-label="Intersecting pairs">${rows(pairs).slice(0, most).map((row) => html`<li class=${begun.has(String(row)) ? 'begun' : ''}>
      <button class="pair-ref" onClick=${() => toPrimitive(lab, row[0], row[1])}>${word(row[0])} ${row[1]} of ${info.bodies[row[0]].name}</button> × ${' '}
      <button class="pair-ref" onClick=${() => toPrimitive(lab, row[2], row[3])}>${word(row[2])} ${row[3]} of ${info.bodies[row[2]].name}</button>${begun.has(String(row)) ? html` <b>began</b>` : ''}</li>`)}
    ${ended.slice(0, 20).map((row) => html`<li class="ended">${word(row[0])} ${row[1]} × ${word(row[2])} ${row[3]} <b>ended</b></li>`)}</ul>
    ${n > most && html`<p class="hint">The first ${most} are listed.</p>`}`;
}

function Separation({lab, state, watched}) {
  const {info, selection, at} = state;
  const listed = watched.filter((pair) => pair.listed), overlapping = listed.filter((pair) => pair.overlapping).length;
  const mine = (pair) => (pair.body === selection.body && pair.node === selection.node) || (pair.otherBody === selection.body && pair.otherNode === selection.node);
  const ordered = [...watched].sort((a, b) => (mine(b) - mine(a)) || (b.listed - a.listed) || (b.overlapping - a.overlapping));
  return html`<p class="lead"><b>${count(listed.length, 'pair')} of boxes</b> in the list: ${overlapping} overlapping pairs of leaves, ${listed.length - overlapping} pairs apart. ${watched.length - listed.length} inner pairs above it overlap.</p>
    <ul class="pair-list" tabIndex="0" aria-label="Separation list">${ordered.slice(0, most).map((pair) => {
      const due = at.queue.find((e) => e.kind !== 'bound' && e.body === pair.body && e.node === pair.node && e.otherBody === pair.otherBody && e.otherNode === pair.otherNode);
      return html`<li class=${mine(pair) ? 'begun' : ''}><span class=${`pair-state ${pair.overlapping ? 'over' : 'apart'}`}>${pair.listed ? pair.overlapping ? 'overlap' : 'apart' : 'above'}</span>
        <button class="pair-ref" onClick=${() => lab.select({body: pair.body, node: pair.node})}>${info.bodies[pair.body].name} ${pair.node}</button> × ${' '}
        <button class="pair-ref" onClick=${() => lab.select({body: pair.otherBody, node: pair.otherNode})}>${info.bodies[pair.otherBody].name} ${pair.otherNode}</button>
        ${due && html` <button class="ref" onClick=${() => lab.seek(due.time)}>until ${due.time.toFixed(3)} s</button>`}</li>`; })}</ul>`;
}

/** The watched pairs as objects: the engine sends objects, or six numbers a pair. */
function list(watched) {
  if (!watched || !watched.length) return null;
  if (typeof watched[0] === 'object') return Array.from(watched);
  const pairs = [];
  for (let i = 0; i + 5 < watched.length; i += 6) pairs.push({body: watched[i], node: watched[i + 1], otherBody: watched[i + 2], otherNode: watched[i + 3], overlapping: !!watched[i + 4], listed: !!watched[i + 5]});
  return pairs;
}

/** Chooses the leaf that holds a primitive. */
function toPrimitive(lab, body, primitive) {
  const tree = lab.state.trees[body];
  let node = 0;
  if (tree) for (let n = 0; n < tree.size; ++n) if (tree.isLeaf(n) && tree.primitivesBelow(n).includes(primitive)) { node = n; break; }
  lab.select({body, node});
}

function rows(pairs) {
  const result = [];
  for (let i = 0; pairs && i + 3 < pairs.length; i += 4) result.push([pairs[i], pairs[i + 1], pairs[i + 2], pairs[i + 3]]);
  return result;
}

/** Whether two lists hold the same pairs, in any order. */
function same(a, b) {
  if (!a || !b || a.length !== b.length) return false;
  const keys = new Set(rows(a).map(String));
  return rows(b).every((row) => keys.has(String(row)));
}
