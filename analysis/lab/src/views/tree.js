/**
 * The hierarchy. Small trees are drawn as boxes with lines, large ones as strips whose width is the number of primitives.
 * Each node names the realiser of the chosen side; nodes that just changed are lit.
 */
import {html, Canvas, font, haloText, pointerAt, Unfilled, useRef} from './dom.js';
import {isLit} from '../state/lit.js';
import {sideName} from '../math/plans.js';
import {plainNode} from './box.js';

/** Places of the nodes: {x, width} in units of leaves, by node. Cached by the tree's structure. */
const layouts = new WeakMap();
export function layout(tree) {
  let found = layouts.get(tree.childStart);
  if (found) return found;
  const x = new Float64Array(tree.size), width = new Float64Array(tree.size);
  let leaves = 0;
  const stack = [[0, 0]];
  const order = [];
  while (stack.length) { const [node] = stack.pop(); order.push(node); const kids = tree.kids(node); for (let i = kids.length - 1; i >= 0; --i) stack.push([kids[i]]); }
  for (const node of order) if (tree.isLeaf(node)) { x[node] = leaves++; width[node] = 1; }
  for (let i = order.length - 1; i >= 0; --i) {
    const node = order[i];
    if (tree.isLeaf(node)) continue;
    const kids = tree.kids(node);
    x[node] = x[kids[0]];
    for (const kid of kids) width[node] += width[kid];
  }
  found = {x, width, leaves, levels: tree.levels};
  layouts.set(tree.childStart, found);
  return found;
}

export function TreeView({lab, state, which = 'main'}) {
  const source = which === 'main' ? state : state.compare;
  const {selection, scene} = state, lit = source?.lit;
  const hits = useRef([]);
  const tree = source?.trees?.[selection.body];
  if (!tree) return source?.at ? html`<${Unfilled} lab=${lab} why="This strategy keeps no tree." would="With one, each node stands here with the vertex that holds the chosen side of its box." />` : html`<div class="empty">…</div>`;
  const plan = layout(tree);

  const draw = (c, {width, height, colours}) => {
    hits.current = [];
    const unit = (width - 12) / plan.leaves, rowHeight = Math.min(64, (height - 10) / plan.levels);
    const place = (node) => ({x: 6 + (plan.x[node] + plan.width[node] / 2) * unit, y: 5 + (tree.depth[node] + 0.5) * rowHeight});
    const onPath = new Set(selection.node < tree.size ? tree.pathUp(selection.node) : []);
    if (unit >= 26 && rowHeight >= 26) drawBoxes(c, {unit, rowHeight, place, onPath, colours});
    else drawStrips(c, {unit, rowHeight, colours, onPath});
  };

  const drawBoxes = (c, {unit, rowHeight, place, onPath, colours}) => {
    const widthOf = (node) => Math.min(54, plan.width[node] * unit - 5), h = Math.min(34, rowHeight - 9), two = h >= 27 && tree.realisers;
    for (let node = 1; node < tree.size; ++node) {
      const a = place(tree.parent[node]), b = place(node);
      c.strokeStyle = onPath.has(node) ? colours.ink : colours.line;
      c.lineWidth = onPath.has(node) ? 2 : 1.25;
      c.beginPath(); c.moveTo(a.x, a.y + h / 2); c.lineTo(b.x, b.y - h / 2); c.stroke();
    }
    for (let node = 0; node < tree.size; ++node) {
      const {x, y} = place(node), w = widthOf(node), chosen = node === selection.node, on = isLit(lit, tree.body, node);
      c.beginPath();
      c.roundRect(x - w / 2, y - h / 2, w, h, tree.isLeaf(node) ? 3 : 8);
      c.fillStyle = on ? colours.litSoft : colours.panel;
      c.fill();
      c.strokeStyle = chosen ? colours.ink : on ? colours.lit : colours.level(tree.depth[node]);
      c.lineWidth = chosen ? 3 : on ? 2.5 : 1.5;
      c.stroke();
      c.textAlign = 'center';
      c.textBaseline = 'middle';
      const v = tree.realiser(node, selection.side);
      font(c, 11, chosen ? 700 : 400);
      c.fillStyle = colours.ink;
      const one = !two && tree.realisers && v !== null && w >= 44;  // no room for two lines
      c.fillText(one ? `${node}  v${v}` : String(node), x, two ? y - 7 : y);
      if (two) {
        font(c, 11, 600);
        c.fillStyle = v !== null && v === selection.vertex ? colours.challenger : colours.realiser;
        c.fillText(v === null ? '·' : `v${v}`, x, y + 8);
      }
      hits.current.push({node, x0: x - w / 2, x1: x + w / 2, y0: y - h / 2, y1: y + h / 2});
    }
  };

  const drawStrips = (c, {unit, rowHeight, colours, onPath}) => {
    const h = Math.max(1, rowHeight - Math.min(3, rowHeight / 5));
    for (let node = 0; node < tree.size; ++node) {
      const w = plan.width[node] * unit, x0 = 6 + plan.x[node] * unit, y0 = 5 + tree.depth[node] * rowHeight;
      if (w < 0.4 && plan.x[node] % Math.ceil(0.4 / unit)) continue;
      const on = isLit(lit, tree.body, node), gap = w > 5 ? 1 : 0;
      c.fillStyle = on ? colours.lit : colours.level(tree.depth[node]);
      c.globalAlpha = on ? 1 : onPath.has(node) ? 0.6 : 0.3;
      c.fillRect(x0, y0, Math.max(0.5, w - gap), h);
      c.globalAlpha = 1;
      if (w > 30 && h > 11) {
        font(c, 11);
        c.textAlign = 'center';
        c.textBaseline = 'middle';
        const v = tree.realiser(node, selection.side);
        haloText(c, w > 64 && v !== null ? `${node}: v${v}` : String(node), x0 + w / 2, y0 + h / 2, colours.ink, on ? colours.litSoft : colours.panel);
      }
      hits.current.push({node, x0, x1: x0 + Math.max(1, w), y0, y1: y0 + h});
    }
    const node = selection.node, w = Math.max(3, plan.width[node] * unit);
    c.strokeStyle = colours.ink;
    c.lineWidth = 2.5;
    c.strokeRect(6 + plan.x[node] * unit, 5 + tree.depth[node] * rowHeight, w, h);
  };

  const pick = ([x, y]) => hits.current.findLast((hit) => x >= hit.x0 && x <= hit.x1 && y >= hit.y0 && y <= hit.y1);
  const onKeyDown = (event) => {
    const node = selection.node, kids = tree.kids(node);
    const siblings = node === 0 ? [0] : Array.from(tree.kids(tree.parent[node])), i = siblings.indexOf(node);
    const next = {ArrowUp: tree.parent[node], ArrowDown: kids[0] ?? node, ArrowLeft: siblings[i - 1] ?? level(-1), ArrowRight: siblings[i + 1] ?? level(1)}[event.key];
    if (next === undefined || event.shiftKey || event.ctrlKey || event.altKey) return;
    event.preventDefault();
    event.stopPropagation();
    lab.select({node: next});
  };
  /** The neighbour on the same level, across parents. */
  const level = (direction) => {
    let best = selection.node;
    for (let node = 0; node < tree.size; ++node)
      if (tree.depth[node] === tree.depth[selection.node] && direction * (plan.x[node] - plan.x[selection.node]) > 0 &&
          (best === selection.node || direction * (plan.x[node] - plan.x[best]) < 0)) best = node;
    return best;
  };
  return html`<${Canvas} draw=${draw} role="tree" tabIndex="0" data-view="tree" aria-label=${`Tree of ${scene.bodies[selection.body].name}, ${tree.size} nodes. Arrow keys move the selection. Selected: ${plainNode(tree, selection.node, selection.side)}`}
    onPointerDown=${(event) => { const hit = pick(pointerAt(event)); if (hit) lab.select({node: hit.node}); }}
    onPointerMove=${(event) => { const hit = pick(pointerAt(event)); event.currentTarget.style.cursor = hit ? 'pointer' : 'default'; event.currentTarget.title = hit ? plainNode(tree, hit.node, selection.side) : sideName(selection.side); }}
    onKeyDown=${onKeyDown} />`;
}
