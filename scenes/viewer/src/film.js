// The film, chunk by chunk: decoded when wanted, the least used forgotten.
import {decodeBodies, decodeContacts} from './decode.js';

const CHUNKS_KEPT = 16;

export class Film {
  constructor(source) {
    this.source = source;
    this.chunks = new Map();  // of a key, in the order of their last use
  }

  get head() {
    return this.source.head;
  }

  get frames() {
    return this.source.frames;
  }

  get numbers() {
    return this.source.numbers;
  }

  number(name, frame) {
    return this.numbers.get(name)[frame];
  }

  // Promise of frame i. withContacts: it has `contacts`, too.
  async frame(i, withContacts) {
    const [key, at] = this.source.place(i), chunk = this.#use(key);
    const frames = await chunk.bodies, frame = frames[at];
    if (withContacts && !frame.contacts) {
      chunk.contacts ??= this.#contacts(chunk, frames);
      await chunk.contacts;
    }
    return frame;
  }

  // Frame i if it is decoded, else null, and it will soon be.
  ready(i, withContacts) {
    const [key, at] = this.source.place(i), frame = this.chunks.get(key)?.frames?.[at];
    if (frame && (!withContacts || frame.contacts)) {
      this.#use(key);
      return frame;
    }
    this.frame(i, withContacts).catch(() => {});  // who shows it will hear of it
    return null;
  }

  #use(key) {
    const chunk = this.chunks.get(key) ?? this.#open(key);
    this.chunks.delete(key);
    this.chunks.set(key, chunk);
    while (this.chunks.size > CHUNKS_KEPT) this.chunks.delete(this.chunks.keys().next().value);
    return chunk;
  }

  #open(key) {
    const data = this.source.load(key);
    const chunk = {data, frames: null, contacts: null};
    chunk.bodies = (async () => (chunk.frames = decodeBodies(await data.bodies(), this.head.steps)))();
    return chunk;
  }

  async #contacts(chunk, frames) {
    const decoded = decodeContacts(await chunk.data.contacts(), frames, this.head.bodies.kind, this.head.steps);
    decoded.forEach((contacts, i) => (frames[i].contacts = contacts));
  }
}
