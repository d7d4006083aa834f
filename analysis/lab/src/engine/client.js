// The page's side of the engine: promises over a worker.

import workerSource from 'kbvh-lab-worker';

import { decodedState, steps } from './decode.js';

/** Starts an engine in a worker of its own. Every function of it returns a promise. */
export async function createEngine() {
  const address = URL.createObjectURL(new Blob([workerSource], { type: 'text/javascript' }));
  const worker = new Worker(address, { name: 'kbvh' });
  const waiting = new Map();
  let last = 0;
  let broken = null;
  const fail = (error) => {
    broken = error;
    for (const { reject } of waiting.values()) reject(error);
    waiting.clear();
  };
  worker.onmessage = ({ data: { id, result, error } }) => {
    const call = waiting.get(id);
    waiting.delete(id);
    if (error === undefined) call?.resolve(result);
    else call?.reject(new Error(error));
  };
  worker.onerror = (event) => fail(new Error(event.message || 'the engine did not start'));
  const engine = engineOver((name, args) => new Promise((resolve, reject) => {
    if (broken !== null) return reject(broken);
    waiting.set(++last, { resolve, reject });
    worker.postMessage({ id: last, name, args });
  }), () => {
    worker.terminate();
    fail(new Error('the engine is closed'));
  });
  try {
    await engine.strategies();
  } finally {
    URL.revokeObjectURL(address);
  }
  return engine;
}

/** The functions of an engine, given how a host (host.js) is called. */
export function engineOver(call, close) {
  const stepOrNull = (packed) => (packed === null ? null : steps(packed)[0]);
  return {
    strategies: () => call('strategies', []),
    counters: () => call('counters', []),
    load: (config) => call('load', [config]),
    readScene: (files, options) => call('readScene', [files, options]),
    frame: async (t, want) => decodedState(await call('frame', [t, want])),
    state: async (want) => decodedState(await call('state', [want])),
    time: () => call('time', []),
    event: async (until, want) => {
      const { step, state } = await call('event', [until, want]);
      return { step: stepOrNull(step), state: decodedState(state) };
    },
    back: async (want) => decodedState(await call('back', [want])),
    history: async (from = 0) => (await call('history', [from])).flatMap(steps).filter(({ index }) => index >= from),
    run: async (until, stopAt, want) => {
      const { stopped, begun, state } = await call('run', [until, stopAt, want]);
      return { stopped: stepOrNull(stopped), begun, state: decodedState(state) };
    },
    changePlans: async (plans, want) => decodedState(await call('changePlans', [plans, want])),
    edit: async (edit, want) => decodedState(await call('edit', [edit, want])),
    checkpoint: () => call('checkpoint', []),
    close,
  };
}
