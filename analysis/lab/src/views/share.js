/** A link to the lab's present state, and the code that puts it into another page. */
import {html, useEffect, useState} from './dom.js';
import {addressOf, embedCode, encodeState} from '../state/permalink.js';

/** The two texts with buttons that copy them. They are of the state as it was when the panel was opened, or renewed. */
export function Share({lab, page, onClose}) {
  const [text, setText] = useState(null), [copied, setCopied] = useState('');
  const renew = () => encodeState(lab.getState()).then(setText);
  useEffect(() => { renew(); }, []);
  if (text === null) return html`<div class="settings share"><p class="hint">…</p></div>`;
  const link = addressOf(page, text), code = embedCode(addressOf(page, text, {embed: true}), lab.state.scene.name);
  const copy = async (name, what) => {
    try {
      await navigator.clipboard.writeText(what);
      setCopied(`The ${name} is in the clipboard.`);
    } catch {
      setCopied('The clipboard is closed to this page: select the text and copy it.');
    }
  };
  const field = (name, title, what) => html`<div class="share-row"><label>${title} <input class=${`share-${name}`} readonly value=${what} onFocus=${(event) => event.currentTarget.select()} /></label>
    <button onClick=${() => copy(name, what)}>Copy</button></div>`;
  return html`<div class="settings share" role="group" aria-label="Link and embed">
    ${field('link', 'Link', link)}${field('code', 'Embed', code)}
    <div class="row"><a href=${link} target="_blank" rel="noopener">Open in a tab of its own</a> <button onClick=${() => { setCopied(''); renew(); }}>Renew for what is shown now</button><span class="hint" role="status">${copied}</span><span class="spring"></span><button onClick=${onClose}>Close</button></div></div>`;
}
