/** The head of the page: scene, strategy and its parameters, second strategy, files, links, theme, help. */
import {html, useRef, useState} from './dom.js';
import {Share} from './share.js';
import {builtIn} from '../state/scenes.js';
import {encodeState} from '../state/permalink.js';
import {openFiles, openStudyScene} from '../state/files.js';
import {heading, words} from '../text/words.js';

/** Strategies named first in the menus, in the order of the course. */
const first = ['bottom_up', 'kinetic_aabb', 'kinetic_boxtree', 'kinetic_separation_list', 'linear_bounds', 'interval_join', 'kinetic_envelope'];

/** Strategies in the order of the menu: those of the course, then by family and title. */
export function ordered(strategies) {
  const rank = (s) => { const i = first.indexOf(s.id); return i < 0 ? first.length : i; };
  return [...strategies].sort((a, b) => rank(a) - rank(b) || a.family.localeCompare(b.family) || a.title.localeCompare(b.title));
}

/** The menu of strategies: those with events, then those that work at each frame. */
const grouped = (strategies) => [['With events', true], ['Frame by frame', false]].map(([label, events]) => html`<optgroup label=${label}>
  ${ordered(strategies).filter((s) => Boolean(s.events) === events).map((s) => html`<option value=${s.id}>${s.title}</option>`)}</optgroup>`);

/** `page`: the address of the lab's own page, to which links lead; without it there are no links. */
export function Header({lab, state, compact, page, onHelp, onTour}) {
  const {sceneId, scene, strategy, strategies, compare, view, precision} = state;
  const [open, setOpen] = useState(null), file = useRef(null);  // 'settings' or 'share': what lies below the head
  const about = strategies.find((s) => s.id === strategy);
  const load = (choice) => lab.load(choice, choice.scene ? {} : {time: state.at?.time});
  return html`<header class="lab-head">
    ${!compact && html`<h1>kbvh <span>lab</span></h1>
    <label>Scene <select value=${sceneId ?? ''} onChange=${(event) => { const id = event.currentTarget.value; if (id.startsWith('study ')) openStudyScene(lab, state.study[Number(id.slice(6))]); else if (builtIn[id]) { lab.editing.forget(); lab.view({up: 'z'}); load({scene: builtIn[id], sceneId: id, topology: lab.defaultTopology(lab.asked.strategy, builtIn[id])}); } }}>
      ${!sceneId && html`<option value="">${scene?.name ?? '…'} (changed or own)</option>`}
      ${Object.entries(builtIn).map(([id, each]) => html`<option value=${id}>${each.name}</option>`)}
      ${state.study.length > 0 && html`<optgroup label="Scenes of the study">${state.study.map((each, i) => html`<option value=${`study ${i}`}>${each.name}</option>`)}</optgroup>`}</select></label>`}
    <label>Strategy <select value=${strategy} onChange=${(event) => lab.choose(event.currentTarget.value)}>
      ${grouped(strategies)}</select></label>
    <label>Compare with <select value=${compare?.strategy ?? ''} onChange=${(event) => { const id = event.currentTarget.value; lab.comparison.set(id ? {strategy: id} : null); if (id) lab.view({panel: 'work'}); }}>
      <option value="">nothing</option>${grouped(strategies)}</select></label>
    <button aria-expanded=${open === 'settings'} onClick=${() => setOpen(open === 'settings' ? null : 'settings')} title="Parameters of the strategy, precision">Settings</button>
    <span class="spring"></span>
    ${!compact && html`<a href="lessons/index.html">Course</a>`}
    ${!compact && html`<button onClick=${() => file.current.click()} title="Open OBJ, OBJ with PC2, glTF, or a scene or state of the lab">Open…</button>
    <input ref=${file} type="file" class="sr" tabIndex="-1" multiple aria-label="Open files" onChange=${(event) => { openFiles(lab, event.currentTarget.files); event.currentTarget.value = ''; }} />`}
    <button onClick=${() => save(lab)} title="Save the whole state as a file">Save</button>
    ${page && html`<button aria-expanded=${open === 'share'} onClick=${() => { if (!compact) copyLink(lab); setOpen(open === 'share' ? null : 'share'); }} title="A link that keeps the whole state, and the code to embed it" data-action="link">Link</button>`}
    <button onClick=${() => lab.view({theme: {auto: 'dark', dark: 'light', light: 'auto'}[view.theme]})} title="Colours: automatic, dark, light" aria-label=${`Colours: ${view.theme}`}>${{auto: '◐', dark: '●', light: '○'}[view.theme]}</button>
    ${!compact && html`<button onClick=${onTour} title="Eight cards, about a minute">Tour</button>`}
    <button onClick=${onHelp} title="Keys and help (?)" aria-label="Keys and help">?</button>
    ${open === 'share' && html`<${Share} lab=${lab} page=${page} onClose=${() => setOpen(null)} />`}
    ${open === 'settings' && html`<${Settings} lab=${lab} state=${state} about=${about} precision=${precision} />`}
  </header>`;
}

function Settings({lab, state, about, precision}) {
  const {params, topology} = state;
  const set = (name, value) => {
    const next = {...params};
    if (value === '' || value === undefined) delete next[name]; else next[name] = value;
    lab.load({params: next}, {time: state.at?.time});
  };
  const widths = about?.widths?.length ? about.widths : [2, 4, 8];
  return html`<div class="settings" role="group" aria-label="Settings of the strategy">
    <p class="about"><b>${about?.title}</b> ${about?.about} ${about?.citation ? html`<span class="muted">${about.citation}</span>` : ''}</p>
    <div class="row">
      <label>Precision <select value=${precision} onChange=${(event) => lab.load({precision: event.currentTarget.value}, {time: state.at?.time})}><option value="float64">double</option><option value="float32">float</option></select></label>
      <label>Children per node <select value=${String(topology.width ?? '')} onChange=${(event) => retree(lab, state, 'width', event.currentTarget.value)}><option value="">as the strategy likes</option>${widths.map((w) => html`<option value=${String(w)}>${w}</option>`)}</select></label>
      <label>Primitives per leaf <select value=${String(topology.leaf_size ?? '')} onChange=${(event) => retree(lab, state, 'leaf_size', event.currentTarget.value)}><option value="">as the strategy likes</option>${[1, 2, 4, 8].map((w) => html`<option value=${String(w)}>${w}</option>`)}</select></label>
    </div>
    ${about?.parameters?.map((p) => html`<div class="parameter"><label title=${p.name}>${heading(p.name)} ${Array.isArray(p.allowed) && p.allowed.length
      ? html`<select value=${params[p.name] ?? p.default} onChange=${(event) => set(p.name, event.currentTarget.value)}>${p.allowed.map((x) => html`<option value=${x}>${words(x)}</option>`)}</select>`
      : html`<input size="8" value=${params[p.name] ?? p.default} onChange=${(event) => set(p.name, event.currentTarget.value)} />`}</label>
      <span class="hint">${[p.meaning, p.allowed?.length ? '' : p.admissible].filter(Boolean).join('; ')}</span></div>`)}
    </div>`;
}

function retree(lab, state, key, value) {
  const topology = {...state.topology};
  if (value) topology[key] = value; else delete topology[key];
  lab.load({topology}, {time: state.at?.time});
}

/** Puts the state into the address and the clipboard. */
export async function copyLink(lab) {
  const text = await encodeState(lab.getState());
  history.replaceState(null, '', `#s=${text}`);
  try {
    await navigator.clipboard.writeText(location.href);
    lab.say('The link is in the clipboard and in the address bar.');
  } catch {
    lab.say('The link is in the address bar.');
  }
}

/** Saves the state as a file. */
export function save(lab) {
  const url = URL.createObjectURL(new Blob([JSON.stringify(lab.getState())], {type: 'application/json'}));
  const link = document.createElement('a');
  link.href = url;
  link.download = `${(lab.state.scene.name || 'scene').replace(/[^\w-]+/g, '-')}.kbvh-lab.json`;
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 5000);
  lab.say('Saved as a file.');
}
