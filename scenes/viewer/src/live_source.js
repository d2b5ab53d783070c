// A run that goes on while the page is open: its frames come as server-sent events, messages to it go by POST; live_server.h has both.
// Frames are kept packed. Once there are too many, every second one of the older half is forgotten, so that all of the run stays there,
// what is long ago in larger steps, and the memory is bounded however long it runs. The run keeps as many for pages that come later:
// one that is opened or loaded anew gets them first.
import {fromBase64, unpack} from './unpack.js';

const MOST_FRAMES = 20000;   // a curve of so many is drawn in some milliseconds
const MOST_LETTERS = 128e6;  // of base64, a byte each: what a tab can well spare

export class LiveSource {
  static open() {
    const source = new LiveSource();
    return new Promise((resolve, reject) => {
      source.onFrame = () => resolve(source);
      source.onLost = () => reject(new Error('the run does not answer; has it ended?'));
    });
  }

  constructor() {
    this.live = true;
    this.head = this.state = null;
    this.numbers = new Map();
    this.keys = [];          // of the frames that are kept
    this.texts = new Map();  // of a key: bodies and contacts
    this.letters = 0;
    this.lastKey = 0;
    this.onHead = this.onState = this.onFrame = this.onThin = this.onEnd = this.onLost = this.onFound = () => {};
    this.stream = new EventSource('stream');
    const on = (event, action) => this.stream.addEventListener(event, ({data}) => action(data));
    on('head', (data) => this.#takeHead(JSON.parse(data)));
    on('state', (data) => {
      this.state = JSON.parse(data);
      this.onState();
    });
    on('frame', (data) => this.#takeFrame(...data.split(' ')));
    on('end', () => {
      this.stream.close();
      this.state.running = false;
      this.onEnd();
    });
    this.stream.addEventListener('error', () => this.onLost());
    this.stream.addEventListener('open', () => this.onFound());
    this.waiting = [];
    this.sending = false;
    // Nobody would let go of what this page holds.
    addEventListener('pagehide', () => navigator.sendBeacon('command', '{"do": "release"}'));
  }

  get frames() {
    return this.keys.length;
  }

  place(i) {
    return [this.keys[i], 0];
  }

  load(key) {
    const [bodies, contacts] = this.texts.get(key);
    return {bodies: () => unpack(bodies), contacts: () => unpack(contacts)};
  }

  #takeHead(head) {
    this.head = head;
    for (const name of head.numbers) if (!this.numbers.has(name)) this.numbers.set(name, []);
    this.onHead();
  }

  // One of the same number takes the place of the last: the bodies have changed since. One before it is there already.
  #takeFrame(bodies, contacts, numbers) {
    const values = new Float64Array(fromBase64(numbers).buffer), {head} = this;
    const number = values[head.numbers.indexOf('number')], last = this.numbers.get('number').at(-1);
    if (number < last) return;
    const place = number === last ? this.frames - 1 : this.frames;
    if (place < this.frames) this.#forget(this.keys[place]);
    head.numbers.forEach((name, k) => (this.numbers.get(name)[place] = values[k]));
    this.keys[place] = ++this.lastKey;
    this.texts.set(this.lastKey, [bodies, contacts]);
    this.letters += bodies.length + contacts.length;
    while (this.frames > 2 && (this.frames > MOST_FRAMES || this.letters > MOST_LETTERS)) this.thin();
    this.onFrame();
  }

  #forget(key) {
    for (const text of this.texts.get(key)) this.letters -= text.length;
    this.texts.delete(key);
  }

  thin() {
    const half = this.frames >> 1, stays = (_, i) => i >= half || i % 2 === 0;
    for (const [name, values] of this.numbers) this.numbers.set(name, values.filter(stays));
    this.keys.forEach((key, i) => stays(key, i) || this.#forget(key));
    this.keys = this.keys.filter(stays);
    this.onThin((i) => (i < half ? i >> 1 : i - (half >> 1)));
  }

  // One message after the other; of those that are alike and wait, the last. answer(why): '' done, else why not.
  send(message, answer = () => {}) {
    if (this.waiting.at(-1)?.message.do === message.do && !['step', 'throw'].includes(message.do)) this.waiting.pop();
    this.waiting.push({message, answer});
    if (!this.sending) this.#sendAll();
  }

  async #sendAll() {
    this.sending = true;
    while (this.waiting.length > 0) {
      const {message, answer} = this.waiting.shift();
      try {
        const response = await fetch('command', {method: 'POST', body: JSON.stringify(message)});
        answer(response.ok ? '' : await response.text());
      } catch {
        answer('the run does not answer');
      }
    }
    this.sending = false;
  }
}
