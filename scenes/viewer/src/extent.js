// What the camera is to see: where the bodies that move are in five frames, those that flew off apart.
import {Box3, Vector3} from 'three';

export async function extentOf(film, bodyRadius) {
  const {head} = film;
  const {lower, upper} = head.bounds ?? {};
  const allowed = head.bounds ? new Box3(new Vector3(...lower), new Vector3(...upper)) : null;
  const box = new Box3(), first = new Box3(), point = new Vector3();
  for (let k = 0; k <= 4; ++k) {
    const frame = await film.frame(Math.round(((film.frames - 1) * k) / 4), false);
    head.bodies.kind.forEach((kind, i) => {
      point.fromArray(frame.positions, 3 * i);
      if (kind === 'dynamic' && (!allowed || allowed.containsPoint(point))) box.expandByPoint(point);
    });
    if (k > 0) continue;
    first.copy(box);
    if (first.isEmpty()) {
      head.bodies.kind.forEach((kind, i) => {
        if (head.shapes[head.bodies.shape[i]].kind !== 'half-space') first.expandByPoint(point.fromArray(frame.positions, 3 * i));
      });
    }
    if (first.isEmpty()) first.set(new Vector3(-1, -1, -1), new Vector3(1, 1, 1));
  }
  const reach = first.clone().expandByScalar(2 * first.getSize(new Vector3()).length() + 12 * bodyRadius);
  const seen = box.isEmpty() ? first : box.intersect(reach);
  return {all: seen.expandByScalar(bodyRadius), first};
}
