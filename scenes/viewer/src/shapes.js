// What three draws of each shape of a film. Lengths in metres, in the body's axes; capsules and cylinders stand on z.
import {BoxGeometry, BufferGeometry, CapsuleGeometry, CylinderGeometry, Float32BufferAttribute, SphereGeometry} from 'three';

// Faces with a corner of their own each, so that edges are sharp.
export function polygons(vertices, faces) {
  const points = [], normals = [];
  for (const face of faces) {
    const [p, q, r] = [vertices[face[0]], vertices[face[1]], vertices[face[2]]];
    const u = q.map((x, k) => x - p[k]), v = r.map((x, k) => x - p[k]);
    const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    for (let i = 1; i + 1 < face.length; ++i) {
      for (const corner of [face[0], face[i], face[i + 1]]) {
        points.push(...vertices[corner]);
        normals.push(...normal);
      }
    }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new Float32BufferAttribute(points, 3));
  geometry.setAttribute('normal', new Float32BufferAttribute(normals, 3));
  geometry.setAttribute('uv', new Float32BufferAttribute(new Float32Array((2 * points.length) / 3).fill(0.5), 2));
  geometry.normalizeNormals();
  return geometry;
}

const BOX_FACES = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

// Corners and faces of a box or a hull; null of what is round.
export function polytope(shape) {
  if (shape.kind === 'hull') return {vertices: shape.vertices, faces: shape.faces};
  if (shape.kind !== 'box') return null;
  const [x, y, z] = shape.half_extents;
  const vertices = [];
  for (let i = 0; i < 8; ++i) vertices.push([i & 1 ? x : -x, i & 2 ? y : -y, i & 4 ? z : -z]);
  return {vertices, faces: BOX_FACES};
}

// many: of so many bodies, so round ones get fewer corners.
export function geometryOf(shape, many) {
  const round = many > 2000 ? 12 : many > 300 ? 20 : 40;
  switch (shape.kind) {
    case 'sphere':
      return new SphereGeometry(shape.radius, round, round / 2).rotateX(Math.PI / 2);
    case 'capsule':
      return new CapsuleGeometry(shape.radius, 2 * shape.half_length, round / 4, round).rotateX(Math.PI / 2);
    case 'cylinder':
      return new CylinderGeometry(shape.radius, shape.radius, 2 * shape.half_length, round).rotateX(Math.PI / 2);
    case 'hull':
      return polygons(shape.vertices, shape.faces);
    default: {
      const [x, y, z] = shape.half_extents;
      return new BoxGeometry(2 * x, 2 * y, 2 * z);
    }
  }
}

export function radiusOf(shape) {
  switch (shape.kind) {
    case 'half-space':
      return Infinity;
    case 'sphere':
      return shape.radius;
    case 'capsule':
      return shape.radius + shape.half_length;
    case 'cylinder':
      return Math.hypot(shape.radius, shape.half_length);
    case 'hull':
      return Math.max(...shape.vertices.map((v) => Math.hypot(...v)));
    default:
      return Math.hypot(...shape.half_extents);
  }
}
