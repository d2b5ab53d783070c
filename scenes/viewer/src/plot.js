// One chart over time on a canvas: lines or stacked areas, a linear or logarithmic axis, marks, a cursor. Dragging in it scrubs.
import {linearTicks, powerName, powerTicks, tickName} from './axis.js';
import {make} from './format.js';

const LEFT = 46, RIGHT = 8, TOP = 6, BOTTOM = 20;

export class Plot {
  // definition: {title, unit, series: [{name, of, colour, format}], stacked, log, aim, marks}, of and marks functions of a frame;
  // onScrub(frame). What is added to the film is drawn by the next draw().
  constructor(definition, film, onScrub) {
    this.definition = definition;
    this.film = film;
    this.end = 1;
    this.canvas = make('canvas');
    this.cursor = make('i', {class: 'cursor'});
    this.readouts = definition.series.map((s) => make('b'));
    const key = definition.series.map((s, k) => make('span', {class: 'key'}, make('i', {style: `background:var(--${s.colour})`}), s.name, ' ', this.readouts[k]));
    this.box = make('div', {class: 'plot-box'}, this.canvas, this.cursor);
    this.element = make('figure', {class: 'plot', 'data-plot': definition.id},
      make('figcaption', {}, make('strong', {}, definition.title), make('span', {class: 'unit'}, definition.unit), ...key), this.box);
    const scrub = (event) => {
      const x = event.clientX - this.canvas.getBoundingClientRect().left;
      onScrub(this.frameAt(x));
    };
    this.canvas.addEventListener('pointerdown', (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      scrub(event);
    });
    this.canvas.addEventListener('pointermove', (event) => {
      if (event.buttons & 1) scrub(event);
    });
  }

  time(frame) {
    return this.film.number('time', frame);
  }

  x(time) {
    return LEFT + (time / this.end) * (this.width - LEFT - RIGHT);
  }

  frameAt(x) {
    const time = ((x - LEFT) / (this.width - LEFT - RIGHT)) * this.end;
    let low = 0, high = this.film.frames - 1;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.time(middle) < time) low = middle + 1;
      else high = middle;
    }
    return low > 0 && time - this.time(low - 1) < this.time(low) - time ? low - 1 : low;
  }

  setFrame(frame) {
    this.cursor.style.transform = `translateX(${this.x(Math.min(this.time(frame), this.end))}px)`;
    this.definition.series.forEach((s, k) => (this.readouts[k].textContent = s.format(s.of(frame))));
  }

  // Of the vertical axis; of a logarithmic one in powers of ten.
  #range() {
    const {series, stacked, log, aim} = this.definition;
    let low = Infinity, high = -Infinity;
    for (let i = 0; i < this.film.frames; ++i) {
      let sum = 0;
      for (const {of} of series) {
        const plain = of(i), value = log ? (plain > 0 ? Math.log10(plain) : NaN) : stacked ? (sum += plain) : plain;
        if (value < low) low = value;
        if (value > high) high = value;
      }
    }
    if (log) {
      if (aim) low = Math.min(low, Math.log10(aim) - 1), high = Math.max(high, Math.log10(aim) + 1);
      if (!(high >= low)) [low, high] = [-12, 0];
      low = Math.max(low, high - 18);
      return [Math.floor(low), Math.max(Math.ceil(high), Math.floor(low) + 1)];
    }
    low = Math.min(low, 0), high = Math.max(high, 0);
    if (!(high > low)) high = low + 1;
    return [low < 0 ? low - 0.05 * (high - low) : 0, high + 0.06 * (high - low)];
  }

  draw() {
    this.width = this.box.clientWidth;
    this.height = this.box.clientHeight;
    if (!this.width || !this.height) return;
    this.end = this.time(this.film.frames - 1) || 1;
    const ratio = window.devicePixelRatio || 1, {canvas} = this;
    canvas.width = Math.round(this.width * ratio);
    canvas.height = Math.round(this.height * ratio);
    const style = getComputedStyle(document.documentElement), ink = (name) => style.getPropertyValue(`--${name}`).trim();
    const g = canvas.getContext('2d');
    g.scale(ratio, ratio);
    g.font = `11px ${style.getPropertyValue('--font')}`;
    g.lineWidth = 1;
    const {series, stacked, log, aim, marks} = this.definition;
    const [low, high] = this.#range();
    const bottom = this.height - BOTTOM, right = this.width - RIGHT;
    const y = (value) => bottom - ((value - low) / (high - low)) * (bottom - TOP);
    const level = (value) => y(log ? Math.log10(value) : value);

    g.textBaseline = 'middle';
    g.textAlign = 'right';
    const ticks = log ? powerTicks(low, high, (bottom - TOP) / 22) : linearTicks(low, high, (bottom - TOP) / 26);
    for (const tick of ticks) {
      const at = Math.round(y(tick)) + 0.5;
      g.strokeStyle = ink('grid');
      g.beginPath(), g.moveTo(LEFT, at), g.lineTo(right, at), g.stroke();
      g.fillStyle = ink('soft');
      g.fillText(log ? powerName(tick) : tickName(tick), LEFT - 6, at);
    }
    g.textBaseline = 'top';
    g.textAlign = 'center';
    for (const tick of linearTicks(0, this.end, (right - LEFT) / 70)) {
      const at = this.x(tick);
      g.fillStyle = ink('soft');
      const last = at > right - 14;
      g.textAlign = last ? 'right' : 'center';
      g.fillText(`${tickName(tick)} s`, last ? right : at, bottom + 6);
      g.strokeStyle = ink('grid');
      g.beginPath(), g.moveTo(at, bottom), g.lineTo(at, bottom + 4), g.stroke();
    }

    g.save();
    g.beginPath(), g.rect(LEFT, TOP - 3, right - LEFT + 1, bottom - TOP + 4), g.clip();
    if (stacked) this.#areas(g, ink, y);
    else for (const s of series) this.#line(g, ink(s.colour), s.of, level, log);
    if (aim) {
      g.setLineDash([4, 4]);
      g.strokeStyle = ink('text');
      g.globalAlpha = 0.6;
      g.beginPath(), g.moveTo(LEFT, level(aim)), g.lineTo(right, level(aim)), g.stroke();
      g.fillStyle = ink('text');
      g.textAlign = 'left';
      g.textBaseline = 'bottom';
      g.fillText('aim', LEFT + 4, level(aim) - 2);
      g.globalAlpha = 1;
      g.setLineDash([]);
    }
    if (marks) {
      g.fillStyle = ink('bad');
      for (let i = 0; i < this.film.frames; ++i) if (marks(i)) g.fillRect(this.x(this.time(i)) - 1, TOP - 2, 2, bottom - TOP + 2);
    }
    g.restore();
    g.strokeStyle = ink('axis');
    g.beginPath(), g.moveTo(LEFT, bottom + 0.5), g.lineTo(right, bottom + 0.5), g.stroke();
  }

  #line(g, colour, of, level, log) {
    g.strokeStyle = colour;
    g.lineWidth = 1.5;
    g.lineJoin = 'round';
    g.beginPath();
    let open = false;
    for (let i = 0; i < this.film.frames; ++i) {
      const value = of(i);
      if (log && !(value > 0)) {
        open = false;
        continue;
      }
      const x = this.x(this.time(i)), y = level(value);
      if (open) g.lineTo(x, y);
      else g.moveTo(x, y), g.lineTo(x + 0.5, y);
      open = true;
    }
    g.stroke();
  }

  #areas(g, ink, y) {
    const below = new Float64Array(this.film.frames);
    for (const {of, colour} of this.definition.series) {
      g.fillStyle = ink(colour);
      g.beginPath();
      for (let i = 0; i < below.length; ++i) g.lineTo(this.x(this.time(i)), y(below[i] + of(i)));
      for (let i = below.length - 1; i >= 0; --i) g.lineTo(this.x(this.time(i)), y(below[i]));
      g.fill();
      for (let i = 0; i < below.length; ++i) below[i] += of(i);
    }
  }
}
