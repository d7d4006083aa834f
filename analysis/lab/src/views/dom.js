/** What all views share: templates, the store as a hook, canvases that follow their size and the colour scheme. */
import {h} from 'preact';
import {useEffect, useLayoutEffect, useRef, useState} from 'preact/hooks';
import htm from 'htm';

export {render} from 'preact';
export {useEffect, useLayoutEffect, useMemo, useRef, useState} from 'preact/hooks';
export const html = htm.bind(h);

/** The store's state; the view is drawn again when it changes. */
export function useLab(lab) {
  const [state, setState] = useState(lab.state);
  useLayoutEffect(() => { setState(lab.state); return lab.store.subscribe(setState); }, [lab]);
  return state;
}

const names = ['bg', 'panel', 'ink', 'muted', 'line', 'accent', 'realiser', 'challenger', 'lit', 'lit-soft', 'pair', 'good', 'bad',
               'body0', 'body1', 'body2', 'level0', 'level1', 'level2', 'level3', 'level4', 'level5'];

/** The colours of the element's scheme, by name, as CSS text. */
export function coloursOf(element) {
  const style = getComputedStyle(element);
  const colours = {};
  for (const name of names) colours[name.replace(/-(.)/g, (_, c) => c.toUpperCase())] = style.getPropertyValue(`--${name}`).trim();
  colours.body = (b) => [colours.body0, colours.body1, colours.body2][b % 3];
  colours.level = (depth) => [colours.level0, colours.level1, colours.level2, colours.level3, colours.level4, colours.level5][Math.min(depth, 5)];
  return colours;
}

/**
 * A canvas that fills its box. `draw(context, {width, height, colours})` is called in CSS pixels after every render and
 * resize. Other properties go to the canvas: handlers, role, aria-label.
 */
export function Canvas({draw, ...properties}) {
  const ref = useRef(null), latest = useRef(draw);
  latest.current = draw;
  const paint = useRef(null);
  paint.current ??= () => {
    const canvas = ref.current;
    if (!canvas) return;
    const {width, height} = canvas.parentElement.getBoundingClientRect();
    const ratio = window.devicePixelRatio || 1;
    const w = Math.max(1, Math.floor(width)), hgt = Math.max(1, Math.floor(height));
    if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(hgt * ratio)) {
      canvas.width = Math.round(w * ratio);
      canvas.height = Math.round(hgt * ratio);
      canvas.style.width = `${w}px`;
      canvas.style.height = `${hgt}px`;
    }
    const context = canvas.getContext('2d');
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, w, hgt);
    latest.current(context, {width: w, height: hgt, colours: coloursOf(canvas)});
  };
  const pending = useRef(0);
  const soon = () => {
    if (pending.current) return;
    pending.current = requestAnimationFrame(() => { pending.current = 0; paint.current(); });
  };
  useEffect(() => {
    const observer = new ResizeObserver(soon);
    observer.observe(ref.current.parentElement);
    const scheme = matchMedia('(prefers-color-scheme: dark)');
    scheme.addEventListener('change', soon);
    return () => { observer.disconnect(); scheme.removeEventListener('change', soon); cancelAnimationFrame(pending.current); };
  }, []);
  useEffect(soon);
  return html`<div class="canvas-box"><canvas ref=${ref} ...${properties}></canvas></div>`;
}

/** The place of a pointer event inside its canvas, in CSS pixels. */
export function pointerAt(event) {
  const box = event.currentTarget.getBoundingClientRect();
  return [event.clientX - box.left, event.clientY - box.top];
}

/**
 * Two fingers zoom. Returns handlers that see pointers first: `down`, `move` and `up` return true while two fingers are on
 * the canvas; `zoomAt([x, y], factor)` is called with the middle and the change of the distance.
 */
export function usePinch(zoomAt) {
  const fingers = useRef(new Map()), last = useRef(0), call = useRef(zoomAt);
  call.current = zoomAt;
  const distance = ([[x0, y0], [x1, y1]]) => Math.max(1, Math.hypot(x0 - x1, y0 - y1));
  return {
    down(event) {
      fingers.current.set(event.pointerId, pointerAt(event));
      if (fingers.current.size === 2) last.current = distance([...fingers.current.values()]);
      return fingers.current.size === 2;
    },
    move(event) {
      if (!fingers.current.has(event.pointerId)) return false;
      fingers.current.set(event.pointerId, pointerAt(event));
      if (fingers.current.size !== 2) return false;
      const [a, b] = [...fingers.current.values()], now = distance([a, b]);
      call.current([(a[0] + b[0]) / 2, (a[1] + b[1]) / 2], now / last.current);
      last.current = now;
      return true;
    },
    up(event) { fingers.current.delete(event.pointerId); return false; },
  };
}

/** Sets the font of a canvas: size in pixels. */
export function font(context, size = 12, weight = 400) {
  context.font = `${weight} ${size}px system-ui, "Segoe UI", "DejaVu Sans", sans-serif`;
}

/** Text with a halo in the panel's colour, readable over lines. */
export function haloText(context, text, x, y, colour, halo) {
  context.lineJoin = 'round';
  context.lineWidth = 3.5;
  context.strokeStyle = halo;
  context.strokeText(text, x, y);
  context.fillStyle = colour;
  context.fillText(text, x, y);
}

/**
 * Draws names next to points so that none covers another: each takes the first free one of four corners. A name that finds none is left
 * out, unless it `must` be seen. `labels`: {x, y, text, colour, must}; `frame`: {width, height, colours} of the canvas, which no name leaves.
 * Returns the rectangles taken, as [x0, y0, x1, y1].
 */
export function drawNames(context, labels, {width, height, colours}, size = 12) {
  const taken = [];
  context.textAlign = 'left';
  context.textBaseline = 'middle';
  for (const {x, y, text, colour, must} of [...labels].sort((a, b) => Boolean(b.must) - Boolean(a.must))) {
    const w = context.measureText(text).width, h = size;
    const corners = [[x + 7, y - 10], [x - 7 - w, y - 10], [x + 7, y + 10], [x - 7 - w, y + 10]].map(([left, middle]) => [left, middle - h / 2, left + w, middle + h / 2]);
    const inside = corners.filter(([x0, y0, x1, y1]) => x0 >= 0 && y0 >= 0 && x1 <= width && y1 <= height);
    const free = inside.find(([x0, y0, x1, y1]) => taken.every((other) => x1 < other[0] || other[2] < x0 || y1 < other[1] || other[3] < y0));
    const at = free ?? (must ? inside[0] ?? corners[0] : null);
    if (!at) continue;
    taken.push(at);
    haloText(context, text, at[0], (at[1] + at[3]) / 2, colour, colours.panel);
  }
  return taken;
}

/** Round numbers for an axis between two values: about `count` of them. */
export function ticks(from, to, count) {
  const span = to - from;
  if (!(span > 0) || !Number.isFinite(span)) return [];
  const rough = span / Math.max(1, count), power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((x) => x * power).find((x) => x >= rough);
  const result = [];
  for (let k = Math.ceil(from / step - 1e-9); k * step <= to + span * 1e-9 && result.length < 50; ++k) result.push(k * step);
  return result;
}

/** A number for an axis: as many digits as the step needs. */
export function tickText(x, step) {
  const digits = Math.max(0, Math.min(12, -Math.floor(Math.log10(step) + 1e-9)));
  return x.toFixed(digits).replace('-', '\u2212');
}

/** A link-like button that selects a vertex or a node, or goes to a time. */
export function Ref({lab, part}) {
  if (typeof part === 'string') return part;
  if (part.vertex !== undefined)
    return html`<button class="ref ref-vertex" onClick=${() => lab.select({body: part.body, vertex: part.vertex, node: part.body === lab.state.selection.body ? lab.state.selection.node : 0})}>vertex ${part.vertex}</button>`;
  if (part.node !== undefined)
    return html`<button class="ref ref-node" onClick=${() => lab.select({body: part.body, node: part.node})}>node ${part.node}</button>`;
  return html`<button class="ref ref-time" onClick=${() => lab.seek(part.time)}>${part.text}</button>`;
}

/** What a panel would show under a kinetic strategy, where the chosen one gives it nothing to show. */
export function Unfilled({lab, why, would}) {
  return html`<div class="empty unfilled"><p>${why} ${would}</p><button onClick=${() => lab.choose('kinetic_aabb')}>Show it for the kinetic AABB tree</button></div>`;
}

/** A panel with a heading. */
export function Panel({id, title, tools, children, className = ''}) {
  return html`<section class="panel panel-${id} ${className}" aria-label=${title}>
    <header class="panel-head"><h2>${title}</h2><div class="panel-tools">${tools}</div></header>
    <div class="panel-body">${children}</div>
  </section>`;
}
