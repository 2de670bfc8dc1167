// Binary frames of the protocol, as the program writes them.

import { readFrame, type BinaryAnswer } from "../src/protocol";

/** The bytes of a frame. */
export function frameBytes(header: object, data: Uint8Array): ArrayBuffer {
  const text = new TextEncoder().encode(JSON.stringify(header));
  const bytes = new Uint8Array(4 + text.length + data.length);
  new DataView(bytes.buffer).setUint32(0, text.length, true);
  bytes.set(text, 4);
  bytes.set(data, 4 + text.length);
  return bytes.buffer;
}

/** A frame that was read. */
export function frame(header: object, data: Uint8Array): BinaryAnswer {
  return readFrame(frameBytes(header, data));
}
