// Files for the readers of the lab.

/** A sphere of 2 * n * n triangles whose morph weights change at every key, as GLB. */
export function beatingSphere(n, keys) {
  const base = [], bulge = [], wave = [], indices = [];
  for (let i = 0; i <= n; ++i)
    for (let j = 0; j < n; ++j) {
      const a = (Math.PI * (i + 0.02)) / (n + 0.04), b = (2 * Math.PI * j) / n;
      const p = [Math.sin(a) * Math.cos(b), Math.cos(a), Math.sin(a) * Math.sin(b)];
      base.push(...p);
      bulge.push(...p.map((x) => 0.4 * x * Math.sin(3 * b) * Math.sin(a)));
      wave.push(0.3 * Math.sin(5 * p[1]), 0.1 * Math.cos(4 * b), 0.2 * Math.sin(4 * p[0]));
    }
  for (let i = 0; i < n; ++i)
    for (let j = 0; j < n; ++j) {
      const k = (j + 1) % n;
      const [p, q, r, s] = [i * n + j, i * n + k, (i + 1) * n + j, (i + 1) * n + k];
      indices.push(p, q, r, q, s, r);
    }
  const times = Array.from({ length: keys }, (_, k) => k / 2);
  const weights = times.flatMap((_, k) => [Math.sin(k * 1.3), Math.cos(k * 0.9)]);
  return glb({ base, morphs: [bulge, wave], indices, times, weights });
}

function glb({ base, morphs, indices, times, weights }) {
  const parts = [base, ...morphs].map((list) => Float32Array.from(list));
  parts.push(Uint32Array.from(indices), Float32Array.from(times), Float32Array.from(weights));
  let size = 0;
  const bufferViews = parts.map((part) => {
    const view = { buffer: 0, byteOffset: size, byteLength: part.byteLength };
    size += part.byteLength;
    return view;
  });
  const extreme = (part, pick) => [0, 1, 2].map((axis) => part.reduce((best, x, i) => (i % 3 === axis ? pick(best, x) : best), pick === Math.min ? Infinity : -Infinity));
  const m = morphs.length;
  const json = {
    asset: { version: '2.0' }, scene: 0, scenes: [{ nodes: [0] }], nodes: [{ mesh: 0, name: 'sphere' }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0 }, indices: m + 1, targets: morphs.map((_, i) => ({ POSITION: i + 1 })) }], weights: morphs.map(() => 0) }],
    buffers: [{ byteLength: size }], bufferViews,
    accessors: [
      ...parts.slice(0, m + 1).map((part, bufferView) => ({ bufferView, componentType: 5126, count: base.length / 3, type: 'VEC3', min: extreme(part, Math.min), max: extreme(part, Math.max) })),
      { bufferView: m + 1, componentType: 5125, count: indices.length, type: 'SCALAR' },
      { bufferView: m + 2, componentType: 5126, count: times.length, type: 'SCALAR', min: [times[0]], max: [times[times.length - 1]] },
      { bufferView: m + 3, componentType: 5126, count: weights.length, type: 'SCALAR' },
    ],
    animations: [{ name: 'beat', channels: [{ sampler: 0, target: { node: 0, path: 'weights' } }], samplers: [{ input: m + 2, output: m + 3, interpolation: 'LINEAR' }] }],
  };
  const text = new TextEncoder().encode(JSON.stringify(json));
  const padded = new Uint8Array(Math.ceil(text.length / 4) * 4).fill(32);
  padded.set(text);
  const out = new Uint8Array(28 + padded.length + size);
  const words = new DataView(out.buffer);
  const put = (at, ...values) => values.forEach((value, i) => words.setUint32(at + 4 * i, value, true));
  put(0, 0x46546c67, 2, out.length, padded.length, 0x4e4f534a);
  out.set(padded, 20);
  put(20 + padded.length, size, 0x004e4942);
  parts.forEach((part, i) => out.set(new Uint8Array(part.buffer), 28 + padded.length + bufferViews[i].byteOffset));
  return out;
}

/** A tetrahedron as OBJ, and a cache of its motion as PC2. */
export function tetrahedron() {
  const corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]];
  const obj = `${corners.map((p) => `v ${p.join(' ')}`).join('\n')}\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n`;
  const samples = 3;
  const pc2 = new ArrayBuffer(32 + samples * 12 * 4);
  new Uint8Array(pc2).set(new TextEncoder().encode('POINTCACHE2\0'));
  const view = new DataView(pc2);
  view.setInt32(12, 1, true);
  view.setInt32(16, 4, true);
  view.setFloat32(20, 0, true);
  view.setFloat32(24, 1, true);
  view.setInt32(28, samples, true);
  for (let k = 0; k < samples; ++k)
    corners.flat().forEach((x, i) => view.setFloat32(32 + 4 * (12 * k + i), x + (i % 3 === 2 ? k : 0), true));
  return { obj: new TextEncoder().encode(obj), pc2: new Uint8Array(pc2) };
}
