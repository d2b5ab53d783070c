// Reads what varint.h and page_chunk.cpp wrote: whole numbers of seven bits a byte, floats, bytes.

export class Bytes {
  constructor(array) {
    this.array = array;
    this.at = 0;
    this.view = new DataView(array.buffer, array.byteOffset, array.byteLength);
  }

  // Up to 2^53, so beyond 28 bits by multiplication.
  whole() {
    let value = 0, shift = 0, byte;
    do {
      if (this.at >= this.array.length) throw new Error('the data of the page ends early');
      byte = this.array[this.at++];
      value = shift < 28 ? value | ((byte & 127) << shift) : value + (byte & 127) * 2 ** shift;
      shift += 7;
    } while (byte & 128);
    return value;
  }

  signed() {
    const value = this.whole();
    return value % 2 ? -(value + 1) / 2 : value / 2;
  }

  float() {
    this.at += 4;
    return this.view.getFloat32(this.at - 4, true);
  }

  take(count) {
    this.at += count;
    return this.array.subarray(this.at - count, this.at);
  }
}
