// What holds the scene: large fixed boxes and hulls, and half-spaces. It must not hide the scene, so
//   - faces that look at the scene are drawn from that side alone, translucent: a wall in front is not seen,
//   - the other faces are a breath of glass with thin edges,
//   - a half-space, or a box as wide as the scene, is a grid, seen from outside.
import {BufferGeometry, Color, Float32BufferAttribute, Group, LineBasicMaterial, LineSegments, Mesh, MeshLambertMaterial, MeshStandardMaterial, PlaneGeometry,
  ShaderMaterial, ShadowMaterial, Vector3} from 'three';
import {writePose} from './pose.js';
import {polygons, polytope, radiusOf} from './shapes.js';

export const MOST_WALLS = 300;

export function isWall(head, i, bodyRadius) {
  const shape = head.shapes[head.bodies.shape[i]];
  if (shape.kind === 'half-space') return true;
  if (head.bodies.kind[i] === 'dynamic' || !polytope(shape)) return false;
  // A beam hides little, however long.
  const breadth = shape.kind === 'box' ? [...shape.half_extents].sort((a, b) => a - b)[1] : radiusOf(shape);
  return breadth > 2.5 * bodyRadius;
}

// [m] how high the top of a box lies above its centre, if it is as wide as the scene: a floor. Else null.
function floorHeight(shape, part, size) {
  if (shape.kind !== 'box') return null;
  const [x, y, z] = shape.half_extents;
  const upright = new Vector3(0, 0, 1).transformDirection(part.matrix).z > 1 - 1e-6;
  return upright && Math.min(x, y) > 0.5 * size ? z : null;
}

// Of a convex body: normal and distance from its centre of each face's plane.
function planes({vertices, faces}) {
  return faces.map((face) => {
    const [p, q, r] = face.slice(0, 3).map((v) => new Vector3(...vertices[v]));
    const normal = q.sub(p).cross(r.sub(p)).normalize();
    return {normal, offset: normal.dot(p)};
  });
}

function edges({vertices, faces}) {
  const points = [], seen = new Set();
  for (const face of faces) {
    face.forEach((from, k) => {
      const to = face[(k + 1) % face.length], key = Math.min(from, to) * vertices.length + Math.max(from, to);
      if (!seen.has(key)) points.push(...vertices[from], ...vertices[to]);
      seen.add(key);
    });
  }
  return new BufferGeometry().setAttribute('position', new Float32BufferAttribute(points, 3));
}

const GRID_VERTEX = `
  varying vec2 vPlace;
  void main() {
    vPlace = position.xy;
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  }`;
const GRID_FRAGMENT = `
  uniform vec3 colour;
  uniform float cell, reach;
  uniform vec2 middle;
  varying vec2 vPlace;
  float lines(float size) {
    vec2 at = vPlace / size, width = fwidth(at);
    vec2 d = abs(fract(at - 0.5) - 0.5) / width;
    float fade = 1.0 - smoothstep(0.15, 0.5, max(width.x, width.y));
    return fade * (1.0 - min(min(d.x, d.y), 1.0));
  }
  void main() {
    float far = 1.0 - smoothstep(0.3, 1.0, length(vPlace - middle) / reach);
    float ink = max(0.45 * lines(cell), 0.95 * lines(10.0 * cell));
    gl_FragColor = vec4(colour, far * (0.05 + 0.42 * ink));
    #include <colorspace_fragment>
  }`;

export class Walls {
  // middle: [m] of the scene; size: [m] of it.
  constructor(head, numbers, frame, middle, size) {
    this.group = new Group();
    this.parts = [];
    const inner = {transparent: true, opacity: 0.5, depthWrite: false}, outer = {...inner, opacity: 0.05};
    this.inner = new MeshStandardMaterial({roughness: 0.95, ...inner});
    this.outer = new MeshStandardMaterial({roughness: 0.95, ...outer});
    this.plain = new Map([[this.inner, new MeshLambertMaterial(inner)], [this.outer, new MeshLambertMaterial(outer)]]);
    this.faces = [];  // mesh, its material
    this.isPlain = false;
    this.line = new LineBasicMaterial({transparent: true, opacity: 0.3, depthWrite: false});
    this.grid = new ShaderMaterial({
      vertexShader: GRID_VERTEX, fragmentShader: GRID_FRAGMENT, transparent: true, depthWrite: false,
      uniforms: {colour: {value: new Color()}, cell: {value: 10 ** Math.round(Math.log10(size / 12))}, reach: {value: 3 * size}, middle: {value: null}},
    });
    this.shadow = new ShadowMaterial({opacity: 0.22, depthWrite: false});
    numbers.forEach((i) => this.#add(head, i, frame, middle, size));
    this.setFrame(frame);
  }

  #add(head, i, frame, middle, size) {
    const part = new Group();
    part.matrixAutoUpdate = false;
    part.userData.body = i;
    const pose = new Float32Array(16);
    writePose(frame, i, pose, 0);
    part.matrix.fromArray(pose);
    part.updateMatrixWorld(true);
    const seenFrom = part.worldToLocal(middle.clone());
    const shape = head.shapes[head.bodies.shape[i]];
    const floor = shape.kind === 'half-space' ? 0 : floorHeight(shape, part, size);
    if (floor !== null) {
      this.#addGrid(part, seenFrom, size, floor, shape.half_extents ?? [Infinity, Infinity]);
    } else {
      const {vertices, faces} = polytope(shape);
      part.userData.planes = planes({vertices, faces});
      const looksInside = (face) => {
        const [p, q, r] = face.slice(0, 3).map((v) => new Vector3(...vertices[v]));
        const normal = q.sub(p).cross(r.sub(p));
        return normal.dot(seenFrom.clone().sub(p)) > 0;
      };
      const inner = new Mesh(polygons(vertices, faces.filter(looksInside)), this.inner);
      inner.receiveShadow = true;
      const outer = new Mesh(polygons(vertices, faces.filter((f) => !looksInside(f))), this.outer);
      this.faces.push([inner, this.inner], [outer, this.outer]);
      part.add(inner, outer, new LineSegments(edges({vertices, faces}), this.line));
    }
    this.parts.push(part);
    this.group.add(part);
  }

  // On z = height, as far as the fog or the box goes.
  #addGrid(part, seenFrom, size, height, [x, y]) {
    const low = [Math.max(-x, seenFrom.x - 4 * size), Math.max(-y, seenFrom.y - 4 * size)];
    const high = [Math.min(x, seenFrom.x + 4 * size), Math.min(y, seenFrom.y + 4 * size)];
    const grid = this.grid.clone();
    grid.uniforms.colour = this.grid.uniforms.colour;
    grid.uniforms.middle.value = seenFrom;
    for (const material of [grid, this.shadow]) {
      const plane = new Mesh(new PlaneGeometry(high[0] - low[0], high[1] - low[1]), material);
      plane.geometry.translate((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, height);
      plane.receiveShadow = material === this.shadow;
      plane.renderOrder = -1;
      part.add(plane);
    }
  }

  setFrame(frame) {
    const pose = new Float32Array(16);
    for (const part of this.parts) {
      writePose(frame, part.userData.body, pose, 0);
      part.matrix.fromArray(pose);
      part.matrixWorldNeedsUpdate = true;
    }
  }

  // Plainly there is no shadow to receive.
  prepare(plain) {
    if (plain === this.isPlain) return;
    this.isPlain = plain;
    for (const [mesh, material] of this.faces) mesh.material = plain ? this.plain.get(material) : material;
    this.shadow.visible = !plain;
  }

  // [m] along a ray: where a ball is behind the last wall that stands before so many metres; 0 if none does.
  behind(ray, metres, radius) {
    let start = 0;
    for (const part of this.parts) {
      if (!part.userData.planes) continue;
      const {origin, direction} = ray.clone().applyMatrix4(part.matrix.clone().invert());
      let enters = -Infinity, leaves = Infinity, slope = 1;
      for (const {normal, offset} of part.userData.planes) {
        const along = normal.dot(direction), at = (offset - normal.dot(origin)) / along;
        if (along < 0) enters = Math.max(enters, at);
        else if (at < leaves) [leaves, slope] = [at, along];
      }
      if (enters < Math.min(leaves, metres) && leaves > 0) start = Math.max(start, leaves + (1.01 * radius) / slope);
    }
    return start;
  }

  setTheme({wall, line}) {
    for (const material of [this.inner, this.outer, ...this.plain.values()]) material.color.set(wall);
    this.line.color.set(line);
    this.grid.uniforms.colour.value.set(line);
  }
}
