// As Player, of a run that goes on. At the newest frame it follows, and there it is the run that plays, pauses and makes a step; the
// frames before are looked at while it goes on.

export class LivePlayer {
  // source: a LiveSource; tell(why): '' or what the run refused. The others as of Player.
  constructor(source, show, onState, tell) {
    Object.assign(this, {source, show, onState, tell});
    this.frame = 0;
    this.following = true;
    this.speed = 1;
    this.next = -1;   // that is to be shown, -1: the newest
    this.shown = -1;  // key of that which is
  }

  get newest() {
    return this.source.frames - 1;
  }

  get playing() {
    return this.following && this.source.state.running;
  }

  wants(frame) {
    return !this.following && frame === this.frame;
  }

  // A frame that is being decoded stays the next: of a run that is faster than that, none would ever be shown.
  advance() {
    if (!this.following) return;
    if (this.next < 0) this.next = this.newest;
    const [key] = this.source.place(this.next);
    if (key !== this.shown && !this.show(this.next)) return;
    this.shown = key;
    this.frame = this.next;
    this.next = -1;
  }

  ask(what) {
    this.source.send({do: what}, this.tell);
  }

  toggle() {
    if (this.playing) return this.ask('pause');
    if (!this.source.state.running) this.ask('run');
    this.go(this.newest);
  }

  go(frame) {
    this.frame = Math.min(Math.max(Math.round(frame), 0), this.newest);
    this.following = this.frame === this.newest;
    this.next = this.shown = -1;
    if (!this.following) this.show(this.frame);
    this.onState();
  }

  step(frames) {
    if (this.following && frames === 1) this.ask('step');
    else this.go(this.frame + frames);
  }

  // As a slider or a link does: it asks nothing of the run, also where that is one frame ahead.
  seek(frame) {
    this.go(frame);
  }

  // Frames were forgotten: to(i) is where frame i is now.
  thinned(to) {
    this.frame = to(this.frame);
    if (this.next >= 0) this.next = to(this.next);
  }
}
