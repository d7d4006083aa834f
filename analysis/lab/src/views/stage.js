/** The stage: the scene at the present time, in the plane or in space, alone or with a second strategy next to it. */
import {html} from './dom.js';
import {Stage2d} from './stage2d.js';
import {Stage3d} from './stage3d.js';
import {boxChoices, hasLevel} from './shown.js';
import {titleOf} from '../text/words.js';

export function StageView({lab, state}) {
  const {info, at, scene, compare} = state;
  if (!info || !at || !scene) return html`<div class="empty">…</div>`;
  const View = scene.dimension === 2 ? Stage2d : Stage3d;
  if (!compare?.at) return html`<div class="stage-one"><${View} key="main" lab=${lab} state=${state} source=${state} which="main" /></div>`;
  return html`<div class="stage-two">
    <figure><${View} key="main" lab=${lab} state=${state} source=${state} which="main" /><figcaption>${titleOf(state.strategies, state.strategy)}: <b>${state.lit.count}</b> changed</figcaption></figure>
    <figure><${View} key="second" lab=${lab} state=${state} source=${compare} which="second" /><figcaption>${titleOf(state.strategies, compare.strategy)}: <b>${compare.lit.count}</b> changed</figcaption></figure>
  </div>`;
}

export function StageTools({lab, state}) {
  const {view, trees, selection, scene} = state;
  const levels = trees[selection.body]?.levels ?? 1;
  return html`
    <label>Boxes <select value=${view.boxes} onChange=${(event) => lab.view({boxes: event.currentTarget.value})}>
      ${boxChoices.map(({id, title: text}) => html`<option value=${id}>${text}</option>`)}</select></label>
    ${hasLevel(view.boxes) && html`<label class="level-choice"><span class="sr">Level</span><select aria-label="Level" value=${String(view.level)} onChange=${(event) => lab.view({level: event.currentTarget.value})}>
      <option value="all">all levels</option>${Array.from({length: levels}, (_, d) => html`<option value=${String(d)}>level ${d}</option>`)}<option value="leaves">leaves</option></select></label>`}
    ${scene && scene.dimension !== 2 && html`<label title="The axis that points up">up <select value=${view.up} onChange=${(event) => lab.view({up: event.currentTarget.value})}><option value="z">z</option><option value="y">y</option></select></label>`}
    <label class="check"><input type="checkbox" checked=${view.paths} onChange=${() => lab.view({paths: !view.paths})} /> paths</label>
    <label class="check"><input type="checkbox" checked=${view.labels} onChange=${() => lab.view({labels: !view.labels})} /> names</label>`;
}
