/**
 * What changed between two states of the engine: for each body a mask of the sides of each node, and whether "changed"
 * means a new realiser or, for strategies without realisers, a new bound.
 */

/** @returns {sides: (Uint8Array|null)[], by: 'realiser'|'bound', count} */
export function difference(before, now) {
  let by = 'realiser', count = 0;
  const sides = now.map((tree, b) => {
    const old = before[b];
    if (!tree || !old || old.size !== tree.size) return null;
    const byRealiser = tree.realisers && old.realisers;
    if (!byRealiser) by = 'bound';
    const mask = new Uint8Array(tree.size);
    for (let node = 0; node < tree.size; ++node)
      for (let side = 0; side < 6; ++side) {
        const changed = byRealiser ? tree.realisers[6 * node + side] !== old.realisers[6 * node + side]
                                   : tree.bound(node, side) !== old.bound(node, side);
        if (changed) { mask[node] |= 1 << side; ++count; }
      }
    return mask;
  });
  return {sides, by, count};
}

/** The same from the bounds that events touched. */
export function touched(steps, trees) {
  const sides = trees.map((tree) => tree ? new Uint8Array(tree.size) : null);
  let count = 0;
  for (const {touched: changes} of steps)
    for (const {body, node, side} of changes) {
      if (!sides[body] || side > 5 || (sides[body][node] >> side & 1)) continue;
      sides[body][node] |= 1 << side;
      ++count;
    }
  return {sides, by: 'realiser', count};
}

export const nothingLit = {sides: [], by: 'realiser', count: 0};

/** Whether any side of a node, or one side of it, is lit. */
export function isLit(lit, body, node, side = null) {
  const mask = lit.sides[body]?.[node] ?? 0;
  return side === null ? mask !== 0 : (mask >> side & 1) === 1;
}
