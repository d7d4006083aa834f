/**
 * A body's hierarchy as flat arrays, and the questions that views ask about it: children, levels, the vertices below a
 * node, the smallest box around a point.
 */

export const noVertex = 4294967295;

/** Adds children, levels and parents to the flat arrays of a hierarchy (the engine's `flat` form). */
export class Tree {
  /** @param flat {parent, first, count, leaf, stale, depth, bounds, realisers, primitives} */
  constructor(flat, body, info) {
    Object.assign(this, flat);
    this.body = body;
    this.info = info;  // {indices, offsets, ...} of the body
    this.size = flat.parent.length;
    this.childStart = new Uint32Array(this.size + 1);
    for (let node = 1; node < this.size; ++node) ++this.childStart[flat.parent[node] + 1];
    for (let node = 0; node < this.size; ++node) this.childStart[node + 1] += this.childStart[node];
    this.childList = new Uint32Array(Math.max(0, this.size - 1));
    const next = this.childStart.slice();
    for (let node = 1; node < this.size; ++node) this.childList[next[flat.parent[node]]++] = node;
    this.levels = 0;
    for (let node = 0; node < this.size; ++node) this.levels = Math.max(this.levels, flat.depth[node] + 1);
    this.below = new Map();
  }

  /** A tree with new boxes and realisers: shares the structure of `this` if that is unchanged. */
  next(flat, info) {
    const same = (a, b) => a.length === b.length && a.every((x, i) => x === b[i]);
    if (info !== this.info || !same(flat.parent, this.parent) || !same(flat.primitives, this.primitives)) return new Tree(flat, this.body, info);
    return Object.assign(Object.create(Tree.prototype), this, flat);
  }

  /** The children of a node, in order. */
  kids(node) { return this.childList.subarray(this.childStart[node], this.childStart[node + 1]); }

  isLeaf(node) { return this.leaf[node] === 1; }

  bound(node, side) { return this.bounds[6 * node + (side & 1 ? 3 : 0) + (side >> 1)]; }

  /** The vertex that realises a side; null if unknown or inherited. */
  realiser(node, side) {
    if (!this.realisers) return null;
    const v = this.realisers[6 * node + side];
    return v === noVertex ? null : v;
  }

  /** The primitives below a node. */
  primitivesBelow(node) {
    if (this.isLeaf(node)) return Array.from(this.primitives.subarray(this.first[node], this.first[node] + this.count[node]));
    return Array.from(this.kids(node)).flatMap((child) => this.primitivesBelow(child));
  }

  /** The vertices below a node, each once, in ascending order. */
  verticesBelow(node) {
    let found = this.below.get(node);
    if (found) return found;
    const all = new Set();
    const stack = [node];
    while (stack.length) {
      const n = stack.pop();
      if (this.isLeaf(n)) {
        for (let i = this.first[n]; i < this.first[n] + this.count[n]; ++i)
          for (const v of primitiveVertices(this.info, this.primitives[i])) all.add(v);
      } else stack.push(...this.kids(n));
    }
    found = [...all].sort((a, b) => a - b);
    this.below.set(node, found);
    return found;
  }

  /** The nodes from a node to the root, both included. */
  pathUp(node) {
    const path = [node];
    while (node !== 0) path.push(node = this.parent[node]);
    return path;
  }

  /** Surface (or, in the plane, half the circumference) of a node's box. */
  extent(node) {
    const d = [0, 1, 2].map((a) => this.bounds[6 * node + 3 + a] - this.bounds[6 * node + a]);
    return d[0] * d[1] + d[1] * d[2] + d[2] * d[0] + d[0] + d[1] + d[2];
  }
}

/** The vertices of a primitive of a body {indices, offsets}. */
export function primitiveVertices({indices, offsets}, primitive) {
  return offsets ? indices.slice(offsets[primitive], offsets[primitive + 1]) : indices.slice(3 * primitive, 3 * primitive + 3);
}

/** The number of primitives of a body. */
export const primitiveCount = ({indices, offsets}) => offsets ? offsets.length - 1 : indices.length / 3;

/** The word for a primitive of a shape. */
export const primitiveWord = (info) => info.shape === 'points' ? 'point' : info.shape === 'control_nets' ? 'patch' : info.offsets ? 'polygon' : 'triangle';
