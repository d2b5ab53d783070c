// What the camera is to see: where the bodies that move are in five frames, those that flew off apart, and what is solid
// beside them.
import {Box3, Vector3} from 'three';

export async function extentOf(film, bodyRadius, solid) {
  const {head} = film;
  const {lower, upper} = head.bounds ?? {};
  const allowed = head.bounds ? new Box3(new Vector3(...lower), new Vector3(...upper)) : null;
  const box = new Box3(), first = new Box3(), point = new Vector3(), seenAt = [];
  for (let k = 0; k <= 4; ++k) {
    const frame = await film.frame(Math.round(((film.frames - 1) * k) / 4), false);
    head.bodies.kind.slice(0, frame.frozen.length).forEach((kind, i) => {
      point.fromArray(frame.positions, 3 * i);
      if (kind === 'dynamic' && (!allowed || allowed.containsPoint(point))) {
        box.expandByPoint(point);
        seenAt.push(point.clone());
      }
    });
    if (k > 0) continue;
    first.copy(box);
    if (first.isEmpty()) {
      for (const i of solid) first.expandByPoint(point.fromArray(frame.positions, 3 * i));
    }
    if (first.isEmpty()) first.set(new Vector3(-1, -1, -1), new Vector3(1, 1, 1));
    for (const i of solid) {
      if (head.bodies.kind[i] !== 'dynamic') box.expandByPoint(point.fromArray(frame.positions, 3 * i));
    }
  }
  const reach = first.clone().expandByScalar(2 * first.getSize(new Vector3()).length() + 12 * bodyRadius);
  // Where most of them leave it, it is no matter of some that flew off: one ball that falls.
  const inside = seenAt.filter((at) => reach.containsPoint(at)).length;
  const seen = box.isEmpty() ? first : 2 * inside < seenAt.length ? box : box.intersect(reach);
  return {all: seen.expandByScalar(bodyRadius), first};
}
