// Where frames come from: here, from the page itself. The other source, a live run (live_source.js), has the same:
//   head      what the page tells of the film, see page_head.cpp
//   frames    how many there are
//   numbers   Map of a curve's name to its numbers, one a frame
//   place(i)  of frame i: [key of its chunk, which one it is in there]
//   load(key) {bodies, contacts} of a chunk: functions that give Promises of a Uint8Array each
import {LiveSource} from './live_source.js';
import {unpack} from './unpack.js';

const element = (id) => document.getElementById(id);

async function openPage() {
  const head = JSON.parse(element('head').textContent);
  const bytes = await unpack(element('numbers').textContent);
  const numbers = new Map();
  head.numbers.forEach((name, i) => {
    numbers.set(name, new Float64Array(bytes.buffer.slice(8 * i * head.frames, 8 * (i + 1) * head.frames)));
  });
  const places = head.chunks.flatMap((size, k) => Array.from({length: size}, (_, i) => [k, i]));
  const load = (k) => ({bodies: () => unpack(element(`bodies${k}`).textContent), contacts: () => unpack(element(`contacts${k}`).textContent)});
  return {head, frames: head.frames, numbers, place: (i) => places[i], load};
}

export const openSource = () => (element('live') ? LiveSource.open() : openPage());
