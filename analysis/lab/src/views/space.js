import * as THREE from 'three';
import {OrbitControls} from 'three/examples/jsm/controls/OrbitControls.js';
import {LineSegments2} from 'three/examples/jsm/lines/LineSegments2.js';
import {LineSegmentsGeometry} from 'three/examples/jsm/lines/LineSegmentsGeometry.js';
import {LineMaterial} from 'three/examples/jsm/lines/LineMaterial.js';
import {primitiveVertices} from '../math/hierarchy.js';
import {isLit} from '../state/lit.js';
import {shownNodes} from './shown.js';

/** The twelve edges of a box as pairs of corners; corner bits are x, y, z. */
const edges = [0, 1, 2, 3, 4, 5, 6, 7, 0, 2, 1, 3, 4, 6, 5, 7, 0, 4, 1, 5, 2, 6, 3, 7];

/** The scene in space, drawn by three.js when something changed. z points up. */
export class Space {
  constructor(holder) {
    this.holder = holder;
    this.renderer = new THREE.WebGLRenderer({antialias: true, alpha: true});
    this.renderer.debug.checkShaderErrors = false;
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio || 1));
    this.renderer.domElement.setAttribute('aria-hidden', 'true');
    holder.prepend(this.renderer.domElement);
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(36, 1, 0.01, 1000);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.renderer.domElement);
    this.controls.addEventListener('change', () => this.soon());
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x8890a0, 2.2));
    const sun = new THREE.DirectionalLight(0xffffff, 1.6);
    sun.position.set(3, -4, 6);
    this.scene.add(sun);
    this.bodies = [];
    this.root = new THREE.Group();  // turned if y points up in the scene
    this.scene.add(this.root);
    this.extras = new THREE.Group();
    this.root.add(this.extras);
    this.materials = sharedMaterials();
    this.pending = 0;
    this.afterRender = null;
    this.compiled = false;
    this.warmUp();
    new ResizeObserver(() => this.resize()).observe(holder);
  }

  resize() {
    const {width, height} = this.holder.getBoundingClientRect();
    if (width < 2 || height < 2) return;
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.sized = true;
    this.camera.updateProjectionMatrix();
    if (this.box && !this.placed) this.fit();
    this.soon();
  }

  /** Compiles all shaders without blocking the page; nothing is drawn before that. */
  async warmUp() {
    const group = new THREE.Group(), triangle = geometryOf([0, 0, 0, 1, 0, 0, 0, 1, 0]), thick = new LineSegmentsGeometry();
    triangle.setAttribute('color', new THREE.Float32BufferAttribute(new Array(9).fill(1), 3));
    thick.setPositions([0, 0, 0, 1, 0, 0]);
    const {lines, sheets, thickInk, paths, mesh, wire, points} = this.materials;
    group.add(new THREE.LineSegments(triangle, lines), new THREE.LineSegments(triangle, paths), new THREE.LineSegments(triangle, wire), new LineSegments2(thick, thickInk),
              new THREE.Mesh(triangle, sheets.lit), new THREE.Mesh(triangle, mesh), new THREE.Points(triangle, points));
    this.scene.add(group);
    try { await this.renderer.compileAsync(this.scene, this.camera); } catch (error) { console.warn(error); }
    this.scene.remove(group);
    triangle.dispose();
    thick.dispose();
    this.compiled = true;
    this.soon();
  }

  /** Draws once, at the next animation frame. */
  soon() {
    if (this.pending || !this.compiled || this.closed) return;
    this.pending = requestAnimationFrame(() => {
      this.pending = 0;
      this.renderer.render(this.scene, this.camera);
      this.afterRender?.();
    });
  }

  /** Shows a state of the lab; `source` is the lab's state or its comparison. */
  update(state, source, colours) {
    const turned = this.up !== state.view.up;
    if (turned) this.turnRoot(state.view.up);
    if (this.info !== source.info) this.rebuild(state, source.info, colours);
    if (turned) this.fit();
    const {at} = source;
    this.bodies.forEach(({geometry}, b) => {
      const attribute = geometry.getAttribute('position');
      attribute.array.set(at.positions[b].length === attribute.array.length ? at.positions[b] : at.positions[b].subarray(0, attribute.array.length));
      attribute.needsUpdate = true;
    });
    this.recolour(colours);
    this.drawBoxes(state, source, colours);
    this.drawPairs(source);
    this.drawPaths(state);
    this.soon();
  }

  /** Turns the scene so that its axis `up` ('y' or 'z') points up on the screen. */
  turnRoot(up) {
    this.up = up;
    this.root.rotation.x = up === 'y' ? Math.PI / 2 : 0;
    this.root.updateMatrixWorld(true);
  }

  rebuild(state, info, colours) {
    for (const {object, wire} of this.bodies) { this.root.remove(object); if (wire) this.root.remove(wire); }
    const sameSpace = this.info && this.name === state.scene.name;
    this.info = info;
    this.name = state.scene.name;
    this.bodies = info.bodies.map((body, b) => {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(3 * body.vertices), 3));
      let object, wire = null;
      if (body.shape === 'polygons') {
        geometry.setIndex(triangles(body));
        object = new THREE.Mesh(geometry, this.materials.mesh.clone());
        if (body.primitives <= 4000) {
          const lines = new THREE.BufferGeometry();
          lines.setAttribute('position', geometry.getAttribute('position'));
          lines.setIndex(edgeList(body));
          wire = new THREE.LineSegments(lines, this.materials.wire.clone());
          wire.frustumCulled = false;
          this.root.add(wire);
        }
      } else {
        object = new THREE.Points(geometry, this.materials.points.clone());
      }
      object.frustumCulled = false;
      this.root.add(object);
      return {object, geometry, wire};
    });
    this.box = boxOf(state.scene);
    this.sample = sampleOf(state.scene);
    if (!sameSpace) this.fit();
  }

  recolour(colours) {
    this.bodies.forEach(({object, wire}, b) => {
      object.material.color.set(colours.body(b));
      wire?.material.color.set(colours.ink);
    });
    const {sheets, thickInk, thickPath, paths} = this.materials;
    sheets.lit.color.set(colours.lit);
    sheets.side.color.set(colours.realiser);
    sheets.pair.color.set(colours.pair);
    thickInk.color.set(colours.ink);
    thickPath.color.set(colours.challenger);
    paths.color.set(colours.muted);
  }

  /** Looks at the whole clip. */
  fit() {
    const centre = this.box.getCenter(new THREE.Vector3()).applyMatrix4(this.root.matrixWorld), toCamera = new THREE.Vector3(0.55, -0.95, 0.55).normalize();
    const across = new THREE.Vector3(0, 0, 1).cross(toCamera).normalize(), up = toCamera.clone().cross(across);
    const tall = Math.tan(this.camera.fov * Math.PI / 360) * 0.92, wide = tall * this.camera.aspect;
    let distance = 1e-3;
    for (let i = 0; i < this.sample.length; i += 3) {  // far enough for every vertex, sampled over the clip
      const d = new THREE.Vector3(this.sample[i], this.sample[i + 1], this.sample[i + 2]).applyMatrix4(this.root.matrixWorld).sub(centre);
      distance = Math.max(distance, d.dot(toCamera) + Math.max(Math.abs(d.dot(across)) / wide, Math.abs(d.dot(up)) / tall));
    }
    this.camera.position.copy(centre).addScaledVector(toCamera, distance *= 1.06);
    this.camera.near = distance / 100;
    this.camera.far = distance * 10;
    this.camera.updateProjectionMatrix();
    this.controls.target.copy(centre);
    this.controls.update();
    this.placed = this.sized;
    this.soon();
  }

  /** Turns or moves the camera from the keyboard: angles in radians, zoom as a factor. */
  turn(across, up, zoom = 1) {
    const offset = this.camera.position.clone().sub(this.controls.target);
    const spherical = new THREE.Spherical().setFromVector3(new THREE.Vector3(offset.x, offset.z, -offset.y));
    spherical.theta += across;
    spherical.phi = Math.min(Math.PI - 0.01, Math.max(0.01, spherical.phi + up));
    spherical.radius *= zoom;
    const v = new THREE.Vector3().setFromSpherical(spherical);
    this.camera.position.copy(this.controls.target).add(new THREE.Vector3(v.x, -v.z, v.y));
    this.controls.update();
  }

  drawBoxes({view, selection}, {trees, lit}, colours) {
    this.clear();
    const lines = [], lineColours = [], quads = [];
    let chosen = null;
    const colour = new THREE.Color();
    trees.forEach((tree, b) => {
      if (!tree) return;
      for (const node of shownNodes(tree, b, view, selection, lit)) {
        const corners = cornersOf(tree, node), on = isLit(lit, b, node);
        if (b === selection.body && node === selection.node) { chosen = {tree, node, corners}; }
        colour.set(on ? colours.lit : colours.level(tree.depth[node]));
        const drawn = view.boxes === 'side' ? sideEdges(selection.side) : edges;
        for (const corner of drawn) { lines.push(...corners[corner]); lineColours.push(colour.r, colour.g, colour.b); }
        if (on && lit.count <= 24) for (let side = 0; side < 6; ++side) if (isLit(lit, b, node, side) && (view.boxes !== 'side' || side === selection.side)) quads.push(...quad(corners, side));
      }
    });
    if (lines.length) {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute('position', new THREE.Float32BufferAttribute(lines, 3));
      geometry.setAttribute('color', new THREE.Float32BufferAttribute(lineColours, 3));
      this.extras.add(new THREE.LineSegments(geometry, this.materials.lines));
    }
    if (quads.length) this.extras.add(new THREE.Mesh(geometryOf(quads), this.materials.sheets.lit));
    if (chosen) {
      const geometry = new LineSegmentsGeometry();
      geometry.setPositions(edges.flatMap((corner) => chosen.corners[corner]));
      this.extras.add(new LineSegments2(geometry, this.materials.thickInk), new THREE.Mesh(geometryOf(quad(chosen.corners, selection.side)), this.materials.sheets.side));
    }
  }

  drawPairs({at, info}) {
    const pairs = at.pairs ?? [], seen = new Set(), positions = [];
    for (let i = 0; i + 3 < pairs.length; i += 4)
      for (const [b, primitive] of [[pairs[i], pairs[i + 1]], [pairs[i + 2], pairs[i + 3]]]) {
        const key = b * 4294967296 + primitive;
        if (seen.has(key) || info.bodies[b].shape !== 'polygons') continue;
        seen.add(key);
        const list = primitiveVertices(info.bodies[b], primitive), p = at.positions[b];
        for (let k = 1; k + 1 < list.length; ++k) for (const v of [list[0], list[k], list[k + 1]]) positions.push(p[3 * v], p[3 * v + 1], p[3 * v + 2]);
      }
    if (positions.length) this.extras.add(new THREE.Mesh(geometryOf(positions), this.materials.sheets.pair));
  }

  drawPaths({view, scene, selection}) {
    const vertices = scene.bodies.reduce((sum, body) => sum + body.vertices, 0);
    const lines = [], chosen = [];
    scene.bodies.forEach((body, b) => {
      for (let v = 0; v < body.vertices; ++v) {
        const mine = b === selection.body && v === selection.vertex;
        if (!mine && !(view.paths && vertices <= 70)) continue;
        for (let k = 0; k + 1 < body.times.length; ++k)
          for (const p of [body.positions[k], body.positions[k + 1]]) (mine ? chosen : lines).push(p[3 * v], p[3 * v + 1], p[3 * v + 2]);
      }
    });
    if (lines.length) this.extras.add(new THREE.LineSegments(geometryOf(lines), this.materials.paths));
    if (chosen.length) {
      const geometry = new LineSegmentsGeometry();
      geometry.setPositions(chosen);
      this.extras.add(new LineSegments2(geometry, this.materials.thickPath));
    }
  }

  clear() {
    for (const object of [...this.extras.children]) { object.geometry.dispose(); this.extras.remove(object); }
  }

  /** A position of the scene in CSS pixels of the holder, and its depth; z > 1 is behind the camera. */
  project(x, y, z) {
    const v = new THREE.Vector3(x, y, z).applyMatrix4(this.root.matrixWorld).project(this.camera), {clientWidth, clientHeight} = this.renderer.domElement;
    return [(v.x + 1) / 2 * clientWidth, (1 - v.y) / 2 * clientHeight, v.z];
  }

  /** The ray under a pixel, in the scene's coordinates. */
  ray([px, py]) {
    const {clientWidth, clientHeight} = this.renderer.domElement;
    const caster = new THREE.Raycaster();
    caster.setFromCamera(new THREE.Vector2(px / clientWidth * 2 - 1, 1 - py / clientHeight * 2), this.camera);
    return caster.ray.applyMatrix4(this.root.matrixWorld.clone().invert());
  }

  /** The point under the pointer on the plane through `through` that faces the camera. */
  onPlane(pixel, through) {
    const normal = this.camera.getWorldDirection(new THREE.Vector3()).transformDirection(this.root.matrixWorld.clone().invert());
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(normal, new THREE.Vector3(...through));
    return this.ray(pixel).intersectPlane(plane, new THREE.Vector3())?.toArray() ?? null;
  }

  close() {
    cancelAnimationFrame(this.pending);
    this.closed = true;
    this.clear();
    this.controls.dispose();
    this.renderer.dispose();
    this.renderer.domElement.remove();
  }
}

const cornersOf = (tree, node) => Array.from({length: 8}, (_, k) => [0, 1, 2].map((axis) => tree.bounds[6 * node + (k >> axis & 1 ? 3 : 0) + axis]));

/** The edges of one side of a box, as pairs of corners. */
function sideEdges(side) {
  const on = (corner) => (corner >> (side >> 1) & 1) === (side & 1);
  return edges.filter((_, i) => on(edges[i - i % 2]) && on(edges[i - i % 2 + 1]));
}

/** Two triangles that cover a side of a box. */
function quad(corners, side) {
  const axis = side >> 1, bit = side & 1, list = [0, 1, 2, 3, 4, 5, 6, 7].filter((k) => (k >> axis & 1) === bit);
  return [0, 1, 3, 0, 3, 2].flatMap((k) => corners[list[k]]);
}

function geometryOf(positions) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.Float32BufferAttribute(positions, 3));
  return geometry;
}

/** The materials of all objects: few, so that few shaders are compiled, and before anything is shown. */
function sharedMaterials() {
  const sheet = (opacity) => new THREE.MeshBasicMaterial({transparent: true, opacity, side: THREE.DoubleSide, depthWrite: false});
  return {
    mesh: new THREE.MeshLambertMaterial({flatShading: true, side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1}),
    wire: new THREE.LineBasicMaterial({transparent: true, opacity: 0.22}),
    points: new THREE.PointsMaterial({size: 8, sizeAttenuation: false, map: disc(), alphaTest: 0.5, transparent: true}),
    lines: new THREE.LineBasicMaterial({vertexColors: true}),
    paths: new THREE.LineBasicMaterial({transparent: true, opacity: 0.25}),
    sheets: {lit: sheet(0.35), side: sheet(0.4), pair: sheet(0.95)},
    thickInk: new LineMaterial({linewidth: 3}), thickPath: new LineMaterial({linewidth: 2}),
  };
}

function triangles(body) {
  const list = [];
  for (let primitive = 0; primitive < body.primitives; ++primitive) {
    const v = primitiveVertices(body, primitive);
    for (let k = 1; k + 1 < v.length; ++k) list.push(v[0], v[k], v[k + 1]);
  }
  return list;
}

function edgeList(body) {
  const list = [];
  for (let primitive = 0; primitive < body.primitives; ++primitive) {
    const v = primitiveVertices(body, primitive);
    for (let k = 0; k < v.length; ++k) list.push(v[k], v[(k + 1) % v.length]);
  }
  return list;
}

function boxOf(scene) {
  const box = new THREE.Box3();
  const p = new THREE.Vector3();
  for (const body of scene.bodies) for (const frame of body.positions) for (let i = 0; i < frame.length; i += 3) box.expandByPoint(p.set(frame[i], frame[i + 1], frame[i + 2]));
  return box;
}

/** Some thousand positions of the clip, evenly chosen. */
function sampleOf(scene) {
  const total = scene.bodies.reduce((sum, body) => sum + body.vertices * body.positions.length, 0), step = Math.ceil(total / 6000), sample = [];
  let k = 0;
  for (const body of scene.bodies) for (const frame of body.positions) for (let i = 0; i < frame.length; i += 3) if (k++ % step === 0) sample.push(frame[i], frame[i + 1], frame[i + 2]);
  return sample;
}

let discTexture = null;
function disc() {
  if (discTexture) return discTexture;
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = 64;
  const c = canvas.getContext('2d');
  c.fillStyle = '#fff';
  c.beginPath(); c.arc(32, 32, 30, 0, 7); c.fill();
  return discTexture = new THREE.CanvasTexture(canvas);
}
