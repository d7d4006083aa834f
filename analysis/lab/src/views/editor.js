/** The editor: the flight plan of the chosen vertex, keyframes, insertion and deletion, exact ties. */
import {html, useState} from './dom.js';
import {editable, nearestKeyframe} from '../state/edit.js';
import {axisNames, positionAt} from '../math/plans.js';
import {primitiveVertices, primitiveWord} from '../math/hierarchy.js';
import {short} from '../math/exact.js';

export function EditPanel({lab, state}) {
  const {scene, selection, view, at, undo, redo, precision, error} = state;
  if (!scene || !at) return null;
  if (!editable(scene)) return html`<p class="hint">Scenes of up to 2000 vertices can be edited by hand.</p>`;
  const axes = scene.dimension === 2 ? [0, 1] : [0, 1, 2];
  const body = scene.bodies[selection.body], vertex = selection.vertex !== null && selection.vertex < body.vertices ? selection.vertex : null;
  const edit = (name, options) => lab.editing.apply(name, options);
  const context = {lab, state, scene, body, axes, vertex, edit, b: selection.body};
  return html`<div class="editor">
    <div class="row">
      <label class="check"><input type="checkbox" checked=${view.edit} onChange=${() => lab.view({edit: !view.edit})} /> drag vertices on the stage</label>
      <label>Dragging moves <select value=${view.drag} onChange=${(event) => lab.view({drag: event.currentTarget.value})}>
        <option value="keyframe">the nearest keyframe</option><option value="plan">the whole plan</option></select></label>
      <span class="group"><button disabled=${!undo} onClick=${() => lab.editing.undo()} title="Undo (Ctrl Z)">↶ undo</button><button disabled=${!redo} onClick=${() => lab.editing.redo()} title="Redo (Ctrl Y)">↷ redo</button></span>
    </div>
    ${error && html`<p class="error-text" role="alert">${error}</p>`}
    <div class="row"><label>Body <select value=${String(selection.body)} onChange=${(event) => lab.select({body: Number(event.currentTarget.value)})}>${scene.bodies.map((each, k) => html`<option value=${String(k)}>${each.name}</option>`)}</select></label>
      <label>Vertex <select value=${vertex === null ? '' : String(vertex)} onChange=${(event) => lab.select({vertex: event.currentTarget.value === '' ? null : Number(event.currentTarget.value)})}>
        <option value="">–</option>${Array.from({length: body.vertices}, (_, v) => html`<option value=${String(v)}>${v}</option>`)}</select></label></div>
    <${Plan} ...${context} />
    <${Insert} ...${context} precision=${precision} />
    <${Ties} ...${context} />
    <div class="row"><label>Frames per keyframe interval <input type="number" min="1" max="1000" value=${scene.frames?.l ?? 10} onChange=${(event) => edit('setFrames', {l: Number(event.currentTarget.value)})} /></label></div>
  </div>`;
}

/** The table of keyframes of one vertex. */
function Plan({lab, state, body, b, axes, vertex, edit}) {
  const {at} = state, nearest = nearestKeyframe(body, at.time);
  return html`<div class="scroll-x"><table class="plan">
    <caption>${vertex === null ? `Keyframes of ${body.name}; choose a vertex to edit its flight plan` : `Flight plan of vertex ${vertex}`}</caption>
    <thead><tr><th scope="col">Time, s</th>${vertex !== null && axes.map((a) => html`<th scope="col">${axisNames[a]}</th>`)}<th scope="col"><span class="sr">Remove</span></th></tr></thead>
    <tbody>${body.times.map((time, k) => html`<tr class=${k === nearest ? 'chosen' : ''}>
      <td><input type="number" step="any" aria-label=${`time of keyframe ${k}`} value=${time} onChange=${(event) => edit('setKeyframeTime', {body: b, keyframe: k, time: Number(event.currentTarget.value)})} /></td>
      ${vertex !== null && axes.map((a) => html`<td><input type="number" step="any" aria-label=${`${axisNames[a]} at keyframe ${k}`} value=${body.positions[k][3 * vertex + a]}
        onChange=${(event) => { const position = [0, 1, 2].map((axis) => axis === a ? Number(event.currentTarget.value) : body.positions[k][3 * vertex + axis]); edit('setKeyframe', {body: b, vertex, keyframe: k, position}); }} /></td>`)}
      <td><button disabled=${body.times.length < 2} title="Remove this keyframe" aria-label=${`Remove keyframe ${k}`} onClick=${() => edit('removeKeyframe', {body: b, keyframe: k})}>✕</button>
        <button title="Go to this keyframe" aria-label=${`Go to keyframe ${k}`} onClick=${() => lab.seek(time)}>→</button></td></tr>`)}</tbody></table></div>
    <div class="row"><button onClick=${() => edit('addKeyframe', {body: b, time: at.time})} disabled=${body.times.includes(at.time)}>Add a keyframe at ${short(at.time, 5)} s</button></div>`;
}

function Insert({lab, state, scene, body, b, vertex, edit, precision}) {
  const {selection, trees, at} = state, points = body.shape === 'points';
  const middle = centre(at.positions[b]), size = spread(at.positions[b]) / 8 || 0.5;
  const tree = trees[b], node = selection.node;
  const primitives = tree && node < tree.size && tree.isLeaf(node) ? tree.primitivesBelow(node) : [];
  const add = () => {
    const here = vertex === null ? middle : positionAt(body, vertex, at.time, precision).map((x, axis) => axis < 2 ? x + size : x);
    if (points) edit('addVertex', {body: b, position: here, like: vertex, time: at.time});
    else edit('addFreeTriangle', {body: b, position: here, size});
  };
  return html`<fieldset><legend>Insert and delete</legend><div class="row">
    <button onClick=${add}>Add a ${points ? 'point' : 'triangle'}</button>
    <button disabled=${vertex === null} onClick=${() => edit('removeVertex', {body: b, vertex})}>Delete vertex ${vertex ?? ''}</button>
    ${!points && html`<button disabled=${primitives.length !== 1} onClick=${() => edit('removePrimitive', {body: b, primitive: primitives[0]})}>Delete ${primitiveWord(state.info.bodies[b])} ${primitives.length === 1 ? primitives[0] : '(choose a leaf)'}</button>`}
    <button onClick=${() => edit('addBody', {shape: body.shape, position: middle, times: body.times, size})}>Add a body</button>
    <button disabled=${scene.bodies.length < 2} onClick=${() => edit('removeBody', {body: b})}>Delete body “${body.name}”</button></div>
    ${!points && primitives.length === 1 && html`<p class="hint">Leaf ${node} holds the vertices ${Array.from(primitiveVertices(body, primitives[0])).join(', ')}.</p>`}</fieldset>`;
}

/** Gives a vertex exactly the coordinate of another one, at the nearest keyframe. */
function Ties({state, body, b, axes, vertex, edit}) {
  const [like, setLike] = useState(0), [axis, setAxis] = useState(0);
  const keyframe = nearestKeyframe(body, state.at.time);
  return html`<fieldset><legend>Exact tie</legend><div class="row">Give vertex ${vertex ?? '…'} the ${' '}
    <select aria-label="axis" value=${String(axis)} onChange=${(event) => setAxis(Number(event.currentTarget.value))}>${axes.map((a) => html`<option value=${String(a)}>${axisNames[a]}</option>`)}</select>
    ${' '}of vertex <input type="number" aria-label="other vertex" min="0" max=${body.vertices - 1} value=${like} onChange=${(event) => setLike(Number(event.currentTarget.value))} />
    ${' '}at ${short(body.times[keyframe], 5)} s <button disabled=${vertex === null || vertex === like} onClick=${() => edit('tie', {body: b, vertex, like, axis, keyframe})}>Set</button></div></fieldset>`;
}

function centre(p) {
  const sum = [0, 0, 0];
  for (let i = 0; i < p.length; ++i) sum[i % 3] += p[i];
  return sum.map((x) => Math.round(x / (p.length / 3) * 256) / 256);
}

function spread(p) {
  let most = 0;
  for (let axis = 0; axis < 3; ++axis) {
    let low = Infinity, high = -Infinity;
    for (let i = axis; i < p.length; i += 3) { low = Math.min(low, p[i]); high = Math.max(high, p[i]); }
    most = Math.max(most, high - low);
  }
  return Math.round(most * 256) / 256;
}
