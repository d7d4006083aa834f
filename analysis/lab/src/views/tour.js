/** A first hint, and a tour of a minute: eight cards that point at one view each, while the lab does what they say. */
import {html, useEffect, useRef, useState} from './dom.js';

/** The cards: the view that is framed, what the lab does, the words, and the side of the card where there is room. */
export const stops = [
  {view: 'stage', title: 'The scene', text: 'The vertices move, and the boxes around them must follow. All views show this one moment.',
    act: (lab) => { lab.pause(); return lab.seek(lab.state.info.begin); }},
  {view: 'tree', title: 'The tree', text: 'These are the same boxes as a tree. Each node names the vertex that holds the chosen side of its box: the realiser. As long as the realiser stays, there is nothing to write.',
    act: (lab) => lab.select({node: 0})},
  {view: 'diagram', title: 'One side over time', text: 'Each line is a vertex, the wide band is the bound. Where another line takes the band over, the realiser changes: an event.'},
  {view: 'timeline', title: 'The event queue', text: 'Events are computed in advance. Each mark right of now is one that waits. The lab has just performed the next one.',
    act: (lab) => lab.event(1)},
  {view: 'tabs', left: true, title: 'Why', text: 'Each event has a story: which certificate failed, and which bounds were written.',
    act: (lab) => lab.view({panel: 'why'})},
  {view: 'transport', title: 'Time', text: 'Play, or step by frames and by single events, backwards too. No film runs here: the C++ of kbvh computes each state.'},
  {view: 'tabs', left: true, title: 'Compare', text: 'The same clip with a refit, which writes all bounds at each frame. The lab counts the work of both.',
    act: (lab) => { lab.view({panel: 'work'}); return lab.comparison.set({strategy: 'bottom_up'}); }},
  {view: 'stage', title: 'Your turn', text: 'Choose another scene, drag vertices in the panel Edit, or open a mesh of your own. The course explains the rest.', last: true},
];

const memory = 'kbvh-lab tour';
const seen = () => { try { return localStorage.getItem(memory) !== null; } catch { return false; } };
const remember = () => { try { localStorage.setItem(memory, 'seen'); } catch { /* A page from a file may have no storage: the hint comes back. */ } };

/** The line for a first visitor; gone for good once it was answered. */
export function Hint({onTour}) {
  const [shown, setShown] = useState(!seen());
  if (!shown) return null;
  const close = () => { remember(); setShown(false); };
  return html`<div class="banner first-hint" role="note"><span>New here? Press ▶ and watch the boxes follow, or take the tour: eight cards, about a minute.</span>
    <span class="row"><button class="play" onClick=${() => { close(); onTour(); }}>Take the tour</button><button onClick=${close}>No, thanks</button></span></div>`;
}

/** The card of one stop. `root` is the element of the lab. */
export function Tour({lab, root, number, onGo, onClose}) {
  const card = useRef(null), stop = stops[number];
  useEffect(() => {
    let current = true;
    const show = async () => {
      if (!lab.state.info?.hasEvents) await lab.choose('kinetic_aabb');
      if (current) await stop.act?.(lab);
      if (!current) return;
      root.current.querySelector(stop.view === 'transport' ? '.transport' : `.panel-${stop.view}`)?.scrollIntoView({block: 'nearest'});
      card.current?.querySelector('.next')?.focus({preventScroll: true});
    };
    show();
    return () => { current = false; };
  }, [number]);
  const onKeyDown = (event) => {
    if (event.key !== 'Escape') return;
    event.stopPropagation();
    onClose();
  };
  return html`<div class="tour-place"><div ref=${card} class=${`tour ${stop.left ? 'left' : ''}`} role="dialog" aria-label=${`Tour, ${number + 1} of ${stops.length}: ${stop.title}`} onKeyDown=${onKeyDown}>
    <h3>${stop.title} <span class="muted">${number + 1} of ${stops.length}</span></h3>
    <p aria-live="polite">${stop.text}${stop.last && html` <a href="lessons/index.html">Open the course.</a>`}</p>
    <div class="row"><button onClick=${onClose}>${stop.last ? 'Close' : 'End the tour'}</button><span class="spring"></span>
      ${number > 0 && html`<button onClick=${() => onGo(number - 1)}>Back</button>`}
      ${stop.last ? html`<button class="play next" onClick=${onClose}>Done</button>` : html`<button class="play next" onClick=${() => onGo(number + 1)}>Next</button>`}</div>
  </div></div>`;
}
