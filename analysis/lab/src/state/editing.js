import * as edit from './edit.js';

/**
 * Edits of the scene with undo. An edit makes a new scene, which is loaded and brought to the time where the lab stood, so
 * everything is recomputed by the engine. While a vertex is dragged, only the newest position is loaded.
 */
export class Editing {
  constructor(lab) {
    this.lab = lab;
    this.past = [];
    this.future = [];
    this.running = false;
    this.waiting = null;
  }

  forget() {
    this.past = [];
    this.future = [];
    this.lab.store.set({undo: 0, redo: 0});
  }

  /** Applies one of the functions of edit.js: `apply('moveVertex', {...})`. Errors are shown and change nothing. */
  async apply(name, options, {remember = true} = {}) {
    const scene = this.waiting ?? this.lab.state.scene;
    if (!scene) return;
    let next;
    try {
      next = edit[name](scene, options);
    } catch (error) {
      this.lab.store.set({error: error.message});
      return;
    }
    if (remember) this.remember(scene);
    await this.#show(next);
  }

  /** Remembers a scene for undo; a drag does this once at its begin. */
  remember(scene = this.lab.state.scene) {
    this.past.push(scene);
    if (this.past.length > 200) this.past.shift();
    this.future = [];
    this.lab.store.set({undo: this.past.length, redo: 0});
  }

  undo() { return this.#swap(this.past, this.future); }
  redo() { return this.#swap(this.future, this.past); }

  async #swap(from, to) {
    if (!from.length) return;
    to.push(this.lab.state.scene);
    const scene = from.pop();
    this.lab.store.set({undo: this.past.length, redo: this.future.length});
    await this.#show(scene);
  }

  async #show(scene) {
    this.waiting = scene;
    if (this.running) return;
    this.running = true;
    try {
      while (this.waiting) {
        const next = this.waiting;
        this.waiting = null;
        const {at, selection} = this.lab.state;
        await this.lab.load({scene: next, sceneId: null}, {time: at?.time, selection}, {quiet: true});
      }
    } finally {
      this.running = false;
    }
  }
}
