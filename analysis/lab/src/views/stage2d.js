/** The scene in the plane: primitives, boxes, flight plans; points can be picked, and dragged while editing. */
import {html, Canvas, drawNames, font, pointerAt, ticks, tickText, usePinch, useRef, useState} from './dom.js';
import {isLit} from '../state/lit.js';
import {shownNodes} from './shown.js';
import {positionAt} from '../math/plans.js';
import {primitiveVertices} from '../math/hierarchy.js';
import {nearestKeyframe} from '../state/edit.js';

export function Stage2d({lab, state, source, which}) {
  const [zoom, setZoom] = useState(null);  // {x, y, scale}: middle and pixels per unit
  const frame = useRef(null), drag = useRef(null);
  const {scene, selection, view, info, precision} = state;
  const {at, trees, lit} = source;
  const whole = extent(scene);
  const place = ({width, height}) => {
    const scale = Math.min((width - 60) / Math.max(1e-9, whole.x1 - whole.x0), (height - 50) / Math.max(1e-9, whole.y1 - whole.y0));
    const z = zoom ?? {x: (whole.x0 + whole.x1) / 2, y: (whole.y0 + whole.y1) / 2, scale};
    return {...z, X: (x) => width / 2 + 14 + (x - z.x) * z.scale, Y: (y) => height / 2 - 8 - (y - z.y) * z.scale,
            backX: (px) => z.x + (px - width / 2 - 14) / z.scale, backY: (py) => z.y - (py - height / 2 + 8) / z.scale};
  };
  frame.current ??= {width: 300, height: 200, ...place({width: 300, height: 200})};  // until the first drawing
  const vertices = scene.bodies.reduce((sum, body) => sum + body.vertices, 0);
  const points = scene.bodies.every((body) => body.shape === 'points');
  const labels = view.labels && vertices <= (points ? 80 : 24);

  const draw = (c, size) => {
    frame.current = {...size, ...place(size)};
    const f = frame.current, {colours} = size;
    drawGrid(c, f, colours);
    if (view.paths && vertices <= (points ? 200 : 24)) drawPaths(c, f, colours);
    drawBoxes(c, f, colours);
    drawPrimitives(c, f, colours);
    drawPoints(c, f, colours);
  };

  const drawGrid = (c, {X, Y, backX, backY, width, height}, colours) => {
    font(c, 10);
    const xs = ticks(backX(0), backX(width), width / 70), ys = ticks(backY(height), backY(0), height / 60);
    const dx = xs.length > 1 ? xs[1] - xs[0] : 1, dy = ys.length > 1 ? ys[1] - ys[0] : 1;
    c.strokeStyle = colours.line; c.fillStyle = colours.muted; c.lineWidth = 1;
    c.globalAlpha = 0.6;
    for (const x of xs) stroke(c, X(x), 0, X(x), height);
    for (const y of ys) stroke(c, 0, Y(y), width, Y(y));
    c.globalAlpha = 1;
    c.textAlign = 'center'; c.textBaseline = 'bottom';
    for (const x of xs) if (X(x) > 24 && X(x) < width - 12) c.fillText(tickText(x, dx), X(x), height - 2);
    c.textAlign = 'left'; c.textBaseline = 'middle';
    for (const y of ys) if (Y(y) > 10 && Y(y) < height - 18) c.fillText(tickText(y, dy), 3, Y(y));
  };

  const drawPaths = (c, {X, Y}, colours) => {
    scene.bodies.forEach((body, b) => {
      for (let v = 0; v < body.vertices; ++v) {
        const chosen = b === selection.body && v === selection.vertex;
        c.strokeStyle = chosen ? colours.challenger : colours.muted;
        c.globalAlpha = chosen ? 1 : vertices > 40 ? 0.2 : 0.4;
        c.lineWidth = chosen ? 2 : 1;
        c.setLineDash(chosen ? [] : [3, 3]);
        c.beginPath();
        body.positions.forEach((p, k) => c[k ? 'lineTo' : 'moveTo'](X(p[3 * v]), Y(p[3 * v + 1])));
        c.stroke();
        if (chosen || vertices <= 16) {
          c.setLineDash([]);
          c.fillStyle = colours.panel;
          body.positions.forEach((p) => { c.beginPath(); c.arc(X(p[3 * v]), Y(p[3 * v + 1]), chosen ? 3.5 : 2, 0, 7); c.fill(); c.stroke(); });
        }
      }
    });
    c.globalAlpha = 1;
    c.setLineDash([]);
  };

  const drawBoxes = (c, {X, Y}, colours) => {
    trees.forEach((tree, b) => {
      if (!tree) return;
      const rect = (node) => [X(tree.bound(node, 0)), Y(tree.bound(node, 3)), X(tree.bound(node, 1)), Y(tree.bound(node, 2))];
      const nodes = shownNodes(tree, b, view, selection, lit), fill = nodes.filter((node) => isLit(lit, b, node)).length <= 5;
      for (const node of nodes) {
        const [x0, y0, x1, y1] = rect(node), chosen = b === selection.body && node === selection.node;
        if (fill && view.boxes !== 'side' && isLit(lit, b, node)) { c.fillStyle = colours.litSoft; c.globalAlpha = 0.45; c.fillRect(x0, y0, x1 - x0, y1 - y0); c.globalAlpha = 1; }
        c.strokeStyle = chosen ? colours.ink : colours.level(tree.depth[node]);
        c.lineWidth = chosen ? 3 : Math.max(1, 2.4 - 0.4 * tree.depth[node]);
        if (view.boxes !== 'side') c.strokeRect(x0, y0, x1 - x0, y1 - y0);
      }
      for (const node of nodes) {
        const [x0, y0, x1, y1] = rect(node), ends = [[x0, y0, x0, y1], [x1, y0, x1, y1], [x0, y1, x1, y1], [x0, y0, x1, y0]];
        for (let side = 0; side < 4; ++side) {
          const chosen = b === selection.body && node === selection.node && side === selection.side;
          const lone = view.boxes === 'side' && side === selection.side;
          if (view.boxes === 'side' && !lone) continue;
          if (!chosen && !lone && !isLit(lit, b, node, side)) continue;
          c.strokeStyle = chosen ? colours.realiser : isLit(lit, b, node, side) ? colours.lit : colours.level(tree.depth[node]);
          c.lineWidth = chosen ? 5 : lone ? Math.max(2, 5 - tree.depth[node]) : 4;
          stroke(c, ...ends[side]);
        }
      }
    });
  };

  const drawPrimitives = (c, {X, Y}, colours) => {
    const hitting = pairSets(at, scene.bodies.length), begun = pairSets({pairs: at.begun}, scene.bodies.length);
    info.bodies.forEach((body, b) => {
      if (body.shape === 'points') return;
      const p = at.positions[b], n = body.primitives;
      for (let primitive = 0; primitive < n; ++primitive) {
        const list = primitiveVertices(body, primitive), hit = hitting[b].has(primitive);
        c.beginPath();
        list.forEach((v, i) => c[i ? 'lineTo' : 'moveTo'](X(p[3 * v]), Y(p[3 * v + 1])));
        c.closePath();
        c.fillStyle = hit ? colours.pair : colours.body(b);
        c.globalAlpha = hit ? 0.75 : 0.35;
        c.fill();
        c.globalAlpha = 1;
        c.strokeStyle = begun[b].has(primitive) ? colours.lit : hit ? colours.pair : colours.body(b);
        c.lineWidth = begun[b].has(primitive) ? 3 : 1.25;
        c.stroke();
      }
    });
  };

  const drawPoints = (c, f, colours) => {
    const {X, Y} = f;
    const tree = trees[selection.body];
    const realiser = tree && selection.node < tree.size ? tree.realiser(selection.node, selection.side) : null;
    const certificate = at.queue.find((e) => e.kind === 'bound' && e.body === selection.body && e.node === selection.node && e.side === selection.side);
    font(c, 12, 600);
    const names = [];
    info.bodies.forEach((body, b) => {
      const p = at.positions[b];
      for (let v = 0; v < body.vertices; ++v) {
        const x = X(p[3 * v]), y = Y(p[3 * v + 1]), mine = b === selection.body;
        const role = mine && v === realiser ? colours.realiser : mine && v === certificate?.loser ? colours.challenger : null;
        c.fillStyle = role ?? (body.shape === 'points' ? colours.body(b) : colours.muted);
        c.beginPath(); c.arc(x, y, role ? 6 : body.shape === 'points' ? 4.5 : 2.6, 0, 7); c.fill();
        c.strokeStyle = colours.panel; c.lineWidth = 1.5; c.stroke();
        if (mine && v === selection.vertex) { c.strokeStyle = colours.ink; c.lineWidth = 2.5; c.beginPath(); c.arc(x, y, 10, 0, 7); c.stroke(); }
        const must = role !== null || (mine && v === selection.vertex);
        if (labels || must) names.push({x, y, text: String(v), colour: role ?? colours.ink, must});
      }
    });
    drawNames(c, names, f);
  };

  const pinch = usePinch((middle, factor) => zoomAt(middle, factor));
  const pickVertex = ([px, py]) => {
    const {X, Y} = frame.current;
    let best = null;
    info.bodies.forEach((body, b) => {
      const p = at.positions[b];
      for (let v = 0; v < body.vertices; ++v) {
        const d = Math.hypot(X(p[3 * v]) - px, Y(p[3 * v + 1]) - py);
        if (d < 12 && (!best || d < best.d)) best = {body: b, vertex: v, d};
      }
    });
    return best;
  };
  const pickBox = ([px, py]) => {
    const {backX, backY} = frame.current, x = backX(px), y = backY(py);
    let best = null;
    trees.forEach((tree, b) => {
      if (!tree) return;
      for (const node of shownNodes(tree, b, view, selection, lit)) {
        if (x < tree.bound(node, 0) || x > tree.bound(node, 1) || y < tree.bound(node, 2) || y > tree.bound(node, 3)) continue;
        const size = tree.extent(node);
        const ends = [x - tree.bound(node, 0), tree.bound(node, 1) - x, y - tree.bound(node, 2), tree.bound(node, 3) - y];
        if (!best || size < best.size) best = {body: b, node, side: ends.indexOf(Math.min(...ends)), size};
      }
    });
    return best;
  };
  const onPointerDown = (event) => {
    if (pinch.down(event)) { drag.current = null; return; }
    const p = pointerAt(event), hit = pickVertex(p);
    event.currentTarget.setPointerCapture(event.pointerId);
    if (hit) lab.select({body: hit.body, vertex: hit.vertex});
    if (hit && view.edit && which === 'main') {
      lab.pause();
      lab.editing.remember();
      drag.current = {kind: 'vertex', ...hit};
    } else drag.current = {kind: 'pan', p, from: p, hit, z: {x: frame.current.x, y: frame.current.y, scale: frame.current.scale}};
  };
  const onPointerMove = (event) => {
    if (pinch.move(event)) return;
    const p = pointerAt(event), d = drag.current;
    if (!d) { event.currentTarget.style.cursor = pickVertex(p) ? (view.edit ? 'move' : 'pointer') : 'grab'; return; }
    const f = frame.current;
    if (d.kind === 'vertex') dragVertex(lab, d, [f.backX(p[0]), f.backY(p[1]), 0], precision);
    else if (Math.hypot(p[0] - d.from[0], p[1] - d.from[1]) > 3) setZoom({scale: d.z.scale, x: d.z.x - (p[0] - d.from[0]) / d.z.scale, y: d.z.y + (p[1] - d.from[1]) / d.z.scale});
  };
  const onPointerUp = (event) => {
    pinch.up(event);
    const d = drag.current, p = pointerAt(event);
    drag.current = null;
    if (d?.kind === 'pan' && !d.hit && Math.hypot(p[0] - d.from[0], p[1] - d.from[1]) <= 3) { const box = pickBox(p); if (box) lab.select({body: box.body, node: box.node, side: box.side}); }
  };
  const zoomAt = ([px, py], factor) => {
    const f = frame.current, x = f.backX(px), y = f.backY(py), scale = f.scale * factor;
    setZoom({scale, x: x + (f.x - x) / factor, y: y + (f.y - y) / factor});
  };
  const onKeyDown = (event) => {
    const f = frame.current, step = 40 / f.scale, middle = [f.width / 2, f.height / 2];
    if (event.shiftKey && event.key.startsWith('Arrow')) { if (view.edit) { event.preventDefault(); event.stopPropagation(); nudge(lab, event.key, 8 / f.scale, 2); } return; }
    const act = {'+': () => zoomAt(middle, 1.25), '=': () => zoomAt(middle, 1.25), '-': () => zoomAt(middle, 0.8), '0': () => setZoom(null),
                 ArrowLeft: () => setZoom({...f, x: f.x - step}), ArrowRight: () => setZoom({...f, x: f.x + step}),
                 ArrowUp: () => setZoom({...f, y: f.y + step}), ArrowDown: () => setZoom({...f, y: f.y - step})}[event.key];
    if (!act || event.ctrlKey || event.altKey) return;
    event.preventDefault();
    event.stopPropagation();
    act();
  };
  return html`<${Canvas} draw=${draw} role="img" tabIndex="0" data-view="stage" aria-label=${`${scene.name} in the plane at ${at.time.toFixed(4)} seconds. Plus and minus zoom, arrows move, 0 shows all, v and Shift v choose a vertex.`}
    onPointerDown=${onPointerDown} onPointerMove=${onPointerMove} onPointerUp=${onPointerUp} onPointerCancel=${onPointerUp} onKeyDown=${onKeyDown}
    onWheel=${(event) => { event.preventDefault(); zoomAt(pointerAt(event), event.deltaY > 0 ? 1 / 1.15 : 1.15); }} onDblClick=${() => setZoom(null)} />`;
}

/** Moves the chosen vertex to a position: its nearest keyframe, or its whole plan. */
export function dragVertex(lab, {body, vertex}, position, precision) {
  const {scene, at, view} = lab.state;
  const now = positionAt(scene.bodies[body], vertex, at.time, precision);
  const by = position.map((x, axis) => x - now[axis]);
  if (view.drag === 'plan') lab.editing.apply('shiftPlan', {body, vertex, by}, {remember: false});
  else {
    const keyframe = nearestKeyframe(scene.bodies[body], at.time), p = scene.bodies[body].positions[keyframe];
    const tidy = (x) => Math.round(x * 1024) / 1024;
    const share = shareOf(scene.bodies[body].times, keyframe, at.time);
    const target = share === 1 ? position : [0, 1, 2].map((axis) => p[3 * vertex + axis] + by[axis] / share);
    lab.editing.apply('setKeyframe', {body, vertex, keyframe, position: target.map(tidy)}, {remember: false});
  }
}

/** How much of a keyframe's move a vertex makes at time t: 1 at the keyframe, 1/2 half-way to the next one. */
function shareOf(times, keyframe, t) {
  const next = times[keyframe + Math.sign(t - times[keyframe])];
  return t === times[keyframe] || next === undefined ? 1 : 1 - Math.abs(t - times[keyframe]) / Math.abs(next - times[keyframe]);
}

/** Moves the chosen vertex by a small step: Shift and an arrow key (Page keys for z). */
export function nudge(lab, key, step, dimension) {
  const {selection, scene, at, precision} = lab.state;
  if (selection.vertex === null) { lab.say('Choose a vertex first: v.'); return; }
  const move = {ArrowLeft: [-step, 0, 0], ArrowRight: [step, 0, 0], ArrowUp: dimension === 2 ? [0, step, 0] : [0, 0, step], ArrowDown: dimension === 2 ? [0, -step, 0] : [0, 0, -step]}[key];
  const now = positionAt(scene.bodies[selection.body], selection.vertex, at.time, precision);
  lab.editing.remember();
  dragVertex(lab, selection, now.map((x, axis) => x + move[axis]), precision);
}

/** For each body the primitives that occur in pairs. */
export function pairSets(at, bodies) {
  const sets = Array.from({length: bodies}, () => new Set());
  const pairs = at.pairs ?? [];
  for (let i = 0; i + 3 < pairs.length; i += 4) { sets[pairs[i]]?.add(pairs[i + 1]); sets[pairs[i + 2]]?.add(pairs[i + 3]); }
  return sets;
}

const extents = new WeakMap();
function extent(scene) {
  let found = extents.get(scene);
  if (found) return found;
  found = {x0: Infinity, x1: -Infinity, y0: Infinity, y1: -Infinity};
  for (const body of scene.bodies)
    for (const p of body.positions)
      for (let i = 0; i < p.length; i += 3) {
        found.x0 = Math.min(found.x0, p[i]); found.x1 = Math.max(found.x1, p[i]);
        found.y0 = Math.min(found.y0, p[i + 1]); found.y1 = Math.max(found.y1, p[i + 1]);
      }
  if (found.x1 - found.x0 < 1e-6) { found.x0 -= 1; found.x1 += 1; }
  if (found.y1 - found.y0 < 1e-6) { found.y0 -= 1; found.y1 += 1; }
  extents.set(scene, found);
  return found;
}

function stroke(c, x0, y0, x1, y1) { c.beginPath(); c.moveTo(x0, y0); c.lineTo(x1, y1); c.stroke(); }
