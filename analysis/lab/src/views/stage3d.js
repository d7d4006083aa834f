/** The stage in space: three.js for meshes and boxes, a transparent canvas above it for names, pointer and keys. */
import {html, Canvas, coloursOf, drawNames, font, pointerAt, useEffect, useRef, useState} from './dom.js';
import {Space} from './space.js';
import {shownNodes} from './shown.js';
import {dragVertex, nudge} from './stage2d.js';

export function Stage3d({lab, state, source, which}) {
  const holder = useRef(null), space = useRef(null), drag = useRef(null);
  const [failed, setFailed] = useState(''), [, redraw] = useState(0);
  useEffect(() => {
    try {
      space.current = new Space(holder.current);
      space.current.afterRender = () => redraw((n) => n + 1);
    } catch (error) {
      setFailed(`This browser cannot draw in space (no WebGL): ${error.message}`);
      return undefined;
    }
    const scheme = matchMedia('(prefers-color-scheme: dark)');
    const again = () => redraw((n) => n + 1);
    scheme.addEventListener('change', again);
    return () => { scheme.removeEventListener('change', again); space.current.close(); space.current = null; };
  }, []);
  useEffect(() => {
    if (space.current && source.at && source.info) space.current.update(state, source, coloursOf(holder.current));
  }, [source.at, source.trees, source.lit, source.info, state.selection, state.view, state.scene]);
  if (failed) return html`<div class="empty">${failed}</div>`;
  const {selection, view, scene, precision} = state, {at, trees, lit} = source;
  const vertices = scene.bodies.reduce((sum, body) => sum + body.vertices, 0);

  const drawOverlay = (c, size) => {
    const {colours} = size;
    const s = space.current;
    if (!s?.info || s.info !== source.info) return;
    const tree = trees[selection.body];
    const realiser = tree && selection.node < tree.size ? tree.realiser(selection.node, selection.side) : null;
    const certificate = at.queue.find((e) => e.kind === 'bound' && e.body === selection.body && e.node === selection.node && e.side === selection.side);
    const names = [];
    const put = (b, v, colour, r) => {
      const p = at.positions[b], [x, y, depth] = s.project(p[3 * v], p[3 * v + 1], p[3 * v + 2]);
      if (depth > 1) return;
      if (r) { c.beginPath(); c.arc(x, y, r, 0, 7); c.fillStyle = colour; c.fill(); c.strokeStyle = colours.panel; c.lineWidth = 1.5; c.stroke(); }
      if (b === selection.body && v === selection.vertex) { c.strokeStyle = colours.ink; c.lineWidth = 2.5; c.beginPath(); c.arc(x, y, 10, 0, 7); c.stroke(); }
      names.push({x, y, text: String(v), colour, must: r > 0});
    };
    font(c, 12, 600);
    const special = [[realiser, colours.realiser], [certificate?.loser ?? null, colours.challenger], [selection.vertex, colours.ink]].filter(([v], i, all) => v !== null && all.findIndex(([other]) => other === v) === i);
    for (const [v, colour] of special) put(selection.body, v, colour, colour === colours.ink ? 4 : 6);
    if (view.labels && vertices <= 80)
      scene.bodies.forEach((body, b) => { for (let v = 0; v < body.vertices; ++v) if (b !== selection.body || special.every(([other]) => other !== v)) put(b, v, colours.muted, 0); });
    drawNames(c, names, size);
  };
  const pickVertex = ([px, py]) => {
    let best = null;
    at.positions.forEach((p, b) => {
      for (let v = 0; 3 * v < p.length; ++v) {
        const [x, y, depth] = space.current.project(p[3 * v], p[3 * v + 1], p[3 * v + 2]), d = Math.hypot(x - px, y - py);
        if (d < 11 && depth < 1 && (!best || d + 200 * depth < best.order)) best = {body: b, vertex: v, order: d + 200 * depth};
      }
    });
    return best;
  };
  const pickBox = (pixel) => {
    const ray = space.current.ray(pixel), o = ray.origin.toArray(), d = ray.direction.toArray();
    let best = null;
    trees.forEach((tree, b) => {
      if (!tree) return;
      for (const node of shownNodes(tree, b, view, selection, lit)) {
        let near = -Infinity, far = Infinity, side = 0;
        for (let axis = 0; axis < 3; ++axis) {
          const a = (tree.bound(node, 2 * axis) - o[axis]) / d[axis], z = (tree.bound(node, 2 * axis + 1) - o[axis]) / d[axis];
          if (Math.min(a, z) > near) { near = Math.min(a, z); side = a < z ? 2 * axis : 2 * axis + 1; }
          far = Math.min(far, Math.max(a, z));
        }
        if (near > far || far < 0) continue;
        const size = tree.extent(node);
        if (!best || size < best.size) best = {body: b, node, side, size};
      }
    });
    return best;
  };
  /** The overlay takes presses on vertices; everything else goes on to the camera's controls below it. */
  const onPointerDown = (event) => {
    const pixel = pointerAt(event), hit = pickVertex(pixel);
    drag.current = {from: pixel, hit};
    if (!hit) return;
    lab.select({body: hit.body, vertex: hit.vertex});
    if (view.edit && which === 'main') {
      event.stopPropagation();
      space.current.controls.enabled = false;
      event.currentTarget.setPointerCapture(event.pointerId);
      lab.pause();
      lab.editing.remember();
      const p = at.positions[hit.body];
      drag.current.through = [0, 1, 2].map((axis) => p[3 * hit.vertex + axis]);
    }
  };
  const onPointerMove = (event) => {
    const d = drag.current;
    if (!d?.through) return;
    const position = space.current.onPlane(pointerAt(event), d.through);
    if (position) dragVertex(lab, d.hit, position, precision);
  };
  const onPointerUp = (event) => {
    const d = drag.current, pixel = pointerAt(event);
    drag.current = null;
    space.current.controls.enabled = true;
    if (d && !d.hit && Math.hypot(pixel[0] - d.from[0], pixel[1] - d.from[1]) <= 3) { const box = pickBox(pixel); if (box) lab.select({body: box.body, node: box.node, side: box.side}); }
  };
  const onKeyDown = (event) => {
    const s = space.current;
    if (!s) return;
    if (event.shiftKey && event.key.startsWith('Arrow')) { if (view.edit) { event.preventDefault(); event.stopPropagation(); nudge(lab, event.key, s.box.getSize(s.controls.target.clone()).length() / 80, 3); } return; }
    const act = {'+': () => s.turn(0, 0, 0.85), '=': () => s.turn(0, 0, 0.85), '-': () => s.turn(0, 0, 1 / 0.85), '0': () => s.fit(), ArrowLeft: () => s.turn(-0.12, 0), ArrowRight: () => s.turn(0.12, 0), ArrowUp: () => s.turn(0, -0.1), ArrowDown: () => s.turn(0, 0.1)}[event.key];
    if (!act || event.ctrlKey || event.altKey) return;
    event.preventDefault();
    event.stopPropagation();
    act();
  };
  return html`<div class="space" ref=${holder} role="img" tabIndex="0" data-view="stage" onKeyDown=${onKeyDown}
      aria-label=${`${scene.name} in space at ${at.time.toFixed(4)} seconds. Arrow keys turn, plus and minus zoom, 0 shows all, v and Shift v choose a vertex.`}
      onPointerDownCapture=${onPointerDown} onPointerMove=${onPointerMove} onPointerUp=${onPointerUp} onDblClick=${() => space.current?.fit()}>
    <div class="overlay"><${Canvas} draw=${drawOverlay} aria-hidden="true" /></div>
  </div>`;
}
