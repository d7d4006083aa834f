/** Two strategies, their work per frame as small multiples, and which of them did less in total. */
import {html, Canvas, font, pointerAt, ticks} from './dom.js';
import {workMetrics} from '../state/compare.js';
import {frameAt} from '../math/plans.js';
import {titleOf} from '../text/words.js';

/** `metrics`: the ids of those to show; without it all. */
export function WorkPanel({lab, state, metrics}) {
  const {compare, work, strategies, strategy} = state;
  const title = (id) => titleOf(strategies, id);
  if (!compare) return html`<div class="work"><p class="hint">Choose a second strategy above (“Compare with”) to see both on one clock, with their work in each frame.</p>
    <div class="row">${['bottom_up', 'kinetic_aabb', 'kinetic_boxtree', 'kinetic_separation_list', 'interval_join', 'kinetic_envelope'].filter((id) => id !== strategy && strategies.some((s) => s.id === id)).map((id) =>
      html`<button onClick=${() => lab.comparison.set({strategy: id})}>${title(id)}</button> `)}</div></div>`;
  if (!work) return html`<p class="hint">Measuring …</p>`;
  const [a, b] = work.series, frames = a.frames.length;
  const counting = a.done < frames || b.done < frames;
  const shown = workMetrics.filter(({id}) => (!metrics || metrics.includes(id)) && work.series.some((s) => s.counters[id]?.some((x) => x > 0)));
  return html`<div class="work">
    <p class="key"><span class="swatch first"></span> ${title(a.strategy)} <span class="swatch second"></span> ${title(b.strategy)}
      ${counting ? html`<span class="muted"> counting: ${Math.min(a.done, frames) + Math.min(b.done, frames)} of ${2 * frames} frames</span>` : !work.timed && html`<span class="muted"> timing …</span>`}</p>
    <p class="hint">Work in each frame over the clip; the numbers on the right are totals of the clip, first : second.</p>
    <div class="multiples">${shown.map((metric) => html`<${Multiple} key=${metric.id} lab=${lab} state=${state} metric=${metric} a=${a} b=${b} />`)}</div>
    <p class="hint">Counts come from the strategies’ own counters, frame by frame, the query included. Milliseconds are of the median clip of several, played by turns; they depend on this machine and on WebAssembly; the project’s report measures natively.</p>
  </div>`;
}

function Multiple({lab, state, metric, a, b}) {
  const {at, frames} = state;
  const totals = [a, b].map((s) => sum(s.counters[metric.id], s.done));
  const ready = a.done === frames.length && b.done === frames.length;
  const text = (x) => x >= 1e6 ? `${(x / 1e6).toFixed(1)} M` : x >= 1e4 ? `${(x / 1e3).toFixed(1)} k` : metric.id === 'milliseconds' ? x.toFixed(1) : String(Math.round(x));
  let verdict = '';
  if (ready && totals[0] !== totals[1]) {
    const less = totals[0] < totals[1] ? 'first' : 'second', low = Math.min(...totals), high = Math.max(...totals);
    const frames = framesBelow(a.counters[metric.id], b.counters[metric.id], less === 'first');
    verdict = low === 0 ? `only the ${less === 'first' ? 'second' : 'first'} has any` : `${(high / low).toFixed(high / low < 10 ? 1 : 0)} times less in the ${less}, which is lower in ${frames} of ${a.done} frames`;
  }
  const draw = (c, {width, height, colours}) => {
    const bottom = 3, top = 3, most = Math.max(1e-9, ...[a, b].map((s) => max(s.counters[metric.id], s.done)));
    const x = (f) => 1 + f / Math.max(1, frames.length - 1) * (width - 2), y = (v) => height - bottom - v / most * (height - top - bottom);
    c.strokeStyle = colours.line; c.lineWidth = 1;
    for (const v of ticks(0, most, 2)) { c.beginPath(); c.moveTo(0, y(v)); c.lineTo(width, y(v)); c.stroke(); }
    [[b, colours.challenger], [a, colours.realiser]].forEach(([s, colour]) => {
      const values = s.counters[metric.id];
      if (!values) return;
      c.strokeStyle = colour; c.lineWidth = 1.6;
      c.beginPath();
      for (let f = 0; f < s.done; ++f) { if (f) c.lineTo(x(f), y(values[f - 1])); c[f ? 'lineTo' : 'moveTo'](x(f), y(values[f])); }
      c.stroke();
    });
    const now = x(frameAt(frames, at?.time ?? 0));
    c.strokeStyle = colours.ink;
    c.beginPath(); c.moveTo(now, 0); c.lineTo(now, height); c.stroke();
    font(c, 10);
    c.fillStyle = colours.muted; c.textAlign = 'right'; c.textBaseline = 'top';
    c.fillText(text(most), width - 3, 3);
  };
  return html`<figure class="multiple" title=${metric.about}><figcaption><b>${metric.title}</b><span>${ready ? `${text(totals[0])} : ${text(totals[1])}` : '…'}</span></figcaption>
    <${Canvas} draw=${draw} role="img" aria-label=${`${metric.title} per frame. ${ready ? `Totals: ${text(totals[0])} and ${text(totals[1])}. ${verdict}` : 'Still measuring.'}`}
      onPointerDown=${(event) => { const [px] = pointerAt(event), w = event.currentTarget.clientWidth; lab.seek(frames[Math.max(0, Math.min(frames.length - 1, Math.round(px / w * (frames.length - 1))))]); }} />
    <div class="verdict">${verdict || (ready ? 'equal' : '…')}</div></figure>`;
}

/** The number of frames in which the first (or the second) series is the lower one. */
function framesBelow(first, second, firstIsLower) {
  let n = 0;
  for (let f = 0; f < Math.max(first?.length ?? 0, second?.length ?? 0); ++f) {
    const d = (first?.[f] ?? 0) - (second?.[f] ?? 0);
    if (firstIsLower ? d < 0 : d > 0) ++n;
  }
  return n;
}

const sum = (values, n) => { let s = 0; for (let i = 0; values && i < n; ++i) s += values[i]; return s; };
const max = (values, n) => { let m = 0; for (let i = 0; values && i < n; ++i) m = Math.max(m, values[i]); return m; };
