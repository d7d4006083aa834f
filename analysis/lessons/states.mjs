// Prepared states of the lab, by name. `note` is the line next to the button.
import { checkers } from "./checkers/index.mjs";
import { scenes } from "./scenes/scenes.mjs";
import { binary, paper, state } from "./scenes/state.mjs";

/// The root's upper side in x is chosen and stays chosen.
const root = { selection: { body: 0, node: 0, side: 1 }, view: { follow: false } };

export const states = {
  ribbon: { state: state(scenes.ribbon(), "bottom_up"), note: "The ribbon falls onto the table; bottom-up refit." },
  "ribbon-brute": { state: state(scenes.ribbon(), "brute_force"), note: "The same scene without a hierarchy." },
  dart: { state: state(scenes.dart(), "bottom_up"), note: "A dart, a wall, three keyframes." },
  race4: { state: state(scenes.race4(), "kinetic_aabb", root), note: "Four runners. The root and its upper side in x are chosen." },
  race: { state: state(scenes.race(), "kinetic_aabb", root), note: "Eight runners. The root and its upper side in x are chosen." },
  relay: { state: state(scenes.relay(8), "kinetic_aabb", root), note: "Eight runners who take the lead one after another." },
  "relay-mixed": { state: state(scenes.relay(8, "mixed"), "kinetic_aabb", root), note: "The same eight runners, other neighbours in the tree." },
  flag: { state: state(scenes.flag()), note: "Four triangles, a tree of seven nodes." },
  shoal: { state: state(scenes.shoal()), note: "Eight separate triangles, a tree of fifteen nodes." },
  tangents: { state: state(scenes.tangents(), "kinetic_aabb", root), note: "One polygon of sixteen vertices: the counterexample to T9." },
  wander: { state: state(scenes.wander(16)), note: "Sixteen points on random straight lines." },
  drape: { state: state(scenes.drape(), "kinetic_boxtree", { compare: { ...paper.kinetic_aabb, topology: binary } }), note: "BoxTree next to an AABB tree, on a cloth that starts flat." },
  combs: { state: state(scenes.combs(), "kinetic_separation_list"), note: "Two combs slide past each other." },
  sheet: { state: state(scenes.sheet(), "kinetic_aabb", { compare: { strategy: "bottom_up", params: {}, topology: binary } }), note: "Kinetic tree next to a refit; compare the values written." },
  tie: { state: state(scenes.tie(), "kinetic_aabb", root), note: "Three points meet in one point of the diagram." },
  carried: { state: state(scenes.carried()), note: "Sixty-four points, translated exactly." },
  "carried-far": { state: state(scenes.carried(1000000), "kinetic_aabb", { precision: "float32" }), note: "The same points, a million units away, in float." },
};

const forEditing = (state) => ({ ...state, view: { panel: "edit", edit: true } });

/// The start states of the exercises, with the editor open.
export function exerciseStates() {
  return Object.fromEntries(Object.entries(checkers).map(([name, { start }]) =>
    ["exercise-" + name, { state: forEditing(start()), note: "The panel Edit is open; drag vertices, or type their keyframes." }]));
}
