/**
 * The value-time diagram of one side of one node: every vertex below the node as a line, the envelope that the bound must
 * follow, the present certificate, and the events where lines cross. Wheel or + and - zoom, dragging moves.
 */
import {html, Canvas, font, haloText, pointerAt, ticks, tickText, Unfilled, useMemo, usePinch, useRef, useState} from './dom.js';
import {envelope} from '../math/envelope.js';
import {axisNames, axisOf, isUpper, sideName, valueAt} from '../math/plans.js';
import {linesBelow} from '../text/tenure.js';
import {isSame, when} from '../text/why.js';
import {short} from '../math/exact.js';
import {chooseEvent} from './timeline.js';

const left = 52, right = 40, top = 14, bottom = 36;
const manyLines = 500;

export function Diagram({lab, state}) {
  const {trees, selection, scene, info, at, history, precision} = state;
  const [zoom, setZoom] = useState(null);  // {t0, t1, v0, v1}
  const pinch = usePinch((middle, factor) => zoomAt(middle, 1 / factor));
  const hits = useRef([]), drag = useRef(null), frame = useRef({width: 400, height: 300}), hover = useRef(null);
  const tree = trees[selection.body], {node, side} = selection;
  const known = tree && node < tree.size;
  const total = known ? tree.verticesBelow(node).length : 0, few = total <= manyLines;
  const always = !known || few ? [] : specialVertices(tree, node, side, selection.vertex, at?.queue ?? []);
  const lines = useMemo(() => known ? linesBelow(scene, tree, node, side, precision, few ? Infinity : manyLines / 2, always) : [], [scene, known && tree.childStart, node, side, precision, always.join()]);
  const pieces = useMemo(() => few && info ? envelope(lines, isUpper(side), info.begin, info.end) : [], [lines, info]);
  const whole = useMemo(() => extent(lines, info), [lines, info]);
  if (!known || !at) return at && !tree ? html`<${Unfilled} lab=${lab} why="This strategy keeps no tree, so there is no box whose side could be drawn." would="With one, each vertex below the chosen node is a line here, and the bound follows the outermost of them." />`
    : html`<div class="empty">Choose a node that has a box.</div>`;
  const view = zoom ?? whole;
  const axis = axisNames[axisOf(side)];
  const realiser = tree.realiser(node, side);
  const certificate = at.queue.find((event) => event.kind === 'bound' && event.body === selection.body && event.node === node && event.side === side);
  const fromBelow = below(tree, at.queue, node, side, realiser, certificate);
  const candidates = new Set(tree.isLeaf(node) ? [] : Array.from(tree.kids(node), (kid) => tree.realiser(kid, side)));
  const done = history.filter((step) => step.event.kind === 'bound' && step.event.side === side && step.touched.some((c) => c.body === selection.body && c.node === node));

  const draw = (c, {width, height, colours}) => {
    const X = (t) => left + (t - view.t0) / (view.t1 - view.t0) * (width - left - right);
    const Y = (v) => top + (view.v1 - v) / (view.v1 - view.v0) * (height - top - bottom);
    frame.current = {width, height};
    hits.current = [];
    drawAxes(c, {width, height, colours, X, Y});
    c.save();
    c.beginPath();
    c.rect(left, top, width - left - right, height - top - bottom);
    c.clip();
    const stroke = (line, colour, weight, dash = []) => {
      c.strokeStyle = colour; c.lineWidth = weight; c.setLineDash(dash);
      c.beginPath();
      let started = false;
      const point = (t, v) => { if (started) c.lineTo(X(t), Y(v)); else { c.moveTo(X(t), Y(v)); started = true; } };
      point(Math.min(view.t0, line.times[0]), line.values[0]);
      line.times.forEach((t, k) => point(t, line.values[k]));
      point(Math.max(view.t1, line.times[line.times.length - 1]), line.values[line.values.length - 1]);
      c.stroke();
      c.setLineDash([]);
    };
    const special = (id) => id === realiser || id === certificate?.loser || id === selection.vertex;
    c.globalAlpha = lines.length > 60 ? 0.35 : 0.75;
    for (const line of lines) if (!special(line.id)) stroke(line, candidates.has(line.id) ? colours.ink : colours.muted, candidates.has(line.id) ? 1.4 : 1);
    c.globalAlpha = 1;
    drawEnvelope(c, {colours, X, Y});
    for (const line of lines) {
      if (line.id === realiser) stroke(line, colours.realiser, 2.5);
      else if (line.id === certificate?.loser) stroke(line, colours.challenger, 2.5, [7, 4]);
      else if (line.id === selection.vertex) stroke(line, colours.ink, 2, [2, 3]);
    }
    if (state.view.edit && few)
      for (const l of lines) {
        c.fillStyle = colours.panel;
        c.strokeStyle = l.id === selection.vertex ? colours.ink : colours.muted;
        c.lineWidth = 1.5;
        l.times.forEach((t, k) => { c.beginPath(); c.rect(X(t) - 3.5, Y(l.values[k]) - 3.5, 7, 7); c.fill(); c.stroke(); });
      }
    drawEvents(c, {colours, X, Y, height});
    const now = X(at.time);
    c.strokeStyle = colours.ink; c.lineWidth = 1.25;
    c.beginPath(); c.moveTo(now, 0); c.lineTo(now, height); c.stroke();
    const bound = tree.bound(node, side);
    c.fillStyle = colours.realiser; c.strokeStyle = colours.panel; c.lineWidth = 2;
    c.beginPath(); c.arc(now, Y(bound), 5, 0, 7); c.fill(); c.stroke();
    c.restore();
    drawLabels(c, {width, height, colours, X, Y});
    drawTenures(c, {width, height, colours, X});
    if (!few) { font(c, 11); c.textAlign = 'left'; haloText(c, `${lines.length} of ${total} vertices drawn, no envelope: choose a smaller node`, left + 4, top + 8, colours.muted, colours.panel); }
  };

  const drawAxes = (c, {width, height, colours, X, Y}) => {
    font(c, 11);
    c.lineWidth = 1;
    const times = ticks(view.t0, view.t1, (width - left - right) / 80), values = ticks(view.v0, view.v1, (height - top - bottom) / 42);
    const dt = times.length > 1 ? times[1] - times[0] : 1, dv = values.length > 1 ? values[1] - values[0] : 1;
    c.strokeStyle = colours.line; c.fillStyle = colours.muted;
    c.textAlign = 'center'; c.textBaseline = 'top';
    for (const t of times) { line(c, X(t), top, X(t), height - bottom); c.fillText(tickText(t, dt), X(t), height - bottom + 16); }
    c.textAlign = 'right'; c.textBaseline = 'middle';
    for (const v of values) { line(c, left, Y(v), width - right, Y(v)); if (Y(v) > top + 7) c.fillText(tickText(v, dv), left - 6, Y(v)); }
    c.textAlign = 'left'; c.textBaseline = 'top';
    c.fillText('t, s', 6, height - bottom + 16);
    c.fillStyle = colours.ink;
    font(c, 12, 600);
    c.fillText(`${axis}, units`, 6, 1);
    c.strokeStyle = colours.muted; c.setLineDash([1, 3]);
    for (const t of info.keyframes) if (t > view.t0 && t < view.t1) line(c, X(t), top, X(t), height - bottom);
    c.setLineDash([]);
  };

  /** The envelope as a wide soft band. */
  const drawEnvelope = (c, {colours, X, Y}) => {
    if (!pieces.length) return;
    const byId = new Map(lines.map((l) => [l.id, l]));
    c.strokeStyle = colours.litSoft; c.lineWidth = 9; c.lineJoin = 'round'; c.lineCap = 'round';
    c.beginPath();
    pieces.forEach((piece, i) => {
      const l = byId.get(piece.id);
      const put = (t) => c.lineTo(X(t), Y(valueAt(l, t)));
      if (!i) c.moveTo(X(piece.begin), Y(valueAt(l, piece.begin)));
      put(piece.begin);
      for (const t of l.times) if (t > piece.begin && t < piece.end) put(t);
      put(piece.end);
    });
    c.stroke();
  };

  const drawEvents = (c, {colours, X, Y, height}) => {
    const mark = (event, place, colour, filled) => {
      const l = lines.find((candidate) => candidate.id === event.winner);
      if (!l) return;
      const x = X(event.time), y = Y(valueAt(l, event.time));
      c.beginPath(); c.arc(x, y, 5.5, 0, 7);
      c.fillStyle = filled ? colour : colours.panel; c.fill();
      c.strokeStyle = colour; c.lineWidth = 2; c.stroke();
      if (selection.event && (place.done !== undefined ? selection.event.done === place.done : selection.event.due && isSame(selection.event.due, event))) {
        c.strokeStyle = colours.ink; c.beginPath(); c.arc(x, y, 10, 0, 7); c.stroke();
      }
      hits.current.push({x, y, place});
    };
    for (const step of done) mark(step.event, {done: step.index}, colours.muted, true);
    if (certificate) {
      c.strokeStyle = colours.challenger; c.setLineDash([3, 3]); c.lineWidth = 1.25;
      line(c, X(certificate.time), top, X(certificate.time), height - bottom);
      c.setLineDash([]);
      mark(certificate, {due: at.queue.indexOf(certificate)}, colours.challenger, false);
    }
    if (fromBelow) mark(fromBelow, {due: at.queue.indexOf(fromBelow)}, colours.ink, false);
  };

  /** Names of the lines at their right ends, kept apart. */
  const drawLabels = (c, {width, height, colours, X, Y}) => {
    font(c, 11, 600);
    c.textAlign = 'left'; c.textBaseline = 'middle';
    const t = Math.min(view.t1, Math.max(info.end, view.t0));
    const wanted = lines.filter((l) => lines.length <= 16 || l.id === realiser || l.id === certificate?.loser || l.id === selection.vertex)
        .map((l) => ({id: l.id, y: Y(valueAt(l, t))})).filter(({y}) => y > top - 8 && y < height - bottom + 8).sort((a, b) => a.y - b.y);
    let last = -Infinity;
    for (const label of wanted) {
      label.y = Math.max(label.y, last + 12);
      last = label.y;
      const colour = label.id === realiser ? colours.realiser : label.id === certificate?.loser ? colours.challenger : colours.muted;
      haloText(c, `v${label.id}`, Math.min(X(t), width - right) + 5, Math.min(label.y, height - bottom + 6), colour, colours.panel);
    }
    font(c, 11);
    c.textAlign = 'left';
    if (certificate && X(certificate.time) > left && X(certificate.time) < width - right) {
      const text = fitting(c, width - left - right - 10, `v${certificate.loser} overtakes v${certificate.winner}: ${when(certificate).text}`, `v${certificate.loser} overtakes v${certificate.winner}`);
      const x = Math.min(X(certificate.time) + 6, width - right - 8 - c.measureText(text).width);
      haloText(c, text, Math.max(left + 2, x), height - bottom - 8, colours.challenger, colours.panel);
    }
    if (fromBelow && X(fromBelow.time) > left && X(fromBelow.time) < width - right) {
      const first = certificate ? 'before that' : 'next', short = `v${fromBelow.loser} takes over in node ${fromBelow.node}`;
      const text = fitting(c, width - left - right - 10, `${first}, from below: ${short}`, `${first}: ${short}`, short);
      const x = Math.min(X(fromBelow.time) + 6, width - right - 8 - c.measureText(text).width);
      haloText(c, text, Math.max(left + 2, x), height - bottom - 24, colours.ink, colours.panel);
    }
  };

  /** The strip below: which vertex realises the side, and when. */
  const drawTenures = (c, {width, height, colours, X}) => {
    const y = height - bottom + 3, h = 10;
    c.save();
    c.beginPath(); c.rect(left, y, width - left - right, h + 1); c.clip();
    font(c, 9);
    c.textBaseline = 'middle'; c.textAlign = 'center';
    pieces.forEach((piece, i) => {
      const x0 = X(piece.begin), x1 = X(piece.end);
      c.fillStyle = piece.id === realiser ? colours.realiser : i % 2 ? colours.muted : colours.ink;
      c.globalAlpha = piece.id === realiser ? 1 : 0.55;
      c.fillRect(x0 + 0.5, y, Math.max(1, x1 - x0 - 1), h);
      c.globalAlpha = 1;
      if (x1 - x0 > 24) { c.fillStyle = colours.panel; c.fillText(`v${piece.id}`, (x0 + x1) / 2, y + h / 2 + 0.5); }
    });
    c.restore();
  };

  const zoomAt = ([x, y], factor, both = true) => {
    const {width, height} = frame.current;
    const t = view.t0 + (x - left) / (width - left - right) * (view.t1 - view.t0), v = view.v1 - (y - top) / (height - top - bottom) * (view.v1 - view.v0);
    const smallest = Math.max(Math.abs(t), 1e-300) * 1e-14;
    if ((view.t1 - view.t0) * factor < smallest && factor < 1) return;
    setZoom({t0: t + (view.t0 - t) * factor, t1: t + (view.t1 - t) * factor, v0: both ? v + (view.v0 - v) * factor : view.v0, v1: both ? v + (view.v1 - v) * factor : view.v1});
  };
  const shift = (dx, dy) => {
    const {width, height} = frame.current;
    const dt = dx / (width - left - right) * (view.t1 - view.t0), dv = dy / (height - top - bottom) * (view.v1 - view.v0);
    setZoom({t0: view.t0 - dt, t1: view.t1 - dt, v0: view.v0 + dv, v1: view.v1 + dv});
  };
  const pickEvent = ([x, y]) => hits.current.find((hit) => Math.hypot(hit.x - x, hit.y - y) < 11);
  const pickLine = ([x, y]) => {
    const {width, height} = frame.current;
    const t = view.t0 + (x - left) / (width - left - right) * (view.t1 - view.t0);
    let best = null;
    for (const l of lines) {
      const d = Math.abs(top + (view.v1 - valueAt(l, t)) / (view.v1 - view.v0) * (height - top - bottom) - y);
      if (d < 7 && (!best || d < best.d)) best = {id: l.id, d};
    }
    return best?.id ?? null;
  };
  /** The keyframe of a line under the pointer, while editing. */
  const pickKnot = ([x, y]) => {
    if (!state.view.edit || !few) return null;
    const {width, height} = frame.current;
    let best = null;
    for (const l of lines)
      l.times.forEach((t, keyframe) => {
        const px = left + (t - view.t0) / (view.t1 - view.t0) * (width - left - right), py = top + (view.v1 - l.values[keyframe]) / (view.v1 - view.v0) * (height - top - bottom);
        const d = Math.hypot(px - x, py - y) - (l.id === selection.vertex ? 4 : 0);
        if (d < 10 && (!best || d < best.d)) best = {vertex: l.id, keyframe, d};
      });
    return best;
  };
  /** Moves a knot of a flight plan to the height of the pointer. */
  const dragKnot = ({vertex, keyframe}, [, y]) => {
    const {height} = frame.current, value = view.v1 - (y - top) / (height - top - bottom) * (view.v1 - view.v0);
    const p = lab.state.scene.bodies[selection.body].positions[keyframe], which = axisOf(side);
    const position = [0, 1, 2].map((a) => a === which ? Math.round(value * 256) / 256 : p[3 * vertex + a]);
    lab.editing.apply('setKeyframe', {body: selection.body, vertex, keyframe, position}, {remember: false});
  };
  const onKeyDown = (event) => {
    const {width, height} = frame.current;
    const middle = certificate && event.altKey ? null : [(left + width - right) / 2, (top + height - bottom) / 2];
    const act = {'+': () => zoomAt(middle, 0.7), '=': () => zoomAt(middle, 0.7), '-': () => zoomAt(middle, 1 / 0.7), '0': () => setZoom(null),
                 ArrowLeft: () => shift(40, 0), ArrowRight: () => shift(-40, 0), ArrowUp: () => shift(0, 40), ArrowDown: () => shift(0, -40), c: () => toEvent()}[event.key];
    if (!act || event.ctrlKey || event.altKey || event.shiftKey) return;
    event.preventDefault();
    event.stopPropagation();
    act();
  };
  /** Zooms on the crossing of the present certificate. */
  const toEvent = () => {
    if (!certificate) return;
    const l = lines.find((candidate) => candidate.id === certificate.winner), v = valueAt(l, certificate.time);
    const dt = (whole.t1 - whole.t0) / 20, dv = (whole.v1 - whole.v0) / 20;
    setZoom({t0: certificate.time - dt, t1: certificate.time + dt, v0: v - dv, v1: v + dv});
  };
  const label = `Value-time diagram: ${sideName(side)} side of node ${node}, ${total} vertices. ` +
      (realiser === null ? '' : `Vertex ${realiser} leads. `) + (certificate ? `Vertex ${certificate.loser} overtakes at ${when(certificate).text}.` : 'No overtaking is scheduled.');
  return html`<${Canvas} draw=${draw} role="img" tabIndex="0" data-view="diagram" aria-label=${`${label} Plus and minus zoom, 0 shows all, c shows the crossing.`}
      onKeyDown=${onKeyDown} onWheel=${(event) => { event.preventDefault(); zoomAt(pointerAt(event), event.deltaY > 0 ? 1.2 : 1 / 1.2, !event.shiftKey); }}
      onPointerDown=${(event) => { if (pinch.down(event)) { drag.current = null; return; } const p = pointerAt(event), hit = pickEvent(p); const knot = pickKnot(p);
        if (knot) { setZoom(view); lab.pause(); lab.editing.remember(); lab.select({vertex: knot.vertex}); drag.current = {knot, p, from: p}; event.currentTarget.setPointerCapture(event.pointerId); return; }
        if (hit) { chooseEvent(lab, hit.place); return; } drag.current = {p, from: p}; event.currentTarget.setPointerCapture(event.pointerId); }}
      onPointerMove=${(event) => { if (pinch.move(event)) return; const p = pointerAt(event); if (drag.current?.knot) { dragKnot(drag.current.knot, p); return; } if (drag.current) { shift(p[0] - drag.current.p[0], p[1] - drag.current.p[1]); drag.current.p = p; return; }
        const id = pickLine(p); if (id !== hover.current) { hover.current = id; event.currentTarget.title = id === null ? '' : `vertex ${id}`; } event.currentTarget.style.cursor = pickKnot(p) ? 'ns-resize' : pickEvent(p) ? 'pointer' : id !== null ? 'pointer' : 'grab'; }}
      onPointerCancel=${(event) => { pinch.up(event); drag.current = null; }}
      onPointerUp=${(event) => { pinch.up(event); const p = pointerAt(event), d = drag.current; drag.current = null; if (d && !d.knot && Math.hypot(p[0] - d.from[0], p[1] - d.from[1]) < 4) { setZoom(zoom); const id = pickLine(p); if (id !== null) lab.select({vertex: id}); } }}
      onDblClick=${() => setZoom(null)} />
    <div class="diagram-tools"><button onClick=${toEvent} disabled=${!certificate} title="Zoom on the crossing (c)">crossing</button>
      <button onClick=${() => setZoom(null)} disabled=${!zoom} title="Show all (0)">all</button></div>`;
}

/** Vertices that must be drawn: the realisers of a node and its children, the certificate's loser, the chosen vertex. */
function specialVertices(tree, node, side, vertex, queue) {
  const below = tree.isLeaf(node) ? [] : Array.from(tree.kids(node), (kid) => tree.realiser(kid, side));
  const loser = queue.find((event) => event.kind === 'bound' && event.body === tree.body && event.node === node && event.side === side)?.loser;
  return [tree.realiser(node, side), ...below, loser ?? null, vertex].filter((v) => v !== null);
}

/** The first scheduled event of a node below that will change this side before its own certificate fails; or null. */
function below(tree, queue, node, side, realiser, certificate) {
  if (realiser === null) return null;
  for (const event of queue) {
    if (event === certificate) return null;
    if (event.kind !== 'bound' || event.body !== tree.body || event.side !== side || event.winner !== realiser || event.node === node) continue;
    for (let n = event.node; ; n = tree.parent[n]) { if (n === node) return event; if (n === 0) break; }
  }
  return null;
}

/** The part of the plane that shows all lines over the clip, with a margin. */
function extent(lines, info) {
  let v0 = Infinity, v1 = -Infinity;
  for (const {values} of lines) for (const v of values) { v0 = Math.min(v0, v); v1 = Math.max(v1, v); }
  if (!(v1 > v0)) { v0 = (Number.isFinite(v0) ? v0 : 0) - 0.5; v1 = v0 + 1; }
  const dv = (v1 - v0) * 0.07, {begin = 0, end = 1} = info ?? {}, dt = (end - begin || 1) * 0.015;
  return {t0: begin - dt, t1: end + dt, v0: v0 - dv, v1: v1 + dv};
}

/** The first of the texts that is not wider than `width`; the last one, if all are. */
const fitting = (c, width, ...texts) => texts.find((text) => c.measureText(text).width <= width) ?? texts.at(-1);

function line(c, x0, y0, x1, y1) { c.beginPath(); c.moveTo(x0, y0); c.lineTo(x1, y1); c.stroke(); }
