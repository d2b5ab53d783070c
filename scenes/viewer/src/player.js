// Which frame is shown, and when the next one is.

export class Player {
  // show(frame): true once it is shown, false while it is not decoded. onState(): playing or speed changed.
  constructor(frames, dt, show, onState) {
    Object.assign(this, {frames, dt, show, onState});
    this.frame = 0;
    this.playing = false;
    this.speed = 1;
    this.ahead = 0;  // [s] of the film, since the frame that is shown
  }

  // seconds: of wall time since the last call.
  advance(seconds) {
    if (!this.playing) return;
    this.ahead = Math.min(this.ahead + seconds * this.speed, 0.25 * this.speed + this.dt);
    const steps = Math.floor(this.ahead / this.dt + 1e-6);
    if (steps === 0) return;
    const next = Math.min(this.frame + steps, this.frames - 1);
    if (!this.show(next)) return;
    this.ahead -= steps * this.dt;
    this.frame = next;
    if (next === this.frames - 1) this.pause();
  }

  // Whether frame i is to be shown once it is decoded.
  wants(frame) {
    return !this.playing && frame === this.frame;
  }

  play() {
    if (this.frame === this.frames - 1) this.go(0);
    this.playing = this.frames > 1;
    this.ahead = 0;
    this.onState();
  }

  pause() {
    this.playing = false;
    this.onState();
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  go(frame) {
    this.frame = Math.min(Math.max(Math.round(frame), 0), this.frames - 1);
    this.ahead = 0;
    this.show(this.frame);
  }

  step(frames) {
    if (this.playing) this.pause();
    this.go(this.frame + frames);
  }

  setSpeed(speed) {
    this.speed = speed;
    this.onState();
  }
}
