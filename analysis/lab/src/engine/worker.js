// The worker: one Host, driven by messages {id, name, args}; it answers {id, result} or {id, error}.

import glue from 'kbvh-lab-glue';
import wasm from 'kbvh-lab-wasm';

import { Host } from './host.js';
import { compileEngine } from './module.js';

const host = inflated(wasm).then((bytes) => compileEngine(glue, bytes)).then((newModule) => new Host(newModule));
host.catch(() => {}); // every call reports it

async function inflated(bytes) {
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'))).arrayBuffer();
}

/** The buffers of a state, which belong to the page from now on; logs stay here. */
function buffers(value, found = new Set()) {
  if (ArrayBuffer.isView(value)) found.add(value.buffer);
  else if (value !== null && typeof value === 'object') for (const part of Object.values(value)) buffers(part, found);
  return found;
}

let queue = Promise.resolve(); // calls are answered in their order
self.onmessage = ({ data: { id, name, args } }) => {
  queue = queue.then(async () => {
    try {
      const result = await (await host)[name](...args);
      const moved = name === 'load' ? [] : [...buffers(result?.hierarchies || result?.positions ? result : result?.state)];
      self.postMessage({ id, result }, moved);
    } catch (error) {
      self.postMessage({ id, error: String(error?.message ?? error) });
    }
  });
};
