/** Words for the ids of the program's parameters and of their values. */

const special = {
  avl: 'AVL tree', sah: 'SAH', sse: 'SSE', avx2: 'AVX2', avx512: 'AVX-512',
  dop14: '14 sides', dop18: '18 sides', dop26: '26 sides', 1000000: 'all',
};

/** An id as words: "segment_heap" becomes "segment heap". */
export const words = (id) => special[id] ?? String(id).replaceAll('_', ' ');

/** An id as a heading: "leaf_boxes" becomes "Leaf boxes". */
export const heading = (id) => words(id).replace(/^./, (letter) => letter.toUpperCase());

/** The title of a strategy, from the engine's list; its id, if the list lacks it. */
export const titleOf = (strategies, id) => strategies.find((strategy) => strategy.id === id)?.title ?? words(id);
