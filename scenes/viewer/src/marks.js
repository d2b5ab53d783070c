// Contacts: points, normals (out of the first body), forces on the second body. An arrow's length grows with the logarithm of the
// force, so that a weight and a thousand weights are both seen. Those of the picked body have the accent's colour.
import {BufferGeometry, Color, ConeGeometry, CylinderGeometry, DynamicDrawUsage, Float32BufferAttribute, Group, IcosahedronGeometry, InstancedMesh,
  LineBasicMaterial, LineSegments, Matrix4, MeshBasicMaterial, Quaternion, Vector3} from 'three';

const UP = new Vector3(0, 0, 1);

class Instances {
  constructor(geometry, group) {
    this.geometry = geometry;
    this.group = group;
    this.mesh = null;
  }
  reserve(count) {
    if (this.mesh && this.mesh.instanceMatrix.count >= count) return;
    if (this.mesh) {
      this.group.remove(this.mesh);
      this.mesh.dispose();
    }
    const room = Math.max(64, Math.ceil(1.5 * count));
    this.mesh = new InstancedMesh(this.geometry, new MeshBasicMaterial(), room);
    this.mesh.instanceMatrix.setUsage(DynamicDrawUsage);
    this.mesh.setColorAt(0, new Color());
    this.mesh.frustumCulled = false;
    this.group.add(this.mesh);
  }
  set count(count) {
    this.reserve(count);
    this.mesh.count = count;
    this.mesh.instanceMatrix.needsUpdate = this.mesh.instanceColor.needsUpdate = true;
  }
  get count() {
    return this.mesh?.count ?? 0;
  }
}

export class Marks {
  // bodyRadius: [m] and weight: [N] of a typical body; dt: [s].
  constructor(bodyRadius, weight, dt) {
    this.group = new Group();
    this.radius = bodyRadius;
    this.weight = weight;
    this.dt = dt;
    const thin = 0.035 * bodyRadius;
    this.points = new Instances(new IcosahedronGeometry(0.08 * bodyRadius, 1), this.group);
    this.shafts = new Instances(new CylinderGeometry(thin, thin, 1, 8).translate(0, 0.5, 0).rotateX(Math.PI / 2), this.group);
    this.heads = new Instances(new ConeGeometry(3 * thin, 8 * thin, 12).translate(0, 4 * thin, 0).rotateX(Math.PI / 2), this.group);
    this.normals = new LineSegments(new BufferGeometry(), new LineBasicMaterial({vertexColors: true}));
    this.normals.frustumCulled = false;
    this.group.add(this.normals);
    this.show = {points: false, normals: false, forces: false};
  }

  get wanted() {
    return this.show.points || this.show.normals || this.show.forces;
  }

  arrowLength(force) {
    return 0.6 * this.radius * Math.log2(1 + force / this.weight);
  }

  setFrame(contacts, picked, theme) {
    const {points, normals, forces} = this.show;
    const many = contacts?.count ?? 0;
    const matrix = new Matrix4(), at = new Vector3(), turn = new Quaternion(), along = new Vector3(), size = new Vector3();
    const accent = new Color(theme.accent);
    const colour = (c, plain) => (contacts.a[c] === picked || contacts.b[c] === picked ? accent : plain);

    this.points.count = points ? many : 0;
    const pointColour = new Color(theme.point);
    for (let c = 0; points && c < many; ++c) {
      this.points.mesh.setMatrixAt(c, matrix.makeTranslation(...contacts.points.subarray(3 * c, 3 * c + 3)));
      this.points.mesh.setColorAt(c, colour(c, pointColour));
    }

    const lines = new Float32Array(normals ? 6 * many : 0), tints = new Float32Array(lines.length);
    const normalColour = new Color(theme.normal);
    for (let c = 0; normals && c < many; ++c) {
      const tint = colour(c, normalColour).toArray();
      for (let k = 0; k < 3; ++k) {
        lines[6 * c + k] = contacts.points[3 * c + k];
        lines[6 * c + 3 + k] = contacts.points[3 * c + k] + 0.5 * this.radius * contacts.normals[3 * c + k];
      }
      tints.set(tint, 6 * c);
      tints.set(tint, 6 * c + 3);
    }
    this.normals.geometry.dispose();
    this.normals.geometry = new BufferGeometry().setAttribute('position', new Float32BufferAttribute(lines, 3))
      .setAttribute('color', new Float32BufferAttribute(tints, 3));

    this.shafts.count = this.heads.count = forces ? many : 0;
    const forceColour = new Color(theme.force);
    for (let c = 0; forces && c < many; ++c) {
      const side = contacts.a[c] === picked ? -1 : 1;  // on the picked body, else on b
      along.set(...contacts.directions.subarray(3 * c, 3 * c + 3)).multiplyScalar(side);
      at.set(...contacts.points.subarray(3 * c, 3 * c + 3));
      turn.setFromUnitVectors(UP, along);
      const length = this.arrowLength(contacts.sizes[c] / this.dt), thick = Math.min(1, length / (0.4 * this.radius));
      this.shafts.mesh.setMatrixAt(c, matrix.compose(at, turn, size.set(thick, thick, length)));
      this.heads.mesh.setMatrixAt(c, matrix.compose(at.addScaledVector(along, length), turn, size.setScalar(thick)));
      const tint = colour(c, forceColour);
      this.shafts.mesh.setColorAt(c, tint);
      this.heads.mesh.setColorAt(c, tint);
    }
  }

  get drawn() {
    return {points: this.points.count, normals: this.normals.geometry.attributes.position?.count / 2 || 0, forces: this.shafts.count};
  }
}
