/** All counters of the strategy: since the start of the clip, and by the last move. */
import {html, useRef, useState} from './dom.js';

export function CountersPanel({state}) {
  const {at, compare, meanings} = state;
  const [all, setAll] = useState(false), last = useRef({at: null, before: {}});
  if (!at) return null;
  if (last.current.at !== at) last.current = {at, before: last.current.at?.counters ?? {}};
  const before = last.current.before, second = compare?.at?.counters ?? null;
  const names = Object.keys(at.counters).filter((name) => all || at.counters[name] || second?.[name]);
  const number = (x) => x === undefined ? '–' : x.toLocaleString('en').replaceAll(',', '\u202f');
  return html`<div class="counters">
    <p class="lead">Counted since the start of the clip${second ? '; the second strategy on the right' : ''}.</p>
    <div class="scroll-x"><table><thead><tr><th scope="col">Counter</th><th scope="col" class="number">Total</th><th scope="col" class="number">Last move</th>${second && html`<th scope="col" class="number">Second</th>`}</tr></thead>
      <tbody>${names.map((name) => { const change = at.counters[name] - (before[name] ?? 0); return html`<tr title=${meanings.get(name) ?? ''}>
        <th scope="row"><code>${name}</code>${meanings.get(name) && html`<span class="meaning">${meanings.get(name)}</span>`}</th>
        <td class="number">${number(at.counters[name])}</td><td class="number">${change ? `${change > 0 ? '+' : '\u2212'}${number(Math.abs(change))}` : ''}</td>${second && html`<td class="number">${number(second[name])}</td>`}</tr>`; })}</tbody></table></div>
    <label class="check"><input type="checkbox" checked=${all} onChange=${() => setAll(!all)} /> show those that are zero</label>
  </div>`;
}
