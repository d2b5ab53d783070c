// Takes a chunk apart: the other side of page_chunk.cpp, which says how it is kept.
import {Bytes} from './bytes.js';

const IMPULSE_DECADE = 400, ACCURACY_DECADE = 1000, PRESS_DECADE = 40, OCTAHEDRON = 1023;

const bit = (bytes, i) => (bytes[i >> 3] >> (i & 7)) & 1;
const fromLog = (code, decade) => (code === 0 ? 0 : 10 ** ((code - 1) / decade - 20));

function fromOctahedron(u, v, out, at) {
  let x = u / OCTAHEDRON, y = v / OCTAHEDRON;
  const z = 1 - Math.abs(x) - Math.abs(y);
  if (z < 0) [x, y] = [(1 - Math.abs(y)) * (x < 0 ? -1 : 1), (1 - Math.abs(x)) * (y < 0 ? -1 : 1)];
  const length = Math.hypot(x, y, z) || 1;
  out[at] = x / length, out[at + 1] = y / length, out[at + 2] = z / length;
}

// Numbers that follow a straight line from frame to frame, and their differences to it.
class Tracks {
  constructor(count) {
    this.last = new Float64Array(count);
    this.before = new Float64Array(count);
    this.seen = new Uint8Array(count);
  }
  next(i, difference) {
    const seen = this.seen[i];
    const expected = seen === 0 ? 0 : seen === 1 ? this.last[i] : 2 * this.last[i] - this.before[i];
    this.before[i] = this.last[i];
    if (seen < 2) ++this.seen[i];
    return (this.last[i] = expected + difference);
  }
}

// An array of frames: positions and rotations (x y z w), frozen, island, accuracy, each per body.
export function decodeBodies(array, steps) {
  const bytes = new Bytes(array);
  const frames = bytes.whole(), n = bytes.whole();
  const still = bytes.take((n + 7) >> 3);
  const restPosition = new Float32Array(3 * n), restRotation = new Float32Array(4 * n);
  const moving = [];
  for (let i = 0; i < n; ++i) {
    if (!bit(still, i)) {
      moving.push(i);
      continue;
    }
    for (let k = 0; k < 3; ++k) restPosition[3 * i + k] = bytes.float();
    for (let k = 0; k < 4; ++k) restRotation[4 * i + k] = bytes.float();
  }
  const m = moving.length;
  const places = new Tracks(3 * m), parts = new Tracks(3 * m);
  const leftOut = new Int8Array(m).fill(-1);
  let frozenBits = new Uint8Array((n + 7) >> 3), lastIsland = new Int32Array(n).fill(-1);
  const result = [];
  for (let f = 0; f < frames; ++f) {
    const positions = restPosition.slice(), rotations = restRotation.slice();
    for (let axis = 0; axis < 3; ++axis) {
      for (let j = 0; j < m; ++j) positions[3 * moving[j] + axis] = places.next(3 * j + axis, bytes.signed()) * steps.position;
    }
    const left = bytes.take(m);
    for (let j = 0; j < m; ++j) {
      if (left[j] !== leftOut[j]) parts.seen[3 * j] = parts.seen[3 * j + 1] = parts.seen[3 * j + 2] = 0;
      leftOut[j] = left[j];
    }
    for (let k = 0; k < 3; ++k) {
      for (let j = 0; j < m; ++j) {
        rotations[4 * moving[j] + k + (k >= left[j])] = parts.next(3 * j + k, bytes.signed()) * steps.rotation;
      }
    }
    for (let j = 0; j < m; ++j) {
      const at = 4 * moving[j];
      rotations[at + left[j]] = 0;
      let rest = 1;
      for (let k = 0; k < 4; ++k) rest -= rotations[at + k] ** 2;
      rotations[at + left[j]] = Math.sqrt(Math.max(rest, 0));
    }
    const changed = bytes.take(frozenBits.length);
    frozenBits = frozenBits.map((byte, k) => byte ^ changed[k]);
    const frozen = new Uint8Array(n), island = new Int32Array(n), accuracy = new Float32Array(n), codes = new Int32Array(n);
    for (let i = 0; i < n; ++i) frozen[i] = bit(frozenBits, i);
    for (let i = 0; i < n; ++i) island[i] = lastIsland[i] + bytes.signed();
    for (let i = 0; i < n; ++i) {
      const first = island[i];
      codes[i] = bytes.signed() + (first >= 0 && first < i ? codes[first] : 0);
      accuracy[i] = fromLog(codes[i], ACCURACY_DECADE);
    }
    lastIsland = island;
    result.push({positions, rotations, frozen, island, accuracy});
  }
  return result;
}

// An array of frames, which all have the same bodies, that are some or all of `kinds`: contacts as arrays (a, b, points, normals, directions of the impulses, sizes), how many there were (all), and
// what presses most on each body.
export function decodeContacts(array, frames, kinds, steps) {
  const bytes = new Bytes(array);
  const n = frames[0].frozen.length;
  const pressCodes = new Int32Array(n);
  let before = null;
  return frames.map(({positions}) => {
    const all = bytes.whole(), kept = bytes.whole();
    const press = new Float32Array(n);
    if (kept < all) {
      for (let i = 0; i < n; ++i) press[i] = fromLog(pressCodes[i] += bytes.signed(), PRESS_DECADE);
    }
    const a = new Int32Array(kept), b = new Int32Array(kept), values = [];
    for (let c = 0, last = 0; c < kept; ++c) last = a[c] = last + bytes.whole();
    for (let c = 0; c < kept; ++c) b[c] = a[c] + bytes.signed();
    const same = new Int32Array(kept).fill(-1);  // that contact in the frame before
    for (let c = 0, p = 0; before && c < kept; ++c) {
      while (p < before.a.length && (before.a[p] < a[c] || (before.a[p] === a[c] && before.b[p] < b[c]))) ++p;
      if (p < before.a.length && before.a[p] === a[c] && before.b[p] === b[c]) same[c] = p++;
    }
    for (let k = 0; k < 8; ++k) {
      const plane = new Float64Array(kept);
      for (let c = 0; c < kept; ++c) plane[c] = bytes.signed() + (same[c] < 0 ? 0 : before.values[k][same[c]]);
      values.push(plane);
    }
    before = {a, b, values};

    const points = new Float32Array(3 * kept), normals = new Float32Array(3 * kept), directions = new Float32Array(3 * kept);
    const sizes = new Float32Array(kept);
    for (let c = 0; c < kept; ++c) {
      const anchor = kinds[a[c]] === 'dynamic' ? a[c] : b[c];
      for (let k = 0; k < 3; ++k) {
        const place = Math.floor(positions[3 * anchor + k] / steps.position + 0.5);
        points[3 * c + k] = (place + values[k][c]) * steps.position;
      }
      const u = values[3][c], v = values[4][c];
      fromOctahedron(u, v, normals, 3 * c);
      fromOctahedron(u + values[6][c], v + values[7][c], directions, 3 * c);
      sizes[c] = fromLog(values[5][c], IMPULSE_DECADE);
      if (kept < all) continue;
      let along = 0;
      for (let k = 0; k < 3; ++k) along += normals[3 * c + k] * directions[3 * c + k];
      for (const body of [a[c], b[c]]) press[body] = Math.max(press[body], Math.abs(along) * sizes[c]);
    }
    return {all, count: kept, a, b, points, normals, directions, sizes, press};
  });
}
