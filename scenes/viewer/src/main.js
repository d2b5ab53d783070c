// The page: puts source, film, stage, curves and controls together.
import {Group, Vector3} from 'three';
import {Bodies} from './bodies.js';
import {colourModes} from './colours.js';
import {makeCurves} from './curves.js';
import {extentOf} from './extent.js';
import {Film} from './film.js';
import {count, make, metres, number} from './format.js';
import {bodyTable} from './picked.js';
import {Marks} from './marks.js';
import {Player} from './player.js';
import {reportTable, worstFrame, worstIsland} from './report.js';
import {radiusOf} from './shapes.js';
import {openPage} from './source.js';
import {Stage} from './stage.js';
import {onTheme, theme} from './theme.js';
import {isWall, Walls} from './walls.js';

const $ = (id) => document.getElementById(id);

function median(values) {
  const sorted = values.filter(Number.isFinite).sort((a, b) => a - b);
  return sorted.length ? sorted[sorted.length >> 1] : 1;
}

class Viewer {
  async open() {
    this.film = new Film(await openPage());
    const {film} = this, {head} = film, {bodies} = head;
    const all = bodies.kind.map((_, i) => i), dynamic = all.filter((i) => bodies.kind[i] === 'dynamic');
    this.bodyRadius = median((dynamic.length ? dynamic : all).map((i) => radiusOf(head.shapes[bodies.shape[i]])));
    this.dirty = true;
    this.picked = -1;
    this.shown = null;

    const walls = all.filter((i) => isWall(head, i, this.bodyRadius)), isWalls = new Set(walls), solid = all.filter((i) => !isWalls.has(i));
    const extent = await extentOf(film, this.bodyRadius, solid), size = extent.all.getSize(new Vector3()).length();
    const start = await film.frame(0, false);
    this.bodies = new Bodies(head, solid);
    this.walls = new Walls(head, walls, start, extent.first.getCenter(new Vector3()), size);
    const weight = median(dynamic.map((i) => bodies.mass[i])) * (Math.hypot(...head.gravity) || 9.81);
    this.marks = new Marks(this.bodyRadius, weight, head.dt);
    this.stage = new Stage($('view'), () => (this.dirty = true));
    this.stage.scene.add(new Group().add(this.walls.group, this.bodies.group, this.marks.group));
    this.modes = colourModes(head);
    this.mode = this.modes[0];
    this.curves = makeCurves(film, (frame) => this.player.step(frame - this.player.frame));
    this.player = new Player(film.frames, head.dt, (frame) => this.show(frame), () => this.tellState());

    this.fillPage();
    this.listen();
    this.applyTheme();
    this.stage.resize();
    this.stage.setExtent(extent.all);
    this.resize();
    this.setMode('body');
    this.tellState();
    if (head.start === 'worst') await this.openWorst();
    else this.player.go(0);
    requestAnimationFrame((now) => this.tick(now, now));
  }

  get wantsContacts() {
    return this.marks.wanted || this.mode.contacts || this.picked >= 0;
  }

  // Draws frame i, now if it is decoded, else as soon as it is.
  show(i) {
    const frame = this.film.ready(i, this.wantsContacts);
    if (!frame) {
      this.film.frame(i, this.wantsContacts).then(() => !this.player.playing && this.player.frame === i && this.show(i), fail);
      return false;
    }
    const began = performance.now();
    this.shown = {frame, i};
    this.bodies.setFrame(frame);
    this.walls.setFrame(frame);
    this.refresh();
    this.stage.shadowsChanged();
    const time = this.film.number('time', i);
    $('clock-time').textContent = `${time.toFixed(2)} s`;
    $('clock-frame').textContent = `frame ${this.film.number('number', i)} of ${this.film.number('number', this.film.frames - 1)}`;
    $('scrub').value = i;
    $('scrub').setAttribute('aria-valuetext', $('clock-time').textContent);
    for (const curve of this.curves) curve.setFrame(i);
    if (i + 24 < this.film.frames && this.player.playing) this.film.ready(i + 24, this.wantsContacts);
    this.scriptTime = performance.now() - began;
    return true;
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
    const before = i > 0 ? this.film.ready(i - 1, false) : null;
    if (i > 0 && !before) this.film.frame(i - 1, false).then(() => this.shown.i === i && this.tellPicked(frame, i), fail);
    $('picked-body').replaceChildren(bodyTable(this.film, frame, before, this.picked, (body) => this.pick(body)));
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
    else this.marks.show[name] = on;
    this.refresh();
  }

  fillPage() {
    const {film} = this, {head} = film, last = film.frames - 1;
    const dynamic = head.bodies.kind.filter((kind) => kind === 'dynamic').length;
    document.title = `${head.scene} – islet`;
    $('scene').textContent = head.scene;
    const parts = [`${count(dynamic)} ${dynamic === 1 ? 'body' : 'bodies'}`, `${number(film.number('time', last), 4)} s in steps of ${number(1e3 * head.dt)} ms`];
    if (head.stopped_by) parts.push(`stopped by: ${head.stopped_by}`);
    $('summary').textContent = parts.join(' · ');
    $('command').textContent = head.command;
    $('scrub').max = last;
    $('colours').replaceChildren(...this.modes.map((mode, k) => make('label', {},
      make('input', {type: 'radio', name: 'colour', id: `colour-${mode.id}`, onchange: () => this.setMode(mode.id)}), mode.name, make('kbd', {}, String(k + 1)))));
    $('curves').replaceChildren(...this.curves.map((curve) => curve.element));
    $('report-table').replaceChildren(reportTable(film, (frame) => this.player.step(frame - this.player.frame)));
    const {errors, contacts} = head;
    $('data-note').textContent = `Positions are within ${metres(errors.position)} and rotations within ${number(errors.rotation)} rad of the run. ` +
      (contacts.frames_cut ? `Of ${count(contacts.all)} contacts ${count(contacts.kept)} are kept, in each frame those that press most. ` : `All ${count(contacts.all)} contacts are kept. `) +
      'The curves are exact.';
    const worst = worstFrame(film);
    $('report-worst').replaceChildren(make('button', {class: 'link', onclick: () => this.openWorst()}, `Frame ${film.number('number', worst.frame)}`), `: ${worst.why}.`);
  }

  setReport(open) {
    $('report').hidden = !open;
    $('report-button').setAttribute('aria-expanded', String(open));
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
    this.player.step(worst.frame - this.player.frame);
  }

  tellState() {
    $('play').classList.toggle('playing', this.player.playing);
    $('play').setAttribute('aria-label', this.player.playing ? 'Pause' : 'Play');
    $('speed').value = String(this.player.speed);
  }

  listen() {
    const {player} = this, last = this.film.frames - 1;
    const click = (id, action) => $(id).addEventListener('click', action);
    click('play', () => player.toggle());
    click('first', () => player.step(-last));
    click('last', () => player.step(last));
    click('back', () => player.step(-1));
    click('forward', () => player.step(1));
    click('camera', () => this.stage.resetCamera());
    click('report-button', () => this.setReport($('report').hidden));
    $('scrub').addEventListener('input', () => player.step(Number($('scrub').value) - player.frame));
    $('speed').addEventListener('change', () => player.setSpeed(Number($('speed').value)));
    for (const name of ['points', 'normals', 'forces', 'bodies']) $(`show-${name}`).addEventListener('change', (event) => this.setToggle(name, event.target.checked));

    const view = $('view');
    let down = null;
    view.addEventListener('pointerdown', (event) => (down = [event.clientX, event.clientY]));
    view.addEventListener('pointerup', (event) => {
      if (!down || Math.hypot(event.clientX - down[0], event.clientY - down[1]) > 4 || event.button !== 0) return;
      this.pick(this.bodies.pick(this.stage.ray(event.clientX, event.clientY))?.body ?? -1);
    });
    // What was clicked by mouse does not keep the keys.
    document.addEventListener('click', (event) => event.detail > 0 && event.target.closest?.('button, input')?.blur());
    window.addEventListener('keydown', (event) => this.key(event));
    new ResizeObserver(() => this.resize()).observe($('stage'));
    new ResizeObserver(() => this.resize()).observe($('curves'));
    onTheme(() => this.applyTheme());
  }

  key(event) {
    const {target} = event, own = event.key === ' ' ? 'button, summary, input:not([type="range"])' : event.key.startsWith('Arrow') ? 'input[type="radio"]' : null;
    if (event.ctrlKey || event.metaKey || event.altKey || target.matches('select') || (own && target.matches(own))) return;
    const {player} = this, last = this.film.frames - 1;
    const speeds = [...$('speed').options].map((option) => Number(option.value)), at = speeds.indexOf(player.speed);
    const toggle = (name) => () => this.setToggle(name, !$(`show-${name}`).checked);
    const actions = {
      ' ': () => player.toggle(), ArrowLeft: () => player.step(event.shiftKey ? -10 : -1), ArrowRight: () => player.step(event.shiftKey ? 10 : 1),
      Home: () => player.step(-last), End: () => player.step(last), '-': () => player.setSpeed(speeds[Math.max(at - 1, 0)]),
      '+': () => player.setSpeed(speeds[Math.min(at + 1, speeds.length - 1)]), c: () => this.stage.resetCamera(), r: () => this.setReport($('report').hidden),
      p: toggle('points'), n: toggle('normals'), f: toggle('forces'), b: toggle('bodies'), Escape: () => this.pick(-1),
    };
    this.modes.forEach((mode, k) => (actions[k + 1] = () => this.setMode(mode.id)));
    const action = actions[event.key === '=' ? '+' : event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    event.preventDefault();
    action();
  }

  resize() {
    this.stage.resize();
    for (const curve of this.curves) {
      curve.draw();
      if (this.shown) curve.setFrame(this.shown.i);
    }
  }

  applyTheme() {
    const colours = theme();
    this.stage.setTheme(colours);
    this.walls.setTheme(colours);
    for (const curve of this.curves) curve.draw();
    this.refresh();
    this.dirty = true;
  }

  tick(now, before) {
    this.player.advance(Math.min((now - before) / 1e3, 0.5));
    if (this.dirty) {
      this.dirty = false;
      this.stage.render();
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
