/** Which boxes a stage draws: by level, leaves, the changed ones, the chosen one with its path, or none. */
import {isLit} from '../state/lit.js';

/** The choices of the menu "boxes". */
export const boxChoices = [
  {id: 'level', title: 'by level'}, {id: 'side', title: 'chosen side, by level'}, {id: 'changed', title: 'changed'}, {id: 'path', title: 'chosen, up to the root'},
  {id: 'one', title: 'chosen only'}, {id: 'none', title: 'none'},
];

/** Whether a choice of boxes goes with a choice of level. */
export const hasLevel = (boxes) => boxes === 'level' || boxes === 'side';

/** @returns the nodes of a tree to draw, parents first; the chosen node is always among them (except for 'none') */
export function shownNodes(tree, body, view, selection, lit) {
  const mine = body === selection.body, chosen = mine && selection.node < tree.size ? selection.node : null;
  if (view.boxes === 'none') return [];
  if (view.boxes === 'one') return chosen === null ? [] : [chosen];
  if (view.boxes === 'path') return chosen === null ? [] : tree.pathUp(chosen).reverse();
  const nodes = [];
  for (let node = 0; node < tree.size; ++node) {
    const show = view.boxes === 'changed' ? isLit(lit, body, node)
        : view.level === 'all' ? true : view.level === 'leaves' ? tree.isLeaf(node)
        : tree.depth[node] === Number(view.level) || (tree.isLeaf(node) && tree.depth[node] < Number(view.level));
    if (show && node !== chosen) nodes.push(node);
    if (nodes.length > 60000) break;
  }
  if (chosen !== null) nodes.push(chosen);
  return nodes;
}
