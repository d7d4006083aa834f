// From the engine's arrays to the objects of the API. Long lists become objects only when they are read.

const KINDS = ['bound', 'boxes_meet', 'boxes_separate', 'review', 'window'];
const NO_VERTEX = 0xffffffff;

const vertexOrNull = (id) => (id === NO_VERTEX ? null : id);

function piece(numbers, at, ray) {
  return { t0: numbers[at], t1: numbers[at + 1], x0: numbers[at + 2], x1: numbers[at + 3], ray };
}

/** Event i of packed events. */
export function eventAt({ words, numbers }, i) {
  const [kind, body, node, side, winner, loser, otherBody, otherNode, flags] = words.subarray(9 * i, 9 * i + 9);
  const at = 10 * i;
  const exact = (flags & 1) !== 0;
  return {
    kind: KINDS[kind], body, node, side, winner: vertexOrNull(winner), loser: vertexOrNull(loser), otherBody, otherNode,
    time: numbers[at], error: numbers[at + 1], exact,
    winnerPiece: exact ? piece(numbers, at + 2, (flags & 2) !== 0) : null,
    loserPiece: exact ? piece(numbers, at + 6, (flags & 4) !== 0) : null,
  };
}

/** All of packed events, as objects. */
export function events(packed) {
  return Array.from({ length: packed.words.length / 9 }, (_, i) => eventAt(packed, i));
}

/** All steps of a log whose first event has the number `first`. */
export function steps({ first, log }) {
  const part = (ends, i, size) => [i === 0 ? 0 : ends[i - 1] * size, ends[i] * size];
  return Array.from({ length: log.touchedEnds.length }, (_, i) => {
    const touched = [];
    const [from, to] = part(log.touchedEnds, i, 5);
    for (let k = from; k < to; k += 5) {
      const [body, node, side, oldVertex, newVertex] = log.touched.subarray(k, k + 5);
      touched.push({ body, node, side, oldVertex: vertexOrNull(oldVertex), newVertex: vertexOrNull(newVertex) });
    }
    const rescheduled = [];
    const [a, b] = part(log.rescheduledEnds, i, 1);
    for (let k = a; k < b; ++k) rescheduled.push(eventAt(log.rescheduled, k));
    return { index: first + i, event: eventAt(log.events, i), touched, rescheduled };
  });
}

function nodeObjects(flat) {
  return Array.from({ length: flat.parent.length }, (_, i) => ({
    parent: flat.parent[i], first: flat.first[i], count: flat.count[i], leaf: flat.leaf[i] === 1, stale: flat.stale[i] === 1,
    depth: flat.depth[i], eventNode: flat.eventNode[i],
    lower: [...flat.bounds.subarray(6 * i, 6 * i + 3)], upper: [...flat.bounds.subarray(6 * i + 3, 6 * i + 6)],
    realisers: flat.realisers === null ? null : Array.from(flat.realisers.subarray(6 * i, 6 * i + 6), vertexOrNull),
  }));
}

/** Defines a property that is made at its first use. */
function lazy(object, name, make) {
  Object.defineProperty(object, name, {
    configurable: true, enumerable: true,
    get() {
      const value = make();
      Object.defineProperty(object, name, { value, enumerable: true });
      return value;
    },
  });
}

/** Makes the State of the API from the worker's: hierarchies have `flat` arrays and, when read, `nodes`. */
export function decodedState(state) {
  if (state.hierarchies)
    state.hierarchies = state.hierarchies.map((flat) => {
      if (flat === null) return null;
      const hierarchy = { flat, primitives: flat.primitives };
      lazy(hierarchy, 'nodes', () => nodeObjects(flat));
      return hierarchy;
    });
  if (state.queue) {
    const packed = state.queue;
    state.flatQueue = packed;
    lazy(state, 'queue', () => events(packed));
  }
  return state;
}
