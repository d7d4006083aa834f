/** Opens files: states and scenes of the lab (JSON), meshes by the engine's own reader (OBJ, OBJ with PC2, glTF). */
import {checkState} from './permalink.js';

/** The largest mesh that the lab takes. */
export const mostPrimitives = 40000;

/** The scenes of a study that `kbvh lab --study` serves next to the page; none if the page was opened as a file. */
export async function studyScenes() {
  if (!location.protocol.startsWith('http')) return [];
  try {
    const answer = await fetch('study/scenes.json');
    return answer.ok ? await answer.json() : [];
  } catch {
    return [];
  }
}

/** Opens a scene of the study. */
export async function openStudyScene(lab, {name, framesPerSecond, files}) {
  try {
    const contents = await Promise.all(files.map(async (address) => {
      const answer = await fetch(address);
      if (!answer.ok) throw new Error(`${address}: ${answer.status} ${answer.statusText}`);
      return {name: decodeURIComponent(address.split('/').pop()), bytes: await answer.arrayBuffer()};
    }));
    await show(lab, name, contents, {framesPerSecond});
  } catch (error) {
    refuse(lab, name, error);
  }
}

/** Opens what was dropped or chosen. Errors name the file and what is wrong. */
export async function openFiles(lab, list) {
  const files = Array.from(list);
  if (!files.length) return;
  const names = files.map((file) => file.name).join(', ');
  try {
    if (files.length === 1 && files[0].name.toLowerCase().endsWith('.json')) {
      const text = await files[0].text();
      let data;
      try { data = JSON.parse(text); } catch (error) { throw new Error(`not JSON: ${error.message}`); }
      await lab.setState(checkState(data));
      return;
    }
    lab.say(`Reading ${names} …`);
    const contents = await Promise.all(files.map(async (file) => ({name: file.name, bytes: await file.arrayBuffer()})));
    await show(lab, names, contents);
  } catch (error) {
    refuse(lab, names, error);
  }
}

/** Shows why something could not be opened. The reader's messages often begin with the file's name: it is said once. */
function refuse(lab, names, error) {
  const message = plain(error.message);
  lab.store.set({notice: '', error: message.includes(names) ? message : `${names}: ${message}`});
}

/** The animations that the reader names when it asks for one: "choose a clip of: 0 'Walk', 1 'Run'"; else null. */
function clipsOf(message) {
  const list = /choose a clip of: (.*)$/.exec(message)?.[1];
  return list ? Array.from(list.matchAll(/(\d+) '([^']*)'/g), ([, id, title]) => ({id, title: title || `animation ${id}`})) : null;
}

/** A message without the folder in which the engine sees files. */
const plain = (message) => message.replaceAll('/files/', '');

/** Reads files by the engine and loads the scene. */
async function show(lab, names, contents, options = {}) {
  let scene = null, failure = null;
  await lab.enqueue('loading', `Reading ${names}`, async () => {
    try { scene = await lab.engine.readScene(contents, options); } catch (error) { failure = error; }
  });
  const clips = failure && clipsOf(failure.message);
  if (clips) {
    lab.store.set({choice: {text: `${names} has ${clips.length} animations. Which one?`, options: clips.map(({id, title}) => ({title, act: () => {
      lab.store.set({choice: null});
      return show(lab, names, contents, {...options, clip: id}).catch((error) => refuse(lab, names, error));
    }}))}});
    return;
  }
  if (failure) throw failure;
  const primitives = scene.bodies.reduce((sum, body) => sum + (body.offsets ? body.offsets.length - 1 : body.indices.length / 3), 0);
  if (primitives > mostPrimitives) throw new Error(`${primitives} primitives; the lab takes up to ${mostPrimitives}. The command-line program takes more.`);
  lab.editing.forget();
  lab.view({up: contents.some(({name}) => /\.gl(b|tf)$/i.test(name)) ? 'y' : 'z'});  // glTF says that y points up
  const loaded = await lab.load({scene, sceneId: null, topology: lab.defaultTopology(lab.state.strategy, scene)}, {selection: {}});
  if (loaded) lab.say(`Opened ${names}: ${primitives} primitives.`);
}
