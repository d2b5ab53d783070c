// Which frame is shown, and when the next one is.

export class Player {
  // show(frame): true once it is shown, false while it is not decoded. onState(): playing or speed changed.
  constructor(frames, dt, show, onState) {
    Object.assign(this, {frames, dt, show, onState});
    this.frame = 0;
    this.playing = false;
    this.speed = 1;
    this.ahead = 0;   // [s] of the film, since the frame that is shown
    this.next = -1;   // that is to be shown, -1: none yet
    this.stride = 1;  // frames to the one that was shown before
  }

  // seconds: of wall time since the last call. A frame that is being decoded stays the next: where each tick asks for another one, none would
  // ever be shown.
  advance(seconds) {
    if (!this.playing) return;
    this.ahead = Math.min(this.ahead + seconds * this.speed, 0.25 * this.speed + this.dt);
    const steps = Math.floor(this.ahead / this.dt + 1e-6);
    if (this.next < 0 && steps === 0) return;
    if (this.next < 0) this.next = Math.min(this.frame + steps, this.frames - 1);
    this.stride = this.next - this.frame;
    if (!this.show(this.next)) return;
    this.ahead = Math.max(0, this.ahead - this.stride * this.dt);
    this.frame = this.next;
    this.next = -1;
    if (this.frame === this.frames - 1) this.pause();
  }

  // Whether frame i is to be shown once it is decoded.
  wants(frame) {
    return !this.playing && frame === this.frame;
  }

  play() {
    if (this.frame === this.frames - 1) this.go(0);
    this.playing = this.frames > 1;
    this.ahead = 0;
    this.next = -1;
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
    this.next = -1;
    this.show(this.frame);
  }

  step(frames) {
    if (this.playing) this.pause();
    this.go(this.frame + frames);
  }

  // As a slider or a link does.
  seek(frame) {
    this.step(frame - this.frame);
  }

  setSpeed(speed) {
    this.speed = speed;
    this.onState();
  }
}
