/** The event panel: the story of the chosen event, and the list of events around now. */
import {html, Ref, Unfilled, useEffect, useRef} from './dom.js';
import {clock, isSame, kindNames, story, title} from '../text/why.js';
import {chooseEvent} from './timeline.js';
import {count} from './box.js';

/** Rows shown on each side of now. */
const before = 12, after = 24;

export function WhyPanel({lab, state}) {
  const {selection, history, at, info} = state;
  if (!info || !at) return null;
  if (!info.hasEvents) return html`<${Unfilled} lab=${lab} why="This strategy works at each frame and has no events." would="A kinetic strategy tells here, for each event, which certificate failed and which bounds were written." />`;
  const chosen = selection.event;
  const step = chosen?.done !== undefined ? history[chosen.done] : null;
  const due = chosen?.due ? at.queue.find((event) => isSame(event, chosen.due)) ?? chosen.due : null;
  return html`<div class="why">
    ${step ? html`<${Story} lab=${lab} state=${state} step=${step} />` : due ? html`<${Story} lab=${lab} state=${state} step=${{event: due}} />`
      : html`<p class="hint">Perform an event (n), or choose one in the list, the timeline or the diagram, and its story appears here.</p>`}
    <${EventList} lab=${lab} state=${state} />
  </div>`;
}

function Story({lab, state, step}) {
  const {trees, info, history, at} = state, done = step.touched !== undefined;
  const context = {trees, bodies: info.bodies, history, queue: at.queue, latest: done && step.index === at.eventsDone - 1};
  const paragraphs = story(step, context);
  return html`<article class="story" aria-label="Why">
    <h3>${done ? `Event ${step.index + 1}` : 'Scheduled'}: ${kindNames[step.event.kind]}</h3>
    ${paragraphs.map(({heading, parts, tie}) => html`<p class=${tie ? 'tie' : ''}><span class="story-head">${heading}.</span> ${parts.map((part) => html`<${Ref} lab=${lab} part=${part} />`)}</p>`)}
    <div class="row">${done ? html`<button onClick=${() => lab.goToEvent(step.index)}>Go to just after it</button>`
      : html`<button onClick=${() => lab.seek(step.event.time)}>Go to its time</button>`}</div>
  </article>`;
}

function EventList({lab, state}) {
  const {history, at, info, selection} = state, now = useRef(null);
  const past = history.slice(-before), future = at.queue.slice(0, after);
  const scheduled = at.queueLength ?? at.queue.length;
  useEffect(() => {
    const row = now.current, list = row?.closest('.event-list');
    if (list) list.scrollTop = row.offsetTop - list.clientHeight / 2;
  }, [at.eventsDone, history.length]);
  return html`<h3 class="list-head">${count(at.eventsDone, 'event')} performed, ${scheduled} scheduled</h3>
    <ol class="event-list" aria-label="Events around now" tabIndex="0">
    ${at.eventsDone > history.length && html`<li class="more">The first ${at.eventsDone} events are not listed: too many.</li>`}
    ${history.length > past.length && html`<li class="more">… ${history.length - past.length} earlier</li>`}
    ${past.map((step) => html`<li><button class=${`event past ${selection.event?.done === step.index ? 'chosen' : ''}`} onClick=${() => chooseEvent(lab, {done: step.index})}>
      <span class="event-time">${clock(step.event, info.end - info.begin)}</span> ${title(step.event, info.bodies)}</button></li>`)}
    <li class="now" ref=${now} aria-label="now"><span>now</span></li>
    ${future.map((event, i) => html`<li><button class=${`event ${selection.event?.due && isSame(selection.event.due, event) ? 'chosen' : ''}`} onClick=${() => chooseEvent(lab, {due: i})}>
      <span class="event-time">${clock(event, info.end - info.begin)}</span> ${title(event, info.bodies)}</button></li>`)}
    ${scheduled > future.length && html`<li class="more">… ${scheduled - future.length} later</li>`}
    ${!scheduled && html`<li class="more">Nothing is scheduled: no certificate fails any more.</li>`}
  </ol>`;
}
