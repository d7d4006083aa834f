// The WebAssembly module: calls by JSON with arrays, copies of its memory as snapshots.

/** Makes instances of the compiled engine. `glue` is Emscripten's function, `wasm` the bytes of the module. */
export async function compileEngine(glue, wasm) {
  const compiled = await WebAssembly.compile(wasm);
  return async () => {
    const instance = await glue({
      instantiateWasm(imports, receive) {
        WebAssembly.instantiate(compiled, imports).then((made) => receive(made, compiled));
        return {};
      },
    });
    return new EngineModule(instance);
  };
}

class EngineModule {
  #module;

  constructor(module) {
    this.#module = module;
  }

  /** Calls a function of the engine (engine/engine.cpp); errors of the façade become Errors with the same text. */
  call(name, request = {}) {
    const texts = [name, JSON.stringify(request)].map((text) => this.#store(text));
    let head;
    try {
      head = this.#module._kbvh_lab_call(...texts);
    } finally {
      texts.forEach((address) => this.#module._free(address));
    }
    const { HEAPU8, HEAPU32 } = this.#module;
    const [at, size, arrays, count] = HEAPU32.subarray(head >> 2, (head >> 2) + 4);
    const read = (k) => {
      if (!(k < count)) throw new Error(`the engine's answer has no array ${k}`);
      const [address, length, kind] = HEAPU32.subarray((arrays >> 2) + 3 * k, (arrays >> 2) + 3 * k + 3);
      const Type = kind === 0 ? Uint32Array : Float64Array;
      return new Type(HEAPU8.buffer.slice(address, address + length * Type.BYTES_PER_ELEMENT));
    };
    const answer = JSON.parse(new TextDecoder().decode(HEAPU8.slice(at, at + size)), (key, value) =>
      value !== null && typeof value === 'object' && Number.isInteger(value.array) ? read(value.array) : value);
    if (answer.error !== undefined) throw new Error(answer.error);
    return answer.result;
  }

  /** Calls `use` with places of these arrays in the module's memory, which are valid during the call. */
  withArrays(arrays, use) {
    const addresses = [];
    try {
      const places = arrays.map((array) => {
        if (array === null) return null;
        const address = this.#allocate(Math.max(1, array.byteLength));
        addresses.push(address);
        new Uint8Array(this.#module.HEAPU8.buffer, address, array.byteLength)
          .set(new Uint8Array(array.buffer, array.byteOffset, array.byteLength));
        return { address, count: array.length };
      });
      return use(places);
    } finally {
      for (const address of addresses) this.#module._free(address);
    }
  }

  /** Writes files into the module's file system, which lives in memory. */
  writeFile(path, bytes) {
    const folder = path.slice(0, path.lastIndexOf('/'));
    if (folder !== '') this.#module.FS.mkdirTree(folder);
    this.#module.FS.writeFile(path, bytes);
  }

  /** The bytes in use. */
  get size() {
    return this.#module._sbrk(0);
  }
  /** A copy of the engine's whole state. */
  snapshot() {
    return this.#module.HEAPU8.slice(0, this.size);
  }
  restore(snapshot) {
    this.#module.HEAPU8.set(snapshot);
  }

  #store(text) {
    const size = this.#module.lengthBytesUTF8(text) + 1;
    const address = this.#allocate(size);
    this.#module.stringToUTF8(text, address, size);
    return address;
  }
  #allocate(size) {
    const address = this.#module._malloc(size);
    if (address === 0) throw new Error(`the engine is out of memory: ${size} more bytes`);
    return address;
  }
}
