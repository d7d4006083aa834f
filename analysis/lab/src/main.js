/** The page of the lab: mounts one lab that fills the window and keeps its state in the address when asked. */
import {mountLab} from './mount.js';
import {studyScenes} from './state/files.js';
import {decodeState} from './state/permalink.js';

export {mountLab};
export {createEngine} from './engine/client.js';
export {addressOf, embedCode, encodeState, decodeState, checkState, checkScene} from './state/permalink.js';
export {builtIn} from './state/scenes.js';

/** `#embed=` keeps a state as `#s=` does, for a frame inside another page: a compact lab whose links lead to the whole one. */
const embedded = () => location.hash.startsWith('#embed=');

/** Reads the state from the address; null if it has none. */
async function stateFromAddress() {
  const match = /^#(?:s|embed)=(.+)$/.exec(location.hash);
  if (match) return decodeState(match[1]);
  const scene = /^#scene=([\w-]+)$/.exec(location.hash);
  return scene ? {format: 'kbvh-lab', version: 1, sceneId: scene[1]} : null;
}

async function start(element) {
  let state = null, problem = '';
  try { state = await stateFromAddress(); } catch (error) { problem = error.message; }
  const lab = await mountLab(element, state, embedded() ? {compact: true, page: location.href} : {});
  if (problem) lab.store.set({error: problem});
  element.lab = lab;
  lab.store.set({study: await studyScenes()});
  window.addEventListener('hashchange', async () => {
    try {
      const next = await stateFromAddress();
      if (next) await lab.setState(next);
    } catch (error) { lab.store.set({error: error.message}); }
  });
}

const page = document.querySelector('[data-kbvh-lab-page]');
if (page) start(page);
