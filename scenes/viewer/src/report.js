// The run in numbers, and its worst frame.
import {count, make, metres, number} from './format.js';

function most(values) {
  let frame = 0;
  for (let i = 1; i < values.length; ++i) if (values[i] > values[frame]) frame = i;
  return {frame, value: values[frame]};
}

// The first step that failed; else where the accuracy is worst; else the deepest overlap.
export function worstFrame(film) {
  const failed = film.numbers.get('failed').indexOf(1);
  if (failed >= 0) return {frame: failed, why: 'the first failed step'};
  const accuracy = most(film.numbers.get('accuracy'));
  if (accuracy.value > 0) return {frame: accuracy.frame, why: `the worst accuracy, ${number(accuracy.value)} of v_ref against an aim of ${number(film.head.tolerance)}`};
  const overlap = most(film.numbers.get('penetration'));
  return {frame: overlap.frame, why: `the deepest overlap, ${metres(overlap.value)}`};
}

const sum = (values) => values.reduce((a, b) => a + b, 0);

// Of a live run a page may have received fewer frames than there were steps, and have forgotten some: what it sums up is of those it has.
export function reportTable(film, go) {
  const {numbers, head} = film, last = film.frames - 1, {live, state} = film.source;
  const at = (frame) => make('button', {class: 'link', title: 'Show this frame', onclick: () => go(frame)}, String(numbers.get('number')[frame]));
  const row = (name, value, ...where) => make('tr', {}, make('th', {scope: 'row'}, name), make('td', {}, value), make('td', {}, ...where));
  const worst = (name, key, format) => {
    const {frame, value} = most(numbers.get(key));
    return row(name, format(value), ...(value > 0 ? [at(frame)] : []));
  };
  const seconds = numbers.get('step_seconds'), steps = Math.max(last, 1);
  const failed = sum(numbers.get('failed')), first = numbers.get('failed').indexOf(1);
  const unsolved = numbers.get('unsolved');
  const hash = ['hash_high', 'hash_low'].map((key) => numbers.get(key)[last].toString(16).padStart(8, '0')).join('');
  return make('table', {class: 'numbers report'}, make('tr', {}, make('td', {colspan: 2}), make('th', {}, 'frame')),
    row('Simulated', `${number(numbers.get('time')[last], 4)} s`), ...(head.stopped_by ? [row('Stopped by', head.stopped_by)] : []),
    ...(live ? [row('Steps', count(numbers.get('number')[last])), row('Of these in this page, and counted below', count(last))] : [row('Steps', count(last))]),
    row('Failed steps', count(failed), ...(failed ? [at(first)] : [])),
    row('Problems that missed the aim', count(sum(numbers.get('missed')))),
    ...(unsolved.every((n) => n >= 0) ? [row('Problems that failed', count(sum(unsolved)), ...(sum(unsolved) ? [at(unsolved.findIndex((n) => n > 0))] : []))] : []),
    worst('Accuracy, of v_ref', 'accuracy', number), worst('Coulomb map', 'coulomb_map', (x) => `${number(x)} m/s`),
    worst('Deepest overlap', 'penetration', metres), worst('Energy created', 'energy_created', number),
    worst('Momentum unexplained', 'momentum_unexplained', number), worst('Most contacts', 'contacts', count),
    row('Time a frame, mean', `${number((1e3 * sum(seconds)) / steps)} ms`), worst('Time a frame, most', 'step_seconds', (x) => `${number(1e3 * x)} ms`),
    row('Kinetic energy, end', `${number(numbers.get('kinetic')[last])} J`), row('Awake, frozen', `${count(numbers.get('awake')[last])}, ${count(numbers.get('frozen')[last])}`),
    ...(state?.changed ? [] : [make('tr', {}, make('th', {scope: 'row'}, 'State hash'), make('td', {colspan: 2}, make('code', {}, hash)))]));
}

// The island with the worst accuracy in a frame: its name, its bodies.
export function worstIsland(frame) {
  let worst = -1;
  frame.accuracy.forEach((value, i) => {
    if (value > 0 && (worst < 0 || value > frame.accuracy[worst])) worst = i;
  });
  if (worst < 0) return null;
  const island = frame.island[worst], bodies = [];
  frame.island.forEach((other, i) => other === island && bodies.push(i));
  return {island, bodies, accuracy: frame.accuracy[worst]};
}
