// Position and rotation of body i of a frame as the matrix that three wants, column by column.

export function writePose(frame, i, out, at) {
  const p = frame.positions, q = frame.rotations;
  const x = q[4 * i], y = q[4 * i + 1], z = q[4 * i + 2], w = q[4 * i + 3];
  out[at] = 1 - 2 * (y * y + z * z), out[at + 1] = 2 * (x * y + w * z), out[at + 2] = 2 * (x * z - w * y), out[at + 3] = 0;
  out[at + 4] = 2 * (x * y - w * z), out[at + 5] = 1 - 2 * (x * x + z * z), out[at + 6] = 2 * (y * z + w * x), out[at + 7] = 0;
  out[at + 8] = 2 * (x * z + w * y), out[at + 9] = 2 * (y * z - w * x), out[at + 10] = 1 - 2 * (x * x + y * y), out[at + 11] = 0;
  out[at + 12] = p[3 * i], out[at + 13] = p[3 * i + 1], out[at + 14] = p[3 * i + 2], out[at + 15] = 1;
}
