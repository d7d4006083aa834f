#!/usr/bin/env node
/**
 * Writes the built-in scenes of the lab, `scenes/*.json`. Deterministic: the same files on every machine, because every
 * number is made by additions, multiplications, divisions and square roots of doubles and then rounded to a multiple of
 * 1/1024. Run it after a change here: `node analysis/lab/scenes/generate.mjs`; with `--check` it only compares.
 */
import {readFileSync, writeFileSync} from 'node:fs';
import {dirname, join} from 'node:path';
import {fileURLToPath} from 'node:url';
import {cloth} from './cloth.mjs';
import {spheres} from './spheres.mjs';

const here = dirname(fileURLToPath(import.meta.url));
const round = (x) => Math.round(x * 1024) / 1024 + 0;

/** A small generator of pseudo-random numbers in [0, 1): the same sequence for the same seed. */
function noise(seed) {
  let state = seed >>> 0;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 4294967296;
  };
}

const points = (name, times, keyframes) => ({
  name, shape: 'points', vertices: keyframes[0].length / 3,
  indices: Array.from({length: keyframes[0].length / 3}, (_, i) => i),
  offsets: Array.from({length: keyframes[0].length / 3 + 1}, (_, i) => i),
  times, positions: keyframes.map((frame) => frame.map(round)),
});
const mesh = (name, indices, times, keyframes) => ({
  name, shape: 'polygons', vertices: keyframes[0].length / 3, indices, times,
  positions: keyframes.map((frame) => frame.map(round)),
});
const scene = (name, about, dimension, bodies, l, pairs) => ({
  format: 'kbvh-scene', version: 1, name, about, dimension, bodies, ...(pairs ? {pairs} : {}), frames: {l},
});

/** Four points that move along x only, each on a height of its own, so that paths do not hide each other. */
function line() {
  const at = (xs) => xs.flatMap((x, i) => [x, i * 0.6, 0]);
  return scene('Four points on a line',
      'Four points move along x; their heights never change. Only the two x sides of boxes have events.', 2,
      [points('points', [0, 2], [at([0, 1, 2, 3]), at([4, 2, 3.5, 0.5])])], 10);
}

/** Eight points in the plane with two straight pieces each, and overtakings on all four sides. */
function overtake() {
  const random = noise(12);
  const frame = () => Array.from({length: 8}, () => [random() * 6, random() * 4, 0]).flat();
  return scene('Eight points that overtake', 'Eight points in the plane change direction once, at one second.', 2,
      [points('points', [0, 1, 2], [frame(), frame(), frame()])], 12);
}

/** Point i is highest in turn: x_i(t) = 2 i t - i^2 (scaled). The upper envelope has as many pieces as points. */
function parade() {
  const n = 8;
  const at = (t) => Array.from({length: n}, (_, i) => [(2 * i * t - i * i) / 4, i * 2, 0]).flat();
  return scene('Everyone leads once',
      'Eight points on straight lines, tangents of one parabola: each is the rightmost for a while.', 2,
      [points('points', [0, 8], [at(0), at(8)])], 16);
}

/** All points move by the same vector: certificates never fail. */
function translation() {
  const random = noise(5);
  const start = Array.from({length: 8}, () => [Math.floor(random() * 12) / 4, Math.floor(random() * 10) / 4, 0]);
  const moved = (dx, dy) => start.flatMap(([x, y]) => [x + dx, y + dy, 0]);
  return scene('Translation', 'All points move by one vector. A refit rewrites every box; no certificate ever fails.', 2,
      [points('points', [0, 2], [moved(0, 0), moved(4, 1)])], 10);
}

/** Exact ties: crossings of many points at one instant, twins, and a crossing exactly at a keyframe. */
function ties() {
  const first = [0, 0, 0, 1, 0.6, 0, 2, 1.2, 0, -1, 1.8, 0, -1, 2.4, 0, 1.5, 3, 0];
  const middle = [2, 0, 0, 2, 0.6, 0, 2, 1.2, 0, 1, 1.8, 0, 1, 2.4, 0, 1, 3, 0];
  const last = [4, 0, 0, 3, 0.6, 0, 2, 1.2, 0, 3, 1.8, 0, 3, 2.4, 0, 0.5, 3, 0];
  return scene('Exact ties',
      'Points 0, 1 and 2 have the same x at exactly one second, at a keyframe; points 3 and 4 are twins in x for ever and meet 5 at that instant.',
      2, [points('points', [0, 1, 2], [first, middle, last])], 8);
}

/** Two groups of small triangles that pass through each other. */
function passing() {
  const swarm = (seed, x0, x1) => {
    const random = noise(seed);
    const from = [], to = [], indices = [];
    for (let k = 0; k < 6; ++k) {
      const cx = random() * 2.2, cy = random() * 3, drift = random() - 0.5;
      for (let corner = 0; corner < 3; ++corner) {
        const ox = [0.35, -0.2, -0.2][corner] + (random() - 0.5) * 0.2, oy = [0, 0.35, -0.35][corner] + (random() - 0.5) * 0.2;
        from.push(x0 + cx + ox, cy + oy, 0);
        to.push(x1 + cx + ox * 0.8 + oy * 0.5, cy + drift + oy * 0.8 - ox * 0.5, 0);
        indices.push(3 * k + corner);
      }
    }
    return [indices, [0, 3], [from, to]];
  };
  return scene('Two swarms of triangles', 'Two bodies of six triangles pass through each other: pairs of boxes meet, and part again.', 2,
      [mesh('left', ...swarm(3, 0, 4)), mesh('right', ...swarm(9, 4, -0.5))], 20, [[0, 1]]);
}

/** Two clouds of points that pass each other, one above the other. */
function clouds() {
  const cloud = (seed, x0, x1, y) => {
    const random = noise(seed);
    const from = [], to = [];
    for (let k = 0; k < 12; ++k) {
      const dx = random() * 2, dy = random() * 1.6;
      from.push(x0 + dx, y + dy, 0);
      to.push(x1 + random() * 2, y + dy + (random() - 0.5), 0);
    }
    return [[0, 2], [from, to]];
  };
  return scene('Two point clouds passing', 'Two bodies of twelve points each: their boxes meet although no two points ever do.', 2,
      [points('lower', ...cloud(21, 0, 5, 0)), points('upper', ...cloud(40, 5, 0, 1))], 16, [[0, 1]]);
}

/** Four triangles of a strip that bends: the picture of the first lesson. */
function strip() {
  const at = (bend) => [0, 0, 0, 1, 1 + bend * 0.2, 0, 2, 0 - bend * 0.4, 0, 3, 1 + bend * 0.9, 0, 4, bend * 1.3, 0, 5, 1 - bend, 0];
  return scene('A strip of four triangles', 'Four triangles that share vertices; the strip bends up and back.', 2,
      [mesh('strip', [0, 1, 2, 1, 3, 2, 2, 3, 4, 3, 5, 4], [0, 1, 2], [at(0), at(1), at(-0.5)])], 10);
}

/** Sixty-four points in space on crossing paths. */
function swarm3d() {
  const random = noise(77);
  const frame = (s) => Array.from({length: 64}, () => [random() * s, random() * s, random() * s]).flat();
  return scene('Sixty-four points in space', 'Sixty-four points in a cube fly to random places, twice.', 3,
      [points('points', [0, 1, 2], [frame(4), frame(4), frame(4)])], 12);
}

export const scenes = {
  'line-4': line(), 'overtake-8': overtake(), 'parade-8': parade(), 'translation-8': translation(), 'ties-6': ties(),
  'strip-4': strip(), 'swarms-12': passing(), 'clouds-24': clouds(), 'points-64': swarm3d(),
  'cloth-on-box': cloth(scene, mesh), 'spheres': spheres(scene, mesh),
};

let stale = 0;
for (const [id, data] of Object.entries(scenes)) {
  const path = join(here, `${id}.json`);
  const text = JSON.stringify(data) + '\n';
  if (process.argv.includes('--check')) {
    let old = '';
    try { old = readFileSync(path, 'utf8'); } catch { /* reported below */ }
    if (old !== text) { console.error(`${path} is not what generate.mjs writes`); stale = 1; }
  } else {
    writeFileSync(path, text);
  }
}
process.exit(stale);
