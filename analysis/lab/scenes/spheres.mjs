/** Two icospheres whose vertices fly away from their centres until the spheres overlap. */
export function spheres(scene, mesh) {
  const {vertices, indices} = icosphere(2);
  const body = (name, cx, cy) => {
    const at = (radius) => vertices.flatMap(([x, y, z]) => [cx + x * radius, cy + y * radius, z * radius]);
    return mesh(name, indices, [0, 2], [at(0.5), at(1.35)]);
  };
  return scene('Two expanding spheres',
      'Two spheres of 320 triangles each expand until they overlap. Directions never change, so no bound changes hands; only a separation list has events.', 3,
      [body('left', -1.1, 0), body('right', 1.1, 0.25)], 20, [[0, 1]]);
}

/** Divides an icosahedron `levels` times; all vertices have length 1. */
function icosphere(levels) {
  const g = (1 + Math.sqrt(5)) / 2;
  let vertices = [[-1, g, 0], [1, g, 0], [-1, -g, 0], [1, -g, 0], [0, -1, g], [0, 1, g], [0, -1, -g], [0, 1, -g],
                  [g, 0, -1], [g, 0, 1], [-g, 0, -1], [-g, 0, 1]].map(unit);
  let faces = [[0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6],
               [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10],
               [8, 6, 7], [9, 8, 1]];
  for (let level = 0; level < levels; ++level) {
    const middle = new Map();
    const between = (a, b) => {
      const key = a < b ? `${a} ${b}` : `${b} ${a}`;
      if (!middle.has(key)) {
        middle.set(key, vertices.length);
        vertices.push(unit(vertices[a].map((x, i) => (x + vertices[b][i]) / 2)));
      }
      return middle.get(key);
    };
    faces = faces.flatMap(([a, b, c]) => {
      const ab = between(a, b), bc = between(b, c), ca = between(c, a);
      return [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]];
    });
  }
  return {vertices, indices: faces.flat()};
}

function unit([x, y, z]) {
  const length = Math.sqrt(x * x + y * y + z * z);
  return [x / length, y / length, z / length];
}
