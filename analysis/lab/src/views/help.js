/** The keys, in a dialog. */
import {html, useEffect, useRef} from './dom.js';

export const keys = [
  ['Space', 'play or pause'], [', and .', 'one frame back, forwards'], ['p and n', 'one event back, forwards'],
  ['b', 'run to the next event of the chosen node'], ['Shift B', 'run to the next event of the chosen vertex'],
  ['Home and End', 'start and end of the clip'], ['v and Shift V', 'next, previous vertex'],
  ['[ and ]', 'previous, next node'], ['s and Shift S', 'next, previous side'],
  ['1 to 6', 'panel: event, box, pairs, counters, edit, compare'], ['e', 'dragging vertices on or off'],
  ['drag', 'stage and diagram, while dragging is on: move a vertex, or one of its keyframes in the diagram'], ['Shift and arrows', 'on the stage, while dragging is on: move the chosen vertex'], ['Ctrl Z, Ctrl Y', 'undo, redo an edit'],
  ['Arrows', 'tree: move the selection; timeline: choose an event; stage and diagram: move or turn'],
  ['+ − 0', 'stage and diagram: zoom, show all'], ['c', 'diagram: zoom on the crossing'], ['?', 'this help'],
];

export function Help({onClose}) {
  const dialog = useRef(null);
  useEffect(() => { dialog.current.showModal(); }, []);
  return html`<dialog ref=${dialog} class="help" aria-labelledby="help-title" onClose=${onClose} onClick=${(event) => { if (event.target === dialog.current) dialog.current.close(); }}>
    <h2 id="help-title">The lab</h2>
    <p>The page runs kbvh’s own C++ in your browser: what you see is what the strategies do. All views show one state. Choose a node in the tree or on the stage, a side in the box panel, and an event in the timeline.</p>
    <p class="legend"><span class="swatch realiser"></span> realiser of the chosen side <span class="swatch challenger"></span> its challenger <span class="swatch lit"></span> changed by the last move <span class="swatch pair"></span> intersecting pair</p>
    <table><caption>Keys</caption><tbody>${keys.map(([key, text]) => html`<tr><th scope="row"><kbd>${key}</kbd></th><td>${text}</td></tr>`)}</tbody></table>
    <p>Drop an OBJ (with its PC2), a glTF, or a saved state on the page to open it. Nothing leaves this computer.</p>
    <button onClick=${() => dialog.current.close()}>Close</button>
  </dialog>`;
}

/** Handles a key of the whole lab. Returns whether it was one. */
export function labKey(lab, event, {help}) {
  const {state} = lab;
  if (event.ctrlKey || event.metaKey) {
    const key = event.key.toLowerCase();
    if (key === 'z' && !event.shiftKey) { lab.editing.undo(); return true; }
    if (key === 'y' || (key === 'z' && event.shiftKey)) { lab.editing.redo(); return true; }
    return false;
  }
  if (event.altKey || !state.info) return false;
  const panel = (name) => () => lab.view({panel: name});
  const acts = {
    ' ': () => lab.toggle(), ',': () => lab.frame(-1), '.': () => lab.frame(1), p: () => lab.event(-1), n: () => lab.event(1),
    b: () => lab.runTo({body: state.selection.body, node: state.selection.node}),
    B: () => state.selection.vertex === null ? lab.say('Choose a vertex first: v.') : lab.runTo({body: state.selection.body, vertex: state.selection.vertex}),
    Home: () => { lab.pause(); lab.seek(state.info.begin); }, End: () => { lab.pause(); lab.seek(state.info.end); },
    v: () => cycle(lab, 'vertex', 1), V: () => cycle(lab, 'vertex', -1), ']': () => cycle(lab, 'node', 1), '[': () => cycle(lab, 'node', -1),
    s: () => cycle(lab, 'side', 1), S: () => cycle(lab, 'side', -1),
    1: panel('why'), 2: panel('box'), 3: panel('pairs'), 4: panel('counters'), 5: panel('edit'), 6: panel('work'), e: () => lab.view({edit: !state.view.edit, panel: 'edit'}), '?': help,
  };
  const act = acts[event.key];
  if (!act) return false;
  act();
  return true;
}

/** Chooses the next or previous vertex, node or side, around the end. */
function cycle(lab, what, by) {
  const {selection, info, trees, scene} = lab.state;
  const n = what === 'vertex' ? info.bodies[selection.body].vertices : what === 'node' ? trees[selection.body]?.size ?? 1 : scene.dimension === 2 ? 4 : 6;
  const now = selection[what] ?? (by > 0 ? -1 : 0);
  lab.select({[what]: (now + by + n) % n});
}
