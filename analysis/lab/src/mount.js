/** Puts a lab into an element of a page. */
import './styles/lab.css';
import './styles/views.css';
import './styles/panels.css';
import {Lab} from './state/lab.js';
import {html, render, Panel, useEffect, useLab, useRef, useState} from './views/dom.js';
import {openFiles} from './state/files.js';
import {BoxPanel} from './views/box.js';
import {CountersPanel} from './views/counters.js';
import {Diagram} from './views/diagram.js';
import {EditPanel} from './views/editor.js';
import {Gauges} from './views/gauges.js';
import {Header} from './views/header.js';
import {Help, labKey} from './views/help.js';
import {Hint, Tour, stops} from './views/tour.js';
import {PairsPanel} from './views/pairs.js';
import {StageTools, StageView} from './views/stage.js';
import {Timeline} from './views/timeline.js';
import {Transport} from './views/transport.js';
import {TreeView} from './views/tree.js';
import {WhyPanel} from './views/why.js';
import {WorkPanel} from './views/work.js';
import {isUpper, sideName} from './math/plans.js';

const tabs = [['why', 'Event'], ['box', 'Box'], ['pairs', 'Pairs'], ['counters', 'Counters'], ['edit', 'Edit'], ['work', 'Compare']];
/** Views that `options.views` may name. */
export const allViews = ['header', 'transport', 'timeline', 'stage', 'tree', 'diagram', 'gauges', 'panels'];

/**
 * Mounts a lab.
 * @param element  gets the lab as its content
 * @param state    a page state ({format: 'kbvh-lab', ...}), or null for the first built-in scene
 * @param options  {compact: true}: without the menu of scenes and files; {views: [...]} shows only these (see allViews); {theme: 'auto'|'light'|'dark'};
 *                 {page: 'lab/index.html'}: address of the lab's page, for links (without compact: this page);
 *                 {panels: ['why', ...]} tabs to offer; {metrics: ['values_written', ...]} counters of the panel Compare (see workMetrics)
 * @returns {Promise} of a lab: on(name, listener), getState(), setState(state), engine, store, destroy(), and the moves of `Lab`
 */
export async function mountLab(element, state = null, options = {}) {
  const lab = new Lab();
  const views = new Set(options.views ?? allViews);
  if (options.theme) lab.view({theme: options.theme});
  element.replaceChildren();
  render(html`<${Page} lab=${lab} views=${views} options=${options} />`, element);
  lab.element = element;
  lab.destroy = () => { render(null, element); lab.close(); };
  await lab.open(state ?? {format: 'kbvh-lab', version: 1, sceneId: 'overtake-8', strategy: 'kinetic_aabb'});
  return lab;
}

function Page({lab, views, options}) {
  const state = useLab(lab), root = useRef(null);
  const [help, setHelp] = useState(false), [over, setOver] = useState(false), [stop, setStop] = useState(null);
  const {phase, task, error, notice, view} = state;
  const has = (name) => views.has(name);
  const onKeyDown = (event) => {
    const typing = event.target.closest('input:not([type=range]):not([type=checkbox]), select, textarea, dialog');
    const pressing = event.key === ' ' && event.target.closest('button, input, summary');
    if (event.defaultPrevented || typing || pressing) return;
    if (labKey(lab, event, {help: () => setHelp(true)})) event.preventDefault();
  };
  useEffect(() => {
    if (options.compact) return undefined;
    const onBody = (event) => { if (event.target === document.body) onKeyDown(event); };
    document.addEventListener('keydown', onBody);
    return () => document.removeEventListener('keydown', onBody);
  }, []);
  return html`<div ref=${root} class=${`kbvh-lab ${options.compact ? 'compact' : 'page'} ${allViews.slice(2).every(has) ? 'whole' : ''} ${over ? 'dropping' : ''} ${state.compare ? 'comparing' : ''}`} data-theme=${view.theme} data-phase=${phase} data-tour=${stop === null ? null : stops[stop].view} onKeyDown=${onKeyDown}
      onDragOver=${(event) => { event.preventDefault(); setOver(true); }} onDragLeave=${() => setOver(false)}
      onDrop=${(event) => { event.preventDefault(); setOver(false); openFiles(lab, event.dataTransfer.files); }}>
    <div class="lab-inner">
      ${has('header') && html`<${Header} lab=${lab} state=${state} compact=${options.compact} page=${options.page ?? (options.compact ? null : location.href)} onHelp=${() => setHelp(true)} onTour=${() => setStop(0)} />`}
      ${!options.compact && stop === null && html`<${Hint} onTour=${() => setStop(0)} />`}
      ${error && html`<div class="banner error" role="alert"><span>${error}</span><button onClick=${() => lab.store.set({error: ''})} aria-label="Dismiss">✕</button></div>`}
      ${state.choice && html`<div class="banner choice" role="group" aria-label=${state.choice.text}><span>${state.choice.text}</span>
        <span class="row">${state.choice.options.map(({title, act}) => html`<button onClick=${act}>${title}</button>`)}</span><button onClick=${() => lab.store.set({choice: null})} aria-label="Dismiss">✕</button></div>`}
      ${has('transport') && html`<${Transport} lab=${lab} state=${state} />`}
      <main class="lab-grid">
        ${has('timeline') && html`<${Panel} id="timeline" title="Event queue" tools=${state.info?.hasEvents && html`<span class="hint wide-only">◆ a bound changes hands ● boxes meet ○ boxes part</span>
          <label class="check" title="Each event that is performed becomes the chosen node and side"><input type="checkbox" checked=${view.follow} onChange=${() => lab.view({follow: !view.follow})} /> follow events</label>`}><${Timeline} lab=${lab} state=${state} /><//>`}
        ${has('stage') && html`<${Panel} id="stage" title="Scene" tools=${html`<${StageTools} lab=${lab} state=${state} />`}><${StageView} lab=${lab} state=${state} /><//>`}
        ${has('tree') && html`<${Panel} id="tree" title="Tree" tools=${html`<${TreeTools} lab=${lab} state=${state} />`}><${TreeView} lab=${lab} state=${state} /><//>`}
        ${has('diagram') && html`<${Panel} id="diagram" title="Value over time" tools=${html`<${SideTools} lab=${lab} state=${state} />`}><${Diagram} key=${`${state.selection.body} ${state.selection.node} ${state.selection.side} ${state.scene?.name}`} lab=${lab} state=${state} /><//>`}
        ${has('gauges') && state.info?.hasEvents && html`<${Panel} id="gauges" title="Quality of the structure"><${Gauges} state=${state} /><//>`}
        ${has('panels') && html`<${Tabs} lab=${lab} state=${state} shown=${options.panels} metrics=${options.metrics} />`}
      </main>
      ${stop !== null && state.info && html`<${Tour} lab=${lab} root=${root} number=${stop} onGo=${setStop} onClose=${() => setStop(null)} />`}
      <div class="status" role="status" aria-live="polite">${phase === 'loading' || phase === 'working' ? html`<span class="spinner" aria-hidden="true"></span> ${task} …` : notice}</div>
      ${(phase === 'loading' || phase === 'failed') && !state.at && html`<div class="cover">${phase === 'failed' ? html`<p role="alert">The lab could not start: ${error}</p>` : html`<p><span class="spinner" aria-hidden="true"></span> ${task} …</p>`}</div>`}
    </div>
    ${help && html`<${Help} onClose=${() => { setHelp(false); root.current.querySelector('[data-view=stage], button')?.focus(); }} />`}
  </div>`;
}

function Tabs({lab, state, shown, metrics}) {
  const offered = tabs.filter(([id]) => !shown || shown.includes(id));
  const panel = offered.some(([id]) => id === state.view.panel) ? state.view.panel : offered[0][0];
  const content = {why: WhyPanel, box: BoxPanel, pairs: PairsPanel, counters: CountersPanel, edit: EditPanel, work: WorkPanel}[panel];
  const onKeyDown = (event) => {
    const i = offered.findIndex(([id]) => id === panel), by = {ArrowRight: 1, ArrowLeft: -1}[event.key];
    if (!by || event.target.getAttribute('role') !== 'tab') return;
    event.preventDefault();
    event.stopPropagation();
    const next = offered[(i + by + offered.length) % offered.length][0];
    lab.view({panel: next});
    event.currentTarget.querySelector(`[data-tab=${next}]`)?.focus();
  };
  return html`<section class="panel panel-tabs" aria-label="Details">
    <div class="tabs" role="tablist" aria-label="Details" onKeyDown=${onKeyDown}>${offered.map(([id, title]) => html`<button role="tab" data-tab=${id} aria-selected=${id === panel} tabIndex=${id === panel ? 0 : -1} onClick=${() => lab.view({panel: id})}>${title}</button>`)}</div>
    <div class="panel-body" role="tabpanel" aria-label=${offered.find(([id]) => id === panel)[1]}>${html`<${content} lab=${lab} state=${state} metrics=${metrics} />`}</div>
  </section>`;
}

function TreeTools({lab, state}) {
  const {info, selection, lit} = state;
  const since = state.step ? 'by this event' : info?.hasEvents ? 'since the frame before' : 'since the last view';
  return html`<span class="hint">${state.at && lit.count ? `${lit.count} ${lit.by === 'realiser' ? (lit.count === 1 ? 'side has a new realiser' : 'sides have new realisers') : 'bounds rewritten'} ${since}` : ''}</span>
    ${info?.bodies.length > 1 && html`<label>Body <select value=${String(selection.body)} onChange=${(event) => lab.select({body: Number(event.currentTarget.value)})}>${info.bodies.map((body, b) => html`<option value=${String(b)}>${body.name}</option>`)}</select></label>`}`;
}

function SideTools({lab, state}) {
  const {selection, scene} = state, sides = scene?.dimension === 2 ? [0, 1, 2, 3] : [0, 1, 2, 3, 4, 5];
  return html`<span class="node-name">node ${selection.node}</span>
    <span class="sides-choice" role="group" aria-label="Side">${sides.map((side) => html`<button aria-pressed=${selection.side === side} title=${sideName(side)} aria-label=${sideName(side)} onClick=${() => lab.select({side})}>${isUpper(side) ? '+' : '\u2212'}${'xyz'[side >> 1]}</button>`)}</span>`;
}
