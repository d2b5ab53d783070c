// The page: puts source, film, stage, curves and controls together.
import {Group, Vector3} from 'three';
import {Bodies} from './bodies.js';
import {colourModes} from './colours.js';
import {makeCurves} from './curves.js';
import {extentOf} from './extent.js';
import {Film} from './film.js';
import {count, make, metres, number} from './format.js';
import {bodyTable} from './picked.js';
import {LiveControls} from './live_controls.js';
import {LivePlayer} from './live_player.js';
import {Marks} from './marks.js';
import {Player} from './player.js';
import {reportTable, worstFrame, worstIsland} from './report.js';
import {radiusOf} from './shapes.js';
import {openSource} from './source.js';
import {Stage} from './stage.js';
import {onTheme, theme} from './theme.js';
import {isWall, MOST_WALLS, Walls} from './walls.js';

const $ = (id) => document.getElementById(id);

const CURVES_EVERY = 250;  // [ms] while a run goes on
const TIME_EVERY = 200;  // [ms] while what plays is drawn plainly
const STILL_AFTER = 300;  // [ms] since the last change of a picture

function median(values) {
  const sorted = values.filter(Number.isFinite).sort((a, b) => a - b);
  return sorted.length ? sorted[sorted.length >> 1] : 1;
}

class Viewer {
  async open() {
    this.film = new Film(await openSource());
    const {film} = this, {head} = film, {bodies} = head;
    const all = bodies.kind.map((_, i) => i), dynamic = all.filter((i) => bodies.kind[i] === 'dynamic');
    this.bodyRadius = median((dynamic.length ? dynamic : all).map((i) => radiusOf(head.shapes[bodies.shape[i]])));
    this.dirty = true;
    this.picked = -1;
    this.shown = null;

    // Half-spaces first: what is no wall any more is drawn solid, and they cannot be.
    const endless = (i) => head.shapes[bodies.shape[i]].kind === 'half-space';
    const walls = all.filter((i) => isWall(head, i, this.bodyRadius)).sort((a, b) => endless(b) - endless(a)).slice(0, MOST_WALLS);
    this.isWall = new Set(walls);
    const extent = await this.extent(), size = extent.all.getSize(new Vector3()).length();
    const start = await film.frame(0, false);
    this.walls = new Walls(head, walls, start, extent.first.getCenter(new Vector3()), size);
    const bodyMass = median(dynamic.map((i) => bodies.mass[i]));
    this.marks = new Marks(this.bodyRadius, bodyMass * (Math.hypot(...head.gravity) || 9.81), head.dt);
    this.stage = new Stage($('view'), () => (this.dirty = true));
    this.solid = new Group();
    this.stage.scene.add(new Group().add(this.walls.group, this.solid, this.marks.group));
    this.makeBodies();
    this.mode = this.modes[0];
    this.timeTold = this.moved = 0;  // [ms] when
    this.curves = makeCurves(film, (frame) => this.player.seek(frame));
    if (film.source.live) this.goLive({bodyRadius: this.bodyRadius, bodyMass, size});
    else this.player = new Player(film.frames, head.dt, (frame) => this.show(frame), () => this.tellState());

    this.fillPage();
    this.listen();
    this.applyTheme();
    this.stage.resize();
    this.stage.setExtent(extent.all);
    this.resize();
    this.setMode('body');
    this.setToggle('plain', this.stage.slow);
    this.tellState();
    if (head.start === 'worst') await this.openWorst();
    else this.player.go(this.live ? Infinity : 0);
    requestAnimationFrame((now) => this.tick(now, now));
  }

  // Numbers of the bodies that are drawn as such.
  solidOnes() {
    return this.film.head.bodies.kind.map((_, i) => i).filter((i) => !this.isWall.has(i));
  }

  extent() {
    return extentOf(this.film, this.bodyRadius, this.solidOnes());
  }

  // Of a run that goes on it is to see where the bodies have got to.
  resetCamera() {
    if (this.live) this.extent().then(({all}) => this.stage.setExtent(all), fail);
    else this.stage.resetCamera();
  }

  makeBodies() {
    const {head} = this.film;
    this.bodies?.dispose();
    this.bodies = new Bodies(head, this.solidOnes());
    this.solid.clear();
    this.solid.add(this.bodies.group);
    this.modes = colourModes(head);
  }

  goLive(typical) {
    const {source} = this.film;
    this.live = new LiveControls(this, typical);
    this.stage.scene.add(this.live.rope);
    this.player = new LivePlayer(source, (frame) => this.show(frame), () => this.tellState(), (why) => this.live.say(why));
    this.curvesDrawn = 0;  // [ms] when
    source.onHead = () => {
      this.makeBodies();
      this.bodies.setSolid($('show-bodies').checked);
      if (this.shown) this.bodies.setFrame(this.shown.frame);
      this.setMode(this.mode.id);
      this.tellSummary();
    };
    source.onState = () => {
      this.live.tellState();
      this.tellState();
      if ($('again').hidden !== source.state.changed) this.fillReport();
    };
    source.onThin = (to) => {
      this.player.thinned(to);
      if (this.shown) this.shown.i = to(this.shown.i);
    };
    source.onFrame = () => (this.grown = true);
    source.onLost = () => this.live.say('The run does not answer; it may come back.');
    source.onFound = () => this.live.say('');
    source.onEnd = () => {
      this.live.end();
      this.tellState();
    };
  }

  // What tells of all frames, when there are more.
  tellGrowth(now) {
    if (!this.grown || now - this.curvesDrawn < CURVES_EVERY) return;
    this.grown = false;
    this.curvesDrawn = now;
    $('scrub').max = this.film.frames - 1;
    $('scrub').value = this.player.frame;
    for (const curve of this.curves) curve.draw();
    if (this.shown) this.tellTime(this.shown.i);
    if (!$('report').hidden) this.fillReport();
  }

  get wantsContacts() {
    return this.marks.wanted || this.mode.contacts || this.picked >= 0;
  }

  // Draws frame i, now if it is decoded, else as soon as it is.
  show(i) {
    const frame = this.film.ready(i, this.wantsContacts);
    if (!frame) {
      this.film.frame(i, this.wantsContacts).then(() => this.player.wants(i) && this.show(i), fail);
      return false;
    }
    const began = performance.now();
    this.shown = {frame, i};
    this.bodies.setFrame(frame);
    this.walls.setFrame(frame);
    this.refresh();
    this.stage.shadowsChanged();
    this.live?.drawRope();
    this.tellTime(i);
    const soon = i + Math.max(24, 3 * (this.player.stride ?? 0));
    if (soon < this.film.frames && this.player.playing) this.film.ready(soon, this.wantsContacts);
    this.scriptTime = performance.now() - began;
    return true;
  }

  tellTime(i) {
    // These texts and lines cost a browser without a GPU several ms each time.
    const now = performance.now();
    if (this.plain && this.player.playing && now - this.timeTold < TIME_EVERY) return;
    this.timeTold = now;
    const time = this.film.number('time', i);
    const {dt} = this.film.head;
    $('clock-time').textContent = `${time.toFixed(dt < 1e-3 ? Math.ceil(-Math.log10(dt)) : 2)} s`;
    $('clock-frame').textContent = `frame ${this.film.number('number', i)} of ${this.film.number('number', this.film.frames - 1)}`;
    $('scrub').value = i;
    $('scrub').setAttribute('aria-valuetext', $('clock-time').textContent);
    for (const curve of this.curves) curve.setFrame(i);
  }

  // What depends on the frame and on what is wanted of it.
  refresh() {
    if (!this.shown) return;
    const {frame, i} = this.shown;
    if (this.wantsContacts && !frame.contacts) {
      this.film.frame(i, true).then(() => this.shown.i === i && this.refresh(), fail);
      return;
    }
    const colours = theme();
    this.bodies.paint(this.mode, frame);
    this.bodies.setPicked(this.picked, frame, colours.accent);
    this.marks.setFrame(this.marks.wanted ? frame.contacts : null, this.picked, colours);
    this.tellPicked(frame, i);
    const {contacts} = frame;
    $('contact-note').textContent = !this.marks.wanted || !contacts ? '' :
      contacts.count < contacts.all ? `${count(contacts.count)} of ${count(contacts.all)} contacts are kept, those that press most.` :
      this.marks.show.forces ? `${count(contacts.count)} contacts. An arrow's length grows with the logarithm of its force.` : `${count(contacts.count)} contacts.`;
    this.dirty = true;
  }

  tellPicked(frame, i) {
    if (this.picked < 0) return;
    if (this.picked >= frame.frozen.length) {
      $('picked-body').replaceChildren(make('p', {class: 'note'}, `Body ${this.picked} is not there yet.`));
      return;
    }
    let before = i > 0 ? this.film.ready(i - 1, false) : null;
    if (i > 0 && !before) this.film.frame(i - 1, false).then(() => this.shown.i === i && this.tellPicked(frame, i), fail);
    if (before && this.picked >= before.frozen.length) before = null;
    const seconds = before && this.film.number('time', i) - this.film.number('time', i - 1);
    $('picked-body').replaceChildren(bodyTable(this.film, frame, before, seconds, this.picked, (body) => this.pick(body)));
  }

  pick(body) {
    this.picked = body;
    if (body < 0) $('picked-body').replaceChildren(make('p', {class: 'note'}, 'Click a body to see its numbers.'));
    this.refresh();
  }

  setMode(id) {
    this.mode = this.modes.find((mode) => mode.id === id);
    $(`colour-${id}`).checked = true;
    const {gradient, ticks, unit, items = []} = this.mode.legend;
    $('legend').replaceChildren(
      ...items.map(([colour, name]) => make('span', {}, ...(colour ? [make('i', {style: `background:${colour}`})] : []), name)),
      ...(gradient ? [make('span', {}, unit), make('div', {class: 'bar', style: `background:linear-gradient(90deg,${gradient.join(',')})`}),
        make('div', {class: 'ticks'}, ...ticks.map(([at, name]) => make('span', {style: `left:${100 * at}%`}, name)))] : []));
    this.refresh();
  }

  setToggle(name, on) {
    $(`show-${name}`).checked = on;
    if (name === 'bodies') this.bodies.setSolid(on);
    else if (name === 'plain') this.plain = on;
    else this.marks.show[name] = on;
    this.refresh();
  }

  tellSummary() {
    const {film} = this, {head} = film;
    const dynamic = head.bodies.kind.filter((kind) => kind === 'dynamic').length, step = `steps of ${number(1e3 * head.dt)} ms`;
    const parts = [`${count(dynamic)} ${dynamic === 1 ? 'body' : 'bodies'}`, this.live ? `live, in ${step}` : `${number(film.number('time', film.frames - 1), 4)} s in ${step}`];
    if (head.stopped_by) parts.push(`stopped by: ${head.stopped_by}`);
    $('summary').textContent = parts.join(' · ');
  }

  fillPage() {
    const {film} = this, {head} = film;
    // The scene's own title; without one the name, or that of its file.
    const title = head.title || head.scene.replace(/^.*\//, ''), path = title === head.scene ? '' : head.scene;
    document.title = `${title} – islet`;
    $('scene').textContent = title;
    $('scene').title = $('path').textContent = path;
    $('about').textContent = head.about;
    $('about-scene').hidden = !head.about && !path;
    this.tellSummary();
    $('command').textContent = head.command;
    $('scrub').max = film.frames - 1;
    $('colours').replaceChildren(...this.modes.map((mode, k) => make('label', {},
      make('input', {type: 'radio', name: 'colour', id: `colour-${mode.id}`, onchange: () => this.setMode(mode.id)}), mode.name, make('kbd', {}, String(k + 1)))));
    $('curves').replaceChildren(...this.curves.map((curve) => curve.element));
    this.fillReport();
    const {errors, contacts, steps} = head;
    $('data-note').textContent = this.live ? `Positions are in steps of ${metres(steps.position)} and rotations in steps of ${number(steps.rotation)}. The page keeps all of the run, also when it is loaded anew: ` +
      'beyond 20,000 frames or 128 MB every second one of the older half is forgotten.' : `Positions are within ${metres(errors.position)} and rotations within ${number(errors.rotation)} rad of the run. ` +
      (contacts.frames_cut ? `Of ${count(contacts.all)} contacts ${count(contacts.kept)} are kept, in each frame those that press most. ` : `All ${count(contacts.all)} contacts are kept. `) +
      'The curves are exact.';
  }

  fillReport() {
    const {film} = this, worst = worstFrame(film);
    // A run that somebody changed is none that a command makes again.
    const changed = Boolean(film.source.state?.changed);
    $('again').hidden = changed;
    $('not-again').hidden = !changed;
    $('report-table').replaceChildren(reportTable(film, (frame) => this.player.seek(frame)));
    $('report-worst').replaceChildren(make('button', {class: 'link', onclick: () => this.openWorst()}, `Frame ${film.number('number', worst.frame)}`), `: ${worst.why}.`);
  }

  setReport(open) {
    $('report').hidden = !open;
    $('report-button').setAttribute('aria-expanded', String(open));
    if (open && this.live) this.fillReport();
  }

  // Report, worst frame, worst island: its bodies, and of them the one with the most pressing contact picked.
  async openWorst() {
    const worst = worstFrame(this.film);
    this.setReport(true);
    const frame = await this.film.frame(worst.frame, true);
    this.setMode('accuracy');
    const island = worstIsland(frame);
    if (island) {
      const most = island.bodies.reduce((a, b) => (frame.contacts.press[b] > frame.contacts.press[a] ? b : a));
      $('report-worst').append(make('p', {class: 'note'}, `Its worst island, ${island.island}, has ${count(island.bodies.length)} ${island.bodies.length === 1 ? 'body' : 'bodies'}` +
        ` and ends at ${number(island.accuracy)} of v_ref. Body ${most} is pressed most.`));
      this.picked = most;
    }
    for (const old of [...$('report-worst').querySelectorAll('p')].slice(0, -1)) old.remove();
    this.player.seek(worst.frame);
  }

  tellState() {
    $('play').classList.toggle('playing', this.player.playing);
    $('play').setAttribute('aria-label', this.player.playing ? 'Pause' : 'Play');
    $('speed').value = String(this.player.speed);
    if (this.shown) this.tellTime(this.shown.i);
  }

  listen() {
    const {player} = this;
    const click = (id, action) => $(id).addEventListener('click', action);
    click('play', () => player.toggle());
    click('first', () => player.step(-Infinity));
    click('last', () => player.step(Infinity));
    click('back', () => player.step(-1));
    click('forward', () => player.step(1));
    click('camera', () => this.resetCamera());
    click('report-button', () => this.setReport($('report').hidden));
    $('scrub').addEventListener('input', () => player.seek(Number($('scrub').value)));
    $('speed').addEventListener('change', () => {
      player.setSpeed(Number($('speed').value));
      if (byMouse) $('speed').blur();
    });
    for (const name of ['points', 'normals', 'forces', 'bodies', 'plain']) $(`show-${name}`).addEventListener('change', (event) => this.setToggle(name, event.target.checked));

    const view = $('view');
    let down = null, byMouse = false;
    window.addEventListener('pointerdown', () => (byMouse = true), true);
    window.addEventListener('keydown', () => (byMouse = false), true);
    view.addEventListener('pointerdown', (event) => (down = [event.clientX, event.clientY]));
    view.addEventListener('pointerup', (event) => {
      if (!down || Math.hypot(event.clientX - down[0], event.clientY - down[1]) > 4 || event.button !== 0) return;
      this.pick(this.bodies.pick(this.stage.ray(event.clientX, event.clientY))?.body ?? -1);
    });
    // What was clicked by mouse does not keep the keys.
    document.addEventListener('click', (event) => event.detail > 0 && event.target.closest?.('button, input, summary')?.blur());
    window.addEventListener('keydown', (event) => this.key(event));
    new ResizeObserver(() => this.resize()).observe($('stage'));
    for (const curve of this.curves) new ResizeObserver(() => this.redraw(curve)).observe(curve.box);
    onTheme(() => this.applyTheme());
  }

  key(event) {
    const {target} = event, own = event.key === ' ' ? 'button, summary, input:not([type="range"])' : event.key.startsWith('Arrow') ? 'input[type="radio"]' : null;
    if (event.ctrlKey || event.metaKey || event.altKey || target.matches('select') || (own && target.matches(own))) return;
    const {player} = this;
    const speeds = [...$('speed').options].map((option) => Number(option.value)), at = speeds.indexOf(player.speed);
    const toggle = (name) => () => this.setToggle(name, !$(`show-${name}`).checked);
    const actions = {
      ' ': () => player.toggle(), ArrowLeft: () => player.step(event.shiftKey ? -10 : -1), ArrowRight: () => player.step(event.shiftKey ? 10 : 1),
      Home: () => player.step(-Infinity), End: () => player.step(Infinity), c: () => this.resetCamera(), r: () => this.setReport($('report').hidden),
      p: toggle('points'), n: toggle('normals'), f: toggle('forces'), b: toggle('bodies'), m: toggle('plain'), Escape: () => this.pick(-1),
    };
    if (this.live) {
      actions.t = () => this.live.throwBall(this.live.pointer);
    } else {
      actions['-'] = () => player.setSpeed(speeds[Math.max(at - 1, 0)]);
      actions['+'] = () => player.setSpeed(speeds[Math.min(at + 1, speeds.length - 1)]);
    }
    this.modes.forEach((mode, k) => (actions[k + 1] = () => this.setMode(mode.id)));
    const action = actions[event.key === '=' ? '+' : event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    event.preventDefault();
    action();
  }

  resize() {
    this.stage.resize();
    for (const curve of this.curves) this.redraw(curve);
  }

  redraw(curve) {
    curve.draw();
    if (this.shown) curve.setFrame(this.shown.i);
  }

  applyTheme() {
    const colours = theme();
    this.stage.setTheme(colours);
    this.walls.setTheme(colours);
    this.live?.setTheme(colours);
    for (const curve of this.curves) curve.draw();
    this.refresh();
    this.dirty = true;
  }

  // still: what is to be seen does not move.
  draw(still) {
    const plain = this.plain && !still;
    this.dirty = false;
    this.still = still;
    for (const part of [this.bodies, this.walls, this.stage]) part.prepare(plain, still);
    this.stage.render();
  }

  tick(now, before) {
    this.player.advance(Math.min((now - before) / 1e3, 0.5));
    if (this.live) this.tellGrowth(now);
    if (this.dirty) {
      this.draw(false);
      this.moved = performance.now();
    } else if (!this.still && !this.player.playing && now - this.moved > STILL_AFTER) {
      this.draw(true);
    }
    requestAnimationFrame((next) => this.tick(next, now));
  }
}

function fail(error) {
  $('message').classList.add('error');
  $('message').textContent = `This page cannot be shown: ${error.message}`;
  console.error(error);
}

const viewer = new Viewer();
window.islet = viewer;
viewer.open().then(() => ($('message').textContent = ''), fail);
