// The bodies that are drawn solid: one instanced mesh a shape.
import {BackSide, Color, DynamicDrawUsage, Group, InstancedBufferAttribute, InstancedMesh, Matrix4, Mesh, MeshBasicMaterial, MeshLambertMaterial,
  MeshStandardMaterial} from 'three';
import {Merged} from './merged.js';
import {writePose} from './pose.js';
import {geometryOf} from './shapes.js';

// Boxes get a fine line along their edges, so that a heap of one colour is still a heap of boxes.
function withEdges(material) {
  material.onBeforeCompile = (shader) => {
    shader.vertexShader = shader.vertexShader
      .replace('#include <common>', 'varying vec2 vFace;\n#include <common>')
      .replace('#include <begin_vertex>', '#include <begin_vertex>\nvFace = uv;');
    shader.fragmentShader = shader.fragmentShader
      .replace('#include <common>', 'varying vec2 vFace;\n#include <common>')
      .replace('#include <color_fragment>', `#include <color_fragment>
        vec2 pixel = fwidth(vFace);
        vec2 toEdge = min(vFace, 1.0 - vFace) / pixel;
        float edge = 1.0 - smoothstep(0.5, 1.7, min(toEdge.x, toEdge.y));
        float near = 1.0 - smoothstep(0.03, 0.2, max(pixel.x, pixel.y));
        diffuseColor.rgb *= 1.0 - 0.34 * edge * near;`);
  };
  return material;
}

export class Bodies {
  // solid: numbers of the bodies to draw.
  constructor(head, solid) {
    this.group = new Group();
    this.placeOf = new Map();  // body -> [mesh, instance]
    this.meshes = [];
    this.merged = [];  // the same bodies, made when first they are drawn plainly
    this.solid = true;
    const byShape = new Map();
    for (const i of solid) {
      const shape = head.bodies.shape[i];
      if (!byShape.has(shape)) byShape.set(shape, []);
      byShape.get(shape).push(i);
    }
    for (const [shape, numbers] of byShape) {
      const smooth = new MeshStandardMaterial({roughness: 0.72, metalness: 0});
      const material = head.shapes[shape].kind === 'box' ? withEdges(smooth) : smooth;
      const mesh = new InstancedMesh(geometryOf(head.shapes[shape], solid.length), material, numbers.length);
      mesh.instanceMatrix.setUsage(DynamicDrawUsage);
      mesh.instanceColor = new InstancedBufferAttribute(new Float32Array(3 * numbers.length).fill(0.5), 3);
      mesh.castShadow = mesh.receiveShadow = true;
      mesh.frustumCulled = false;
      mesh.userData.numbers = numbers;
      numbers.forEach((i, k) => this.placeOf.set(i, [mesh, k]));
      this.meshes.push(mesh);
      this.group.add(mesh);
    }
    this.halo = new Mesh(undefined, new MeshBasicMaterial({side: BackSide}));
    this.halo.visible = false;
    this.halo.matrixAutoUpdate = false;
    this.group.add(this.halo);
    this.head = head;
  }

  get drawn() {
    return this.meshes.reduce((sum, mesh) => sum + mesh.count, 0);
  }

  setFrame(frame) {
    for (const mesh of this.meshes) {
      const matrices = mesh.instanceMatrix.array;
      mesh.userData.numbers.forEach((i, k) => {
        if (i < frame.frozen.length) return writePose(frame, i, matrices, 16 * k);
        matrices.fill(0, 16 * k, 16 * k + 15);  // added later: a point, which is not drawn
        matrices[16 * k + 15] = 1;
      });
      mesh.instanceMatrix.needsUpdate = true;
      mesh.boundingSphere = null;  // of the frame before; picking makes it anew
    }
    this.changed = true;
  }

  paint(mode, frame) {
    mode.colours(frame, (i, [r, g, b]) => {
      const place = this.placeOf.get(i);
      if (!place) return;
      const colours = place[0].instanceColor.array;
      colours[3 * place[1]] = r, colours[3 * place[1] + 1] = g, colours[3 * place[1] + 2] = b;
    });
    for (const mesh of this.meshes) mesh.instanceColor.needsUpdate = true;
    this.changed = true;
  }

  // Which of the meshes the next picture has. Those of instances stay what is picked.
  prepare(plain) {
    if (plain && this.merged.length === 0) {
      this.merged = this.meshes.map((mesh) => {
        const lambert = new MeshLambertMaterial({vertexColors: true});
        return new Merged(mesh, this.head.shapes[this.head.bodies.shape[mesh.userData.numbers[0]]].kind === 'box' ? withEdges(lambert) : lambert);
      });
      for (const {mesh} of this.merged) this.group.add(mesh);
      this.setSolid(this.solid);
      this.changed = true;
    }
    if (plain && this.changed) {
      for (const merged of this.merged) merged.update();
      this.changed = false;
    }
    for (const mesh of this.meshes) mesh.visible = !plain;
    for (const {mesh} of this.merged) mesh.visible = plain;
  }

  setSolid(solid) {
    this.solid = solid;
    for (const {material} of [...this.meshes, ...this.merged.map(({mesh}) => mesh)]) {
      material.transparent = !solid;
      material.opacity = solid ? 1 : 0.16;
      material.depthWrite = solid;
      material.needsUpdate = true;
    }
  }

  // A rim of the accent's colour around the body that is picked.
  setPicked(i, frame, colour) {
    const place = this.placeOf.get(i);
    this.halo.visible = place !== undefined && i < frame.frozen.length;
    if (!this.halo.visible) return;
    const shape = this.head.shapes[this.head.bodies.shape[i]];
    if (this.halo.userData.shape !== shape) this.halo.geometry = geometryOf(shape, 1);
    this.halo.userData.shape = shape;
    this.halo.material.color = new Color(colour);
    const pose = new Float32Array(16);
    writePose(frame, i, pose, 0);
    this.halo.matrix.fromArray(pose).multiply(new Matrix4().makeScale(1.12, 1.12, 1.12));
    this.halo.matrixWorldNeedsUpdate = true;
  }

  pick(raycaster) {
    const [hit] = raycaster.intersectObjects(this.meshes, false);
    return hit ? {body: hit.object.userData.numbers[hit.instanceId], distance: hit.distance, point: hit.point} : null;
  }

  dispose() {
    for (const mesh of [...this.meshes, ...this.merged.map(({mesh}) => mesh), this.halo]) {
      mesh.geometry.dispose();
      mesh.material.dispose();
      mesh.dispose?.();
    }
  }
}
