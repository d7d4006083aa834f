/** The four criteria of a kinetic data structure as gauges: value, bound, and what was counted. */
import {html, useMemo, useRef} from './dom.js';
import {gauges} from '../math/quality.js';

export function Gauges({state}) {
  const {trees, at, info, step, history} = state;
  const playing = state.phase === 'playing' && trees.reduce((sum, tree) => sum + (tree?.size ?? 0), 0) > 200;
  const last = useRef([]);
  const list = useMemo(() => playing ? last.current : at && info ? gauges({trees, at, info, step, history}) : [], [playing ? null : at, info, history]);
  last.current = list;
  if (!at || !info) return null;
  return html`<div class="gauges">${list.map((gauge) => html`<${Gauge} key=${gauge.id} gauge=${gauge} />`)}</div>`;
}

function Gauge({gauge}) {
  const {id, title, value, bound, unit, about, formula, unknown, ok} = gauge;
  const full = bound > 0 ? bound * 1.25 : 1, share = value === null ? 0 : Math.min(1, value / full);
  const text = value === null ? '–' : Number.isInteger(value) ? String(value) : value.toFixed(2);
  return html`<div class=${`gauge gauge-${id} ${ok === null ? 'unknown' : ok ? 'ok' : 'over'}`} role="meter" aria-label=${`${title}: ${unit}`} aria-valuenow=${value ?? 0} aria-valuemin="0" aria-valuemax=${bound}
      aria-valuetext=${value === null ? unknown : `${text} ${unit}; bound ${bound.toFixed(0)}; ${ok ? 'within' : 'above'} the bound`} title=${`${about}. Bound: ${formula}.`}>
    <div class="gauge-head"><span class="gauge-title">${title}</span><span class="gauge-mark" aria-hidden="true">${ok === null ? '' : ok ? '✓' : '!'}</span></div>
    <div class="gauge-value"><b>${text}</b> <span>${unit}</span></div>
    <svg class="gauge-bar" viewBox="0 0 100 8" preserveAspectRatio="none" aria-hidden="true">
      <rect x="0" y="2.5" width="100" height="3" class="track" /><rect x="0" y="1.5" width=${100 * share} height="5" class="fill" />
      <rect x=${bound > 0 ? 100 * bound / full - 0.5 : 0} y="0" width="1.2" height="8" class="limit" /></svg>
    <div class="gauge-about">${value === null ? unknown : html`bound ${bound > 0 ? Math.round(bound) : 0}: ${formula}`}</div>
  </div>`;
}
