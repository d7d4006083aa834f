/** The event queue as a timeline: performed events left of now, scheduled ones right of it, a row for each side. */
import {html, Canvas, font, pointerAt, ticks, tickText, Unfilled, useRef, useState} from './dom.js';
import {sideName} from '../math/plans.js';
import {isSame, title, when} from '../text/why.js';
import {short} from '../math/exact.js';

const left = 66, right = 14;

/** Rows of the timeline: the sides of the scene's dimension, then pairs of boxes if the strategy has such events. */
export function rowsOf(scene, events) {
  const sides = scene.dimension === 2 ? [0, 1, 2, 3] : [0, 1, 2, 3, 4, 5];
  const pairs = events.some((event) => event.kind !== 'bound'), slanted = events.some((event) => event.side > 5);
  return sides.map((side) => ({side, name: sideName(side)})).concat(slanted ? [{side: 'slanted', name: 'slanted'}] : [], pairs ? [{side: null, name: 'pairs'}] : []);
}

export function Timeline({lab, state}) {
  const {info, at, frames, history, scene, selection, phase} = state;
  const hits = useRef([]), dragging = useRef(false), size = useRef([1, 1]);
  const [zoom, setZoom] = useState(null);  // {t0, t1}; null: the whole clip
  if (!info || !at) return html`<div class="empty">…</div>`;
  if (!info.hasEvents) return html`<${Unfilled} lab=${lab} why="This strategy works at each frame and has no event queue." would="A kinetic strategy shows here which events have happened, and which are computed for later." />`;
  const shown = zoom && zoom.t1 <= info.end + 1e-9 && zoom.t0 >= info.begin - 1e-9 ? follow(zoom, at.time, info) : {t0: info.begin, t1: info.end};
  const span = Math.max(1e-300, shown.t1 - shown.t0);
  const x = (t) => left + (t - shown.t0) / span * (size.current[0] - left - right);
  const timeAt = (px) => shown.t0 + (px - left) / (size.current[0] - left - right) * span;
  const zoomAt = (t, factor) => {
    const wide = Math.min(info.end - info.begin, span * factor);
    if (wide >= info.end - info.begin) { setZoom(null); return; }
    const t0 = Math.min(info.end - wide, Math.max(info.begin, t - (t - shown.t0) * wide / span));
    setZoom({t0, t1: t0 + wide});
  };
  const all = history.map((step) => step.event).concat(at.queue);
  const rows = rowsOf(scene, all);

  const draw = (c, {width, height, colours}) => {
    size.current = [width, height];
    hits.current = [];
    const top = 6, bottom = 20, rowHeight = (height - top - bottom) / rows.length;
    const rowOf = (event) => rows.findIndex((row) => row.side === (event.kind !== 'bound' ? null : event.side > 5 ? 'slanted' : event.side));
    c.fillStyle = colours.bg;
    c.fillRect(left, top, Math.max(0, Math.min(x(at.time), width - right) - left), height - top - bottom);
    font(c, 11);
    rows.forEach((row, i) => {
      const y = top + i * rowHeight;
      c.fillStyle = selection.side === row.side ? colours.ink : colours.muted;
      c.textAlign = 'right';
      c.textBaseline = 'middle';
      if (rowHeight >= 9) c.fillText(row.name, left - 8, y + rowHeight / 2);
      c.strokeStyle = colours.line;
      c.lineWidth = 1;
      line(c, left, y + rowHeight / 2, width - right, y + rowHeight / 2);
    });
    drawAxis(c, {width, height, colours, bottom});
    c.save();
    c.beginPath();
    c.rect(left - 6, 0, width - left - right + 12, height);
    c.clip();
    const mark = (event, when, y, past, chosen) => {
      if (event.time < shown.t0 - span / 50 || event.time > shown.t1 + span / 50) return;
      const px = x(event.time), r = Math.max(2.2, Math.min(5, rowHeight / 3));
      c.fillStyle = past ? colours.muted : event.kind === 'bound' ? colours.challenger : colours.pair;
      c.strokeStyle = c.fillStyle;
      c.lineWidth = 1.5;
      c.beginPath();
      if (event.kind === 'bound') { c.moveTo(px, y - r); c.lineTo(px + r * 0.8, y); c.lineTo(px, y + r); c.lineTo(px - r * 0.8, y); c.closePath(); }
      else c.arc(px, y, r * 0.8, 0, 7);
      if (event.kind === 'boxes_separate') c.stroke(); else c.fill();
      if (chosen) { c.strokeStyle = colours.ink; c.lineWidth = 2; c.beginPath(); c.arc(px, y, r + 3.5, 0, 7); c.stroke(); }
      hits.current.push({px, y, when});
    };
    history.forEach((step, i) => {
      const row = rowOf(step.event);
      if (row >= 0)
        mark(step.event, {done: i}, top + (row + 0.5) * rowHeight, true, selection.event?.done === i);
    });
    at.queue.forEach((event, i) => {
      const row = rowOf(event);
      if (row >= 0 && event.time <= info.end) mark(event, {due: i}, top + (row + 0.5) * rowHeight, false, selection.event?.due && isSame(selection.event.due, event));
    });
    const now = x(at.time);
    c.strokeStyle = colours.ink;
    c.lineWidth = 1.5;
    line(c, now, 0, now, height - bottom + 3);
    c.fillStyle = colours.ink;
    c.beginPath();
    c.moveTo(now - 6, 0); c.lineTo(now + 6, 0); c.lineTo(now, 8);
    c.fill();
    c.restore();
  };

  const drawAxis = (c, {width, height, colours, bottom}) => {
    const y = height - bottom;
    c.strokeStyle = colours.muted;
    line(c, left, y, width - right, y);
    c.strokeStyle = colours.line;
    const inside = (t) => t >= shown.t0 && t <= shown.t1, some = frames.filter(inside);
    if (some.length < (width - left) / 3) for (const t of some) line(c, x(t), y, x(t), y + 3);
    c.strokeStyle = colours.ink;
    for (const t of info.keyframes) if (inside(t)) line(c, x(t), y - 3, x(t), y + 5);
    font(c, 11);
    c.textAlign = 'center';
    c.textBaseline = 'top';
    c.fillStyle = colours.muted;
    const marks = ticks(shown.t0, shown.t1, (width - left) / 90);
    const step = marks.length > 1 ? marks[1] - marks[0] : span;
    for (const t of marks) c.fillText(`${tickText(t, step)} s`, Math.min(width - 20, x(t)), y + 6);
  };

  const pick = ([px, py]) => {
    let best = null;
    for (const hit of hits.current) {
      const d = Math.hypot(hit.px - px, hit.y - py);
      if (d < 9 && (!best || d < best.d)) best = {...hit, d};
    }
    return best;
  };
  const onPointerDown = (event) => {
    const [px, py] = pointerAt(event), row = Math.floor((py - 6) / ((size.current[1] - 26) / rows.length));
    if (px < left - 4 && typeof rows[row]?.side === 'number') { lab.select({side: rows[row].side}); return; }
    const hit = pick([px, py]);
    if (hit) { chooseEvent(lab, hit.when); return; }
    dragging.current = true;
    event.currentTarget.setPointerCapture(event.pointerId);
    lab.pause();
    lab.seek(timeAt(pointerAt(event)[0]));
  };
  const onPointerMove = (event) => {
    if (dragging.current) { lab.seek(timeAt(pointerAt(event)[0])); return; }
    event.currentTarget.style.cursor = pick(pointerAt(event)) ? 'pointer' : 'ew-resize';
  };
  const onKeyDown = (event) => {
    const moves = {ArrowRight: 1, ArrowLeft: -1}, zooms = {'+': 0.6, '=': 0.6, '-': 1 / 0.6, 0: Infinity};
    if (zooms[event.key] && !event.ctrlKey && !event.altKey) { event.preventDefault(); event.stopPropagation(); zoomAt(at.time, zooms[event.key]); return; }
    if (!moves[event.key] || event.shiftKey || event.ctrlKey || event.altKey) return;
    event.preventDefault();
    event.stopPropagation();
    walk(lab, moves[event.key]);
  };
  const summary = `${history.length} events performed, ${at.queueLength ?? at.queue.length} scheduled` +
      (at.queue.length ? `; next: ${title(at.queue[0], info.bodies)} at ${when(at.queue[0]).text}` : '');
  return html`<${Canvas} draw=${draw} role="slider" tabIndex="0" data-view="timeline"
    aria-label="Event queue. Left and right arrow keys choose an event; plus and minus zoom, 0 shows the whole clip." aria-valuemin=${info.begin} aria-valuemax=${info.end}
    aria-valuenow=${at.time} aria-valuetext=${`${short(at.time)} s. ${summary}`} title=${summary} aria-busy=${phase === 'working'}
    onPointerDown=${onPointerDown} onPointerMove=${onPointerMove} onPointerUp=${() => { dragging.current = false; }}
    onDblClick=${(event) => { const hit = pick(pointerAt(event)); if (hit?.when.done !== undefined) lab.goToEvent(hit.when.done); }} onKeyDown=${onKeyDown}
    onWheel=${(event) => { event.preventDefault(); zoomAt(timeAt(pointerAt(event)[0]), event.deltaY > 0 ? 1.25 : 0.8); }} />`;
}

/** A zoomed window moves with the present time when that leaves it. */
function follow({t0, t1}, time, info) {
  if (time >= t0 && time <= t1) return {t0, t1};
  const wide = t1 - t0, from = Math.min(info.end - wide, Math.max(info.begin, time - wide / 4));
  return {t0: from, t1: from + wide};
}

/** Selects an event of the history ({done: index}) or of the queue ({due: index}), with its node and side. */
export function chooseEvent(lab, place) {
  const {history, at} = lab.state;
  const event = place.done !== undefined ? history[place.done]?.event : at.queue[place.due];
  if (!event) return;
  const chosen = place.done !== undefined ? {done: place.done} : {due: event};
  lab.select({body: event.body, node: event.node, event: chosen, ...(event.kind === 'bound' && event.side < 6 ? {side: event.side} : {})});
  if (lab.state.view.panel !== 'edit') lab.view({panel: 'why'});
}

/** Chooses the next or previous event in order of time, over history and queue. */
export function walk(lab, direction) {
  const {history, at, selection} = lab.state;
  const n = history.length, chosen = selection.event;
  let index = direction > 0 ? n - 1 : n;
  if (chosen?.done !== undefined) index = chosen.done;
  else if (chosen?.due) { const k = at.queue.findIndex((event) => isSame(event, chosen.due)); if (k >= 0) index = n + k; }
  index = Math.max(0, Math.min(n + at.queue.length - 1, index + direction));
  chooseEvent(lab, index < n ? {done: index} : {due: index - n});
}

function line(c, x0, y0, x1, y1) { c.beginPath(); c.moveTo(x0, y0); c.lineTo(x1, y1); c.stroke(); }
