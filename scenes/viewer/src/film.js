// The film, chunk by chunk: decoded when wanted, the least used forgotten.
import {decodeBodies, decodeContacts} from './decode.js';

const CHUNKS_KEPT = 16;

export class Film {
  constructor(source) {
    this.source = source;
    this.head = source.head;
    this.frames = source.frames;
    this.numbers = source.numbers;
    this.chunkOf = [];
    this.firstOf = [];
    this.head.chunks.forEach((size, k) => {
      this.firstOf.push(this.chunkOf.length);
      for (let i = 0; i < size; ++i) this.chunkOf.push(k);
    });
    this.chunks = new Map();  // in the order of their last use
  }

  number(name, frame) {
    return this.numbers.get(name)[frame];
  }

  // Promise of frame i. withContacts: it has `contacts`, too.
  async frame(i, withContacts) {
    const k = this.chunkOf[i];
    const chunk = this.#use(k);
    const frames = await chunk.bodies;
    const frame = frames[i - this.firstOf[k]];
    if (withContacts && !frame.contacts) {
      chunk.contacts ??= this.#contacts(k, frames);
      await chunk.contacts;
    }
    return frame;
  }

  // Frame i if it is decoded, else null, and it will soon be.
  ready(i, withContacts) {
    const k = this.chunkOf[i];
    const frame = this.chunks.get(k)?.frames?.[i - this.firstOf[k]];
    if (frame && (!withContacts || frame.contacts)) {
      this.#use(k);
      return frame;
    }
    this.frame(i, withContacts).catch(() => {});  // who shows it will hear of it
    return null;
  }

  #use(k) {
    const chunk = this.chunks.get(k) ?? this.#open(k);
    this.chunks.delete(k);
    this.chunks.set(k, chunk);
    while (this.chunks.size > CHUNKS_KEPT) this.chunks.delete(this.chunks.keys().next().value);
    return chunk;
  }

  #open(k) {
    const data = this.source.load(k);
    const chunk = {data, frames: null, contacts: null};
    chunk.bodies = (async () => (chunk.frames = decodeBodies(await (await data).bodies(), this.head.steps)))();
    return chunk;
  }

  async #contacts(k, frames) {
    const bytes = await (await this.chunks.get(k).data).contacts();
    const decoded = decodeContacts(bytes, frames, this.head.bodies.kind, this.head.steps);
    decoded.forEach((contacts, i) => (frames[i].contacts = contacts));
  }
}
