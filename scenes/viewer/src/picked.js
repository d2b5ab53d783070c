// What is told of the body that is picked.
import {count, make, metres, number} from './format.js';

const MOST_ROWS = 12;

const row = (name, ...value) => make('tr', {}, make('th', {scope: 'row'}, name), make('td', {}, ...value));
const vector = (v) => v.map((x) => (Math.abs(x) < 5e-4 ? 0 : x).toFixed(3).replace('-', '−')).join(', ');

function contactsOf(frame, body) {
  const {contacts} = frame, found = [];
  for (let c = 0; c < contacts.count; ++c) {
    if (contacts.a[c] === body || contacts.b[c] === body) found.push({other: contacts.a[c] === body ? contacts.b[c] : contacts.a[c], size: contacts.sizes[c]});
  }
  return found.sort((p, q) => q.size - p.size);
}

export function contactTable(frame, body, dt, pick) {
  const found = contactsOf(frame, body);
  const rows = found.slice(0, MOST_ROWS).map(({other, size}) => make('tr', {},
    make('td', {}, make('button', {class: 'link', onclick: () => pick(other)}, `body ${other}`)),
    make('td', {}, `${number(size)} N s`), make('td', {}, `${number(size / dt)} N`)));
  const table = make('table', {class: 'contacts'}, make('tr', {}, make('th', {}, 'with'), make('th', {}, 'impulse'), make('th', {}, 'force')), ...rows);
  const more = found.length - rows.length;
  return make('div', {}, ...(rows.length ? [table] : []), ...(more > 0 ? [make('p', {class: 'note'}, `and ${count(more)} that press less`)] : []));
}

// Of the way since the frame before, as far as the steps of the positions tell it.
function speed(moved, seconds, {steps}) {
  if (moved === null) return 'not known';
  const least = 2 * steps.position;
  return moved > 0 && moved < least ? `below ${number(least / seconds, 2)} m/s` : `${number(moved / seconds)} m/s`;
}

// before: the frame so many seconds before, or null.
export function bodyTable(film, frame, before, seconds, body, pick) {
  const {head} = film, {bodies} = head;
  const place = [...frame.positions.subarray(3 * body, 3 * body + 3)];
  const moved = before && Math.hypot(...place.map((x, k) => x - before.positions[3 * body + k]));
  const fixed = bodies.kind[body] !== 'dynamic';
  const island = frame.island[body];
  let members = 0;
  for (const other of frame.island) members += other === island;
  const state = fixed ? bodies.kind[body] : frame.frozen[body] ? 'frozen' : 'awake';
  const touching = contactsOf(frame, body);
  const cut = frame.contacts.count < frame.contacts.all;
  const rows = [
    row('Number', String(body)), row('Shape', `${head.shapes[bodies.shape[body]].kind}, ${state}`),
    ...(fixed ? [] : [row('Mass', `${number(bodies.mass[body])} kg`)]),
    row('Position', `${vector(place)} m`),
    row('Speed', speed(moved, seconds, head)),
    row('Island', island < 0 ? 'none' : `${island}, of ${count(members)} ${members === 1 ? 'body' : 'bodies'}`),
    ...(frame.accuracy[body] > 0 ? [row('Accuracy', `${number(frame.accuracy[body])} of v_ref`)] : []),
    row('Contacts', cut ? `${touching.length} of those kept` : String(touching.length)),
  ];
  return make('div', {}, make('table', {class: 'numbers'}, ...rows), contactTable(frame, body, head.dt, pick));
}
