// A prepared state of the lab, and the strategies with which the lessons work.

/// The paper's structures: binary trees, one primitive per leaf, an AVL tree as the queue.
export const paper = {
  kinetic_aabb: { strategy: "kinetic_aabb", params: { queue: "avl", query: "nodes" } },
  kinetic_boxtree: { strategy: "kinetic_boxtree", params: { queue: "avl", planes: "start", candidates: "searched", leaf_boxes: "inherited" } },
  kinetic_separation_list: { strategy: "kinetic_separation_list", params: { queue: "avl" } },
};
export const binary = { method: "median", width: "2", leaf_size: "1" };

/// A state of the lab. `with` overrides its members.
export function state(scene, strategy = "kinetic_aabb", overrides = {}) {
  return { format: "kbvh-lab", version: 1, scene, ...(paper[strategy] ?? { strategy, params: {} }), topology: binary,
    precision: "float64", time: scene.bodies[0].times[0], events: 0, ...overrides };
}
