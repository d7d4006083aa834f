// Bundles the lab: node build.mjs --wasm FOLDER --out FOLDER [--engine-only]
//   FOLDER of --wasm holds kbvh_lab.mjs and kbvh_lab.wasm, as the preset "wasm" builds them.
//   The folder of --out gets index.html, lab.js and lab.css, which work from a file, and lab.html with all of them in it.
//   --engine-only: engine.js alone, which defines kbvhEngine.createEngine; for tests of the engine.

import { build } from 'esbuild';
import { existsSync, mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { dirname, join, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';
import { parseArgs } from 'node:util';
import { gzipSync } from 'node:zlib';

const root = dirname(fileURLToPath(import.meta.url));
const { values: options } = parseArgs({
  options: { wasm: { type: 'string' }, out: { type: 'string' }, 'engine-only': { type: 'boolean', default: false } },
});
if (options.wasm === undefined || options.out === undefined) {
  console.error('usage: node build.mjs --wasm FOLDER --out FOLDER [--engine-only]');
  process.exit(2);
}
const wasm = resolve(options.wasm);
const out = resolve(options.out);
for (const file of ['kbvh_lab.mjs', 'kbvh_lab.wasm'])
  if (!existsSync(join(wasm, file))) {
    console.error(`${join(wasm, file)} is missing: build the engine first (experiments/lab does)`);
    process.exit(2);
  }

/** Serves modules of these names from memory or from files. */
const provide = (modules) => ({
  name: 'provide',
  setup(plugins) {
    plugins.onResolve({ filter: /^kbvh-lab-/ }, ({ path }) =>
      modules[path]?.file === undefined ? { path, namespace: 'provided' } : { path: modules[path].file });
    plugins.onLoad({ filter: /.*/, namespace: 'provided' }, ({ path }) => modules[path]);
  },
});
const common = { bundle: true, format: 'iife', minify: true, target: 'es2022', write: false, legalComments: 'inline', logLevel: 'warning',
  loader: { '.json': 'json', '.svg': 'text' } };

const worker = await build({
  ...common,
  entryPoints: [join(root, 'src/engine/worker.js')],
  plugins: [provide({
    'kbvh-lab-glue': { file: join(wasm, 'kbvh_lab.mjs') },
    'kbvh-lab-wasm': { contents: gzipSync(readFileSync(join(wasm, 'kbvh_lab.wasm')), { level: 9 }), loader: 'binary' },
  })],
});
const client = provide({ 'kbvh-lab-worker': { contents: worker.outputFiles[0].text, loader: 'text' } });

mkdirSync(out, { recursive: true });
if (options['engine-only']) {
  const engine = await build({ ...common, entryPoints: [join(root, 'src/engine/client.js')], globalName: 'kbvhEngine', plugins: [client] });
  writeFileSync(join(out, 'engine.js'), engine.outputFiles[0].contents);
  process.exit(0);
}

const page = await build({ ...common, entryPoints: [join(root, 'src/main.js')], globalName: 'kbvhLab', outdir: out, entryNames: 'lab', plugins: [client] });
const files = Object.fromEntries(page.outputFiles.map(({ path, text }) => [path.slice(out.length + 1), text]));
const index = readFileSync(join(root, 'src/index.html'), 'utf8');
writeFileSync(join(out, 'index.html'), index);
for (const [name, text] of Object.entries(files)) writeFileSync(join(out, name), text);

const style = '<link rel="stylesheet" href="lab.css">';
const script = '<script src="lab.js"></script>';
for (const line of [style, script])
  if (!index.includes(line)) throw new Error(`src/index.html lacks the line ${line}`);
writeFileSync(join(out, 'lab.html'), index
  .replace(style, () => `<style>${files['lab.css'] ?? ''}</style>`)
  .replace(script, () => `<script>${files['lab.js'].replaceAll('</script', '<\\/script')}</script>`));
