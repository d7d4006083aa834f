/**
 * Stories about events and boxes in plain words. A story is a list of paragraphs; a paragraph is a list of parts: strings
 * and references {vertex, body}, {node, body}, {time} that views turn into links.
 */
import {axisNames, axisOf, isUpper, sideName} from '../math/plans.js';
import {crossingTime, equal, eventTime, lineOf, short, spell, toNumber} from '../math/exact.js';
import {primitiveWord} from '../math/hierarchy.js';

const vertex = (body, id) => ({vertex: id, body});
const node = (body, id) => ({node: id, body});

/** Names of the kinds of events. */
export const kindNames = {
  bound: 'a bound changes hands', boxes_meet: 'two boxes meet', boxes_separate: 'two boxes part',
  review: 'a pair of boxes is looked at again', window: 'the pairs to watch are chosen again',
};

/** One line about an event, for lists. */
export function title(event, bodies) {
  const at = bodies.length > 1 ? ` of ${bodies[event.body].name}` : '';
  if (event.kind === 'bound') return `${event.loser} overtakes ${event.winner} on ${sideName(event.side)} of node ${event.node}${at}`;
  const other = `${event.otherNode} of ${bodies[event.otherBody]?.name ?? '?'}`;
  if (event.kind === 'boxes_meet') return `box ${event.node}${at} meets box ${other}`;
  if (event.kind === 'boxes_separate') return `box ${event.node}${at} parts from box ${other}`;
  if (event.kind === 'review') return `boxes ${event.node}${at} and ${other} are looked at again`;
  return 'the pairs to watch are chosen again';
}

/** The time of an event in words: exact if its crossing is known. */
export function when(event) {
  const t = eventTime(event);
  if (!t) return {text: `${short(event.time)} s`, exactly: false};
  const spelled = spell(t);
  const decimal = short(event.time);
  return {text: spelled.exactly && spelled.text.includes('/') ? `${spelled.text} s (${decimal})` : `${spelled.text} s`, exactly: spelled.exactly};
}

/** The time of an event in decimals, for lists: as many as a clip of `span` seconds needs. */
export const clock = (event, span) => `${event.time.toFixed(Math.max(2, Math.min(9, 5 - Math.ceil(Math.log10(span || 1))))).replace('-', '\u2212')} s`;

/**
 * The story of an event.
 * @param step     the Step, if it was performed; else {event} alone
 * @param context  {trees, bodies, latest: whether the engine stands just after it, history}
 */
export function story(step, context) {
  const {event} = step;
  return event.kind === 'bound' ? boundStory(step, context) : pairStory(step, context);
}

function boundStory(step, context) {
  const {event} = step, {trees, bodies} = context, b = event.body;
  const tree = trees[b], axis = event.side > 5 ? 'the coordinate' : axisNames[axisOf(event.side)], more = isUpper(event.side) ? 'larger' : 'smaller';
  const leaf = tree?.isLeaf(event.node), done = step.touched !== undefined;
  const moment = when(event);
  const paragraphs = [];
  const sign = isUpper(event.side) ? '≥' : '≤';
  paragraphs.push({heading: 'Which certificate', parts: [
    `The certificate “${axis} of `, vertex(b, event.winner), ` ${sign} ${axis} of `, vertex(b, event.loser),
    '” proved that ', vertex(b, event.winner), ` realises the ${sideName(event.side)} side of `, node(b, event.node),
    leaf ? ` (a leaf: the vertices of its ${tree.count[event.node] > 1 ? `${tree.count[event.node]} ` : ''}${primitiveWord(bodies[b])}${tree.count[event.node] > 1 ? 's' : ''} compete).`
         : ' (an inner node: only the realisers of its children compete).',
    done ? ' It failed at ' : ' It will fail at ', {time: event.time, text: moment.text}, moment.exactly ? ', exactly.' : '.']});
  const lines = overtaking(event, axis, more);
  if (lines) paragraphs.push({heading: 'Who overtakes whom', parts: [vertex(b, event.loser), ...lines.loser, ' ', vertex(b, event.winner), ...lines.winner, lines.tail]});
  const ties = tiesOf(step, context);
  if (ties) paragraphs.push({heading: ties.tie ? 'Exact tie' : 'At the same instant', ...ties});
  if (!done) return paragraphs;
  paragraphs.push({heading: 'Where it went', parts: route(step, context)});
  paragraphs.push({heading: 'What was rescheduled', parts: rescheduled(step, context)});
  return paragraphs;
}

/** The two straight lines at the crossing, and their speeds. */
function overtaking(event, axis, more) {
  if (!event.exact || !event.winnerPiece || !event.loserPiece) return null;
  const w = lineOf(event.winnerPiece), l = lineOf(event.loserPiece);
  if (!w || !l) return null;
  const speed = (line) => short(toNumber(line.v), 4);
  const value = event.winnerPiece, t = crossingTime(event.winnerPiece, event.loserPiece);
  const at = t ? toNumber(w.p) + toNumber(w.v) * toNumber(t) : value.x0;
  return {
    loser: [` moves with ${speed(l)} per second along ${axis},`],
    winner: [` with ${speed(w)}.`],
    tail: t ? ` Both have ${axis} = ${short(at, 5)} when their lines cross; afterwards the first has the ${more} ${axis}.`
            : ' Their lines are parallel: they meet where a segment begins.',
  };
}

/** Other events at exactly the same time. */
function tiesOf(step, {history, queue = [], bodies}) {
  const time = eventTime(step.event);
  if (!time) return null;
  const same = (event) => {
    if (Math.abs(event.time - step.event.time) > 1e-9 * Math.max(1, Math.abs(event.time))) return false;
    const other = eventTime(event);
    return other && equal(other, time);
  };
  const near = (history ?? []).filter((s) => s.index !== step.index && same(s.event)).map((s) => s.event)
      .concat(queue.filter((event) => event !== step.event && same(event) && !isSame(event, step.event)));
  if (!near.length) return null;
  const pair = ({winner, loser}) => [winner, loser].sort((a, b) => a - b).join();
  const own = near.every((event) => event.kind === 'bound' && event.body === step.event.body && pair(event) === pair(step.event));
  if (own) return {tie: false, parts: [`The same two vertices cross in ${near.length === 1 ? 'one other certificate' : `${near.length} other certificates`} at this instant: ${near.slice(0, 4).map((event) => `${sideName(event.side)} of node ${event.node}`).join('; ')}${near.length > 4 ? '; and more' : ''}.`]};
  const list = near.slice(0, 4).map((event) => title(event, bodies)).join('; ');
  return {tie: true, parts: [`${near.length === 1 ? 'One other event has' : `${near.length} other events have`} exactly this time: ${list}${near.length > 4 ? '; and more' : ''}. `,
          'Deeper nodes go first, then smaller ids.']};
}

export const isSame = (a, b) => a.kind === b.kind && a.body === b.body && a.node === b.node && a.side === b.side && a.winner === b.winner &&
    a.loser === b.loser && a.otherBody === b.otherBody && a.otherNode === b.otherNode && a.time === b.time;

/** The nodes that changed, from the event's node upwards, and why the way ended. */
function route(step, {trees, latest}) {
  const {event, touched} = step, b = event.body, tree = trees[b];
  if (!touched.length) return ['No bound changed: this was an internal event.'];
  const parts = [vertex(b, event.loser), ' takes the side at '];
  touched.forEach((change, i) => {
    if (i) parts.push(' → ');
    parts.push(node(change.body, change.node));
  });
  parts.push(touched.length === 1 ? '. ' : ` (${touched.length} nodes: each had ${event.winner} as its realiser). `);
  const top = touched[touched.length - 1].node;
  if (!tree) return parts;
  if (top === 0) return [...parts, 'The change reached the root.'];
  const parent = tree.parent[top], holder = latest ? tree.realiser(parent, event.side) : null;
  parts.push('It stopped below ', node(b, parent), holder === null ? ', whose realiser is another vertex.' : ', whose realiser is ');
  if (holder !== null) parts.push(vertex(b, holder), '.');
  return parts;
}

function rescheduled(step) {
  if (!step.rescheduled.length) return ['No new failure: none of the new certificates fails within the known plans.'];
  const parts = [`${step.rescheduled.length} new ${step.rescheduled.length === 1 ? 'certificate has' : 'certificates have'} a failure time: `];
  step.rescheduled.forEach((event, i) => {
    if (i) parts.push('; ');
    parts.push(node(event.body, event.node), event.kind === 'bound' ? ` ${sideName(event.side)}: ` : ': ');
    if (event.kind === 'bound') parts.push(vertex(event.body, event.loser), ' overtakes ', vertex(event.body, event.winner));
    else parts.push(kindNames[event.kind]);
    parts.push(' at ', {time: event.time, text: when(event).text});
  });
  parts.push('.');
  return parts;
}

function pairStory(step, {bodies, trees}) {
  const {event} = step, done = step.touched !== undefined, moment = when(event);
  const a = node(event.body, event.node), b = node(event.otherBody, event.otherNode);
  const leaves = trees[event.body]?.isLeaf(event.node) && trees[event.otherBody]?.isLeaf(event.otherNode);
  const at = [done ? ' at ' : ' will happen at ', {time: event.time, text: moment.text}, '. '];
  const head = `of ${bodies[event.body].name}`, tail = ` of ${bodies[event.otherBody]?.name ?? '?'}`;
  switch (event.kind) {
    case 'boxes_meet':
      return [{heading: 'What happens', parts: [a, ` ${head} and `, b, tail, done ? ' began to overlap' : ' begin to overlap: this', ...at]},
              {heading: 'What it means for the separation list', parts: [leaves
                ? 'Both are leaves: the pair stays in the list as an overlapping one, and queries test its primitives.'
                : 'The pair leaves the list; the pairs of their children take its place. Children that overlap already are opened at once.']}];
    case 'boxes_separate':
      return [{heading: 'What happens', parts: [a, ` ${head} and `, b, tail, done ? ' ceased to overlap' : ' cease to overlap: this', ...at]},
              {heading: 'What it means for the separation list', parts: [leaves
                ? 'Both are leaves: the pair stays in the list, now as one that is apart.'
                : 'The pairs of their children leave the list; this one pair proves that all of them are apart.']}];
    case 'review':
      return [{heading: 'What happens', parts: ['The list searches for the next time at which ', a, ' and ', b, ' meet or part: this', ...at, 'No bound and no pair changes.']}];
    default:
      return [{heading: 'What happens', parts: ['The strategy chooses again which pairs it watches: this', ...at]}];
  }
}
