// Where frames come from: here, from the page itself. Another source (a live run) has the same four:
//   head      what the page tells of the film, see page_head.cpp
//   frames    how many there are
//   numbers   Map of a curve's name to its Float64Array, one number a frame
//   load(k)   Promise of chunk k: {bodies, contacts}, functions that give Promises of a Uint8Array each

const element = (id) => document.getElementById(id);

async function unpack(id) {
  const text = atob(element(id).textContent);
  const packed = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) packed[i] = text.charCodeAt(i);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

export async function openPage() {
  const head = JSON.parse(element('head').textContent);
  const bytes = await unpack('numbers');
  const numbers = new Map();
  head.numbers.forEach((name, i) => {
    numbers.set(name, new Float64Array(bytes.buffer.slice(8 * i * head.frames, 8 * (i + 1) * head.frames)));
  });
  const load = async (k) => ({bodies: () => unpack(`bodies${k}`), contacts: () => unpack(`contacts${k}`)});
  return {head, frames: head.frames, numbers, load};
}
