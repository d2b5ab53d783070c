// Which charts stand under the scene.
import {count, number} from './format.js';
import {Plot} from './plot.js';

// of a series: its value in a frame.
export function makeCurves(film, onScrub) {
  const values = (name) => (i) => film.number(name, i);
  const thousandths = (name) => (i) => 1e3 * film.number(name, i);
  const series = (name, of, colour, format = number) => ({name, of, colour, format});
  const ms = (x) => number(x, 2);
  const definitions = [
    {id: 'contacts', title: 'Contacts', unit: 'count', series: [series('contacts', values('contacts'), 'c1', count), series('awake', values('awake'), 'c2', count)]},
    {id: 'time', title: 'Time a frame', unit: 'ms, stacked', stacked: true, series: [
      series('detect', thousandths('detect'), 'c1', ms), series('blows', thousandths('pq'), 'c6', ms), series('collisions', thousandths('collision_qp'), 'c2', ms),
      series('resting', thousandths('static_qp'), 'c3', ms), series('freeze', thousandths('freeze'), 'c4', ms),
      series('move', (i) => 1e3 * (film.number('move', i) + film.number('cut_islands', i)), 'c5', ms)]},
    {id: 'energy', title: 'Energy', unit: 'J, potential from the start', series: [
      series('kinetic', values('kinetic'), 'c2'), series('total', (i) => film.number('kinetic', i) + film.number('potential', i), 'c1')]},
    {id: 'accuracy', title: 'Accuracy', unit: 'of v_ref, worst island', log: true, aim: film.head.tolerance, series: [series('natural map', values('accuracy'), 'c3', (x) => number(x, 2))]},
    {id: 'ledger', title: 'Ledger', unit: 'relative; red: failed step', log: true, marks: values('failed'), series: [
      series('energy created', values('energy_created'), 'c2', (x) => number(x, 2)), series('momentum', values('momentum_unexplained'), 'c1', (x) => number(x, 2)),
      series('angular', values('angular_momentum_unexplained'), 'c4', (x) => number(x, 2))]},
    {id: 'overlap', title: 'Deepest overlap', unit: 'mm', series: [series('overlap', thousandths('penetration'), 'c5')]},
  ];
  return definitions.map((definition) => new Plot(definition, film, onScrub));
}
