// What a live run can be asked: gravity and friction by sliders, a ball that is thrown, a body that is dragged.
import {BufferGeometry, Float32BufferAttribute, Line, LineBasicMaterial, Plane, Quaternion, Vector3} from 'three';
import {number} from './format.js';

const $ = (id) => document.getElementById(id);

const EARTH = 9.81;    // [m/s^2]
const CLICK = 4;       // [px] a pointer that moves less was not meant to drag
const BALL_WEIGHT = 3;  // typical bodies

const within = (x, [low, high]) => Math.min(Math.max(x, low), high);

export class LiveControls {
  // bodyRadius: [m] and bodyMass: [kg] of a typical body, size: [m] of the scene.
  constructor(viewer, {bodyRadius, bodyMass, size}) {
    Object.assign(this, {viewer, source: viewer.film.source, bodyRadius, bodyMass, size});
    this.held = null;
    this.rope = new Line(new BufferGeometry(), new LineBasicMaterial({depthTest: false, transparent: true}));
    this.rope.geometry.setAttribute('position', new Float32BufferAttribute(new Float32Array(6), 3));
    this.rope.frustumCulled = false;
    this.rope.visible = false;
    const {gravity} = this.source.head, pull = Math.hypot(...gravity);
    this.down = pull > 0 ? gravity.map((x) => x / pull) : [0, 0, -1];
    $('gravity').max = Math.ceil(2 * Math.max(pull, EARTH));
    $('gravity').min = -$('gravity').max;
    $('live-panel').hidden = false;
    document.body.classList.add('live');
    this.#listen();
    this.tellState();
  }

  say(why) {
    $('live-note').textContent = why.replace(/^message: /, '');
  }

  ask(message) {
    this.source.send(message, (why) => this.say(why));
  }

  end() {
    this.say('The run has ended.');
    for (const control of $('live-panel').querySelectorAll('input, button')) control.disabled = true;
  }

  setTheme({accent}) {
    this.rope.material.color.set(accent);
  }

  // A slider that is being moved is ahead of the run.
  tellState() {
    const {gravity, friction} = this.source.state;
    const along = gravity.reduce((sum, x, k) => sum + x * this.down[k], 0);
    if (document.activeElement !== $('gravity')) $('gravity').value = along;
    if (document.activeElement !== $('friction')) $('friction').value = friction ?? 0.5;
    $('gravity-value').textContent = `${number(along)} m/s²`;
    $('friction-value').textContent = friction === null ? 'as in the scene' : number(friction);
  }

  // At what is at a place of the window, [px]; without one, at the middle of the view. It leaves from the eye, or from behind the walls
  // that the view looks through, at a speed at which it crosses the scene in a third of the time in which something falls through it, and
  // so high that it arrives. It is a ball that the run takes.
  throwBall(place) {
    const {stage, bodies, walls} = this.viewer, box = stage.canvas.getBoundingClientRect();
    const raycaster = stage.ray(...(place ?? [box.left + box.width / 2, box.top + box.height / 2])), {ray} = raycaster;
    const {ball} = this.source.state, radius = within(0.7 * this.bodyRadius, ball.radius), goal = bodies.pick(raycaster)?.distance ?? ray.origin.distanceTo(stage.controls.target);
    const start = walls.behind(ray, goal, radius), speed = 3 * Math.sqrt(EARTH * this.size), seconds = Math.max(goal - start, 0) / speed;
    const velocity = ray.direction.clone().multiplyScalar(speed).addScaledVector(new Vector3(...this.source.state.gravity), -seconds / 2);
    const density = within((BALL_WEIGHT * this.bodyMass) / ((4 / 3) * Math.PI * radius ** 3), ball.density);
    this.ask({do: 'throw', from: ray.at(start, new Vector3()).toArray(), velocity: velocity.toArray(), radius, density});
  }

  #listen() {
    const slide = (id, message) => $(id).addEventListener('input', () => this.ask(message(Number($(id).value))));
    slide('gravity', (value) => ({do: 'gravity', value: this.down.map((x) => x * value)}));
    slide('friction', (value) => ({do: 'friction', value}));
    $('throw').addEventListener('click', () => this.throwBall(null));
    // Before the camera hears of it.
    const stage = $('stage');
    stage.addEventListener('pointerdown', (event) => this.#take(event), {capture: true});
    stage.addEventListener('pointermove', (event) => {
      this.pointer = [event.clientX, event.clientY];
      if (this.held) this.#pull(event);
    });
    stage.addEventListener('pointerup', (event) => this.#letGo(event));
    stage.addEventListener('pointercancel', (event) => this.#letGo(event));
    stage.addEventListener('pointerleave', () => (this.pointer = null));
  }

  #take(event) {
    const {viewer} = this, {stage, bodies, player, shown} = viewer;
    if (event.target !== stage.canvas || event.button !== 0 || event.ctrlKey || event.shiftKey || event.metaKey || !player.following || !shown) return;
    const hit = bodies.pick(stage.ray(event.clientX, event.clientY));
    if (!hit || this.source.head.bodies.kind[hit.body] !== 'dynamic') return;
    event.stopPropagation();
    $('stage').setPointerCapture(event.pointerId);
    const {positions, rotations} = shown.frame;
    const at = hit.point.clone().sub(new Vector3().fromArray(positions, 3 * hit.body))
      .applyQuaternion(new Quaternion().fromArray(rotations, 4 * hit.body).invert());
    const sight = stage.camera.getWorldDirection(new Vector3());
    this.held = {body: hit.body, at, to: hit.point, plane: new Plane().setFromNormalAndCoplanarPoint(sight, hit.point), from: [event.clientX, event.clientY], moved: false};
  }

  // To where the pointer is, as far from the eye as the body was.
  #pull(event) {
    const {held} = this;
    held.moved ||= Math.hypot(event.clientX - held.from[0], event.clientY - held.from[1]) > CLICK;
    const to = this.viewer.stage.ray(event.clientX, event.clientY).ray.intersectPlane(held.plane, new Vector3());
    if (!held.moved || !to) return;
    held.to = to;
    this.ask({do: 'drag', body: held.body, at: held.at.toArray(), to: to.toArray()});
    this.drawRope();
  }

  #letGo(event) {
    const {held} = this;
    if (!held) return;
    this.held = null;
    if (held.moved) this.ask({do: 'release'});
    else if (event.type === 'pointerup') this.viewer.pick(held.body);
    this.drawRope();
  }

  // From the point that is held to where it is to go.
  drawRope() {
    const {held, viewer} = this;
    this.rope.visible = Boolean(held?.moved && viewer.shown);
    if (this.rope.visible) {
      const {positions, rotations} = viewer.shown.frame, place = this.rope.geometry.attributes.position;
      const end = held.at.clone().applyQuaternion(new Quaternion().fromArray(rotations, 4 * held.body)).add(new Vector3().fromArray(positions, 3 * held.body));
      place.setXYZ(0, ...end.toArray());
      place.setXYZ(1, ...held.to.toArray());
      place.needsUpdate = true;
    }
    viewer.dirty = true;
  }
}
