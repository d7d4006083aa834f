/** Time: play, frames, events, speed, break points. */
import {html, useState} from './dom.js';
import {frameAt} from '../math/plans.js';
import {short} from '../math/exact.js';

export function Transport({lab, state}) {
  const [more, setMore] = useState(false);  // on a phone: whether speed and break points are shown
  const {phase, at, info, frames, selection, speed} = state;
  const off = !at || phase === 'loading', noEvents = off || !info?.hasEvents;
  const frame = at ? frameAt(frames, at.time) : 0;
  const exactly = at && frames[frame] === at.time && !at.betweenFrames;
  return html`<div class=${`transport ${more ? 'more' : ''}`} role="toolbar" aria-label="Time">
    <div class="group">
      <button disabled=${off} onClick=${() => { lab.pause(); lab.seek(info.begin); }} title="To the start (Home)" aria-label="To the start">❙◂</button>
      <button disabled=${off} onClick=${() => lab.frame(-1)} title="One frame back (,)" aria-label="One frame back">◂ frame</button>
      <button class="play" disabled=${off} onClick=${() => lab.toggle()} title="Play or pause (space)" aria-label=${phase === 'playing' ? 'Pause' : 'Play'}>${phase === 'playing' ? '❚❚' : '▶'}</button>
      <button disabled=${off} onClick=${() => lab.frame(1)} title="One frame forwards (.)" aria-label="One frame forwards">frame ▸</button>
    </div>
    ${(off || info?.hasEvents) && html`<div class="group events">
      <button disabled=${noEvents} onClick=${() => lab.event(-1)} title="Take back one event (p)" aria-label="One event back">◂ event</button>
      <button disabled=${noEvents} onClick=${() => lab.event(1)} title="Perform the next event (n)" aria-label="One event forwards">event ▸</button>
    </div>`}
    <button class="narrow-only" aria-expanded=${more} onClick=${() => setMore(!more)} title="Speed and break points" aria-label="Speed and break points">⋯</button>
    <output class="clock" aria-live="off"><b>t = ${at ? short(at.time) : '–'} s</b>
      <span>${at ? exactly ? `frame ${frame} of ${frames.length - 1}` : at.betweenFrames ? `after frame ${frame}, between events` : `between frames ${frame} and ${frame + 1}` : ''}</span></output>
    ${(off || info?.hasEvents) && html`<${Stops} lab=${lab} state=${state} off=${noEvents} selection=${selection} />`}
    <label class="speed">Speed <select value=${String(speed)} onChange=${(event) => lab.store.set({speed: Number(event.currentTarget.value)})}>
      ${[0.1, 0.25, 0.5, 1, 2, 4].map((x) => html`<option value=${String(x)}>${x}×</option>`)}</select></label>
    <input class="scrub" type="range" aria-label="Time in the clip" min=${info?.begin ?? 0} max=${info?.end ?? 1} step="any" value=${at?.time ?? 0} disabled=${off}
      aria-valuetext=${at ? `${short(at.time)} seconds` : ''}
      onInput=${(event) => { lab.pause(); lab.seek(Number(event.currentTarget.value)); }}
      onKeyDown=${(event) => scrubKey(lab, event)} />
  </div>`;
}

/** On the slider, arrow keys move by a hundredth of the clip, Page keys by a tenth. */
function scrubKey(lab, event) {
  const {info, at} = lab.state, span = info.end - info.begin;
  const by = {ArrowRight: 0.01, ArrowUp: 0.01, ArrowLeft: -0.01, ArrowDown: -0.01, PageUp: 0.1, PageDown: -0.1}[event.key];
  if (by === undefined || event.shiftKey) return;
  event.preventDefault();
  event.stopPropagation();
  lab.pause();
  lab.seek(at.time + by * span);
}

function Stops({lab, state, off, selection}) {
  const [kind, setKind] = useState('node');
  const stops = {
    node: {title: `event of node ${selection.node}`, stop: {body: selection.body, node: selection.node}},
    vertex: {title: selection.vertex === null ? 'event of the chosen vertex' : `event of vertex ${selection.vertex}`, stop: selection.vertex === null ? null : {body: selection.body, vertex: selection.vertex}},
    pair: {title: 'pair that begins', stop: {pair: true}},
  };
  return html`<div class="group stops">
    <label><span class="stop-word">Run to the next</span> <select aria-label="Break point" value=${kind} disabled=${off && kind !== 'pair'} onChange=${(event) => setKind(event.currentTarget.value)}>
      ${Object.entries(stops).map(([id, {title}]) => html`<option value=${id} disabled=${!stops[id].stop}>${title}</option>`)}</select></label>
    <button disabled=${off || !stops[kind].stop} onClick=${() => lab.runTo(stops[kind].stop)} title="Run to the break point (b)" data-action="run">run</button>
  </div>`;
}
