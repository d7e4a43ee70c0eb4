/// Files of a zip archive: its central directory, stored and deflated entries; no encryption, no zip64. APPNOTE.TXT 6.3.10, 4.3. No DOM.
import { decoded } from './table_file';

const END = 0x06054b50,
  ENTRY = 0x02014b50;
const MAX_BYTES = 512 * 1024 * 1024; ///< unpacked: a flight of hours; an archive that unpacks to more is none

export interface Packed {
  readonly name: string;
  read(): Promise<string>;
}
export async function inflated(bytes: Uint8Array, format: 'deflate-raw' | 'gzip'): Promise<string> {
  const reader = new Blob([bytes as BlobPart]).stream().pipeThrough(new DecompressionStream(format)).getReader(),
    parts: Uint8Array[] = [];
  let size = 0;
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    size += value.length;
    if (size > MAX_BYTES) throw new Error(`unpacks to more than ${MAX_BYTES / 1024 / 1024} MiB`);
    parts.push(value);
  }
  return decoded(new Uint8Array(await new Blob(parts as BlobPart[]).arrayBuffer()));
}
export function entries_of(bytes: Uint8Array): Packed[] {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength),
    text = new TextDecoder();
  let end = bytes.length - 22;
  while (end >= 0 && view.getUint32(end, true) !== END) end--;
  if (end < 0) throw new Error('not a zip archive: it has no end record');
  const count = view.getUint16(end + 10, true),
    out: Packed[] = [];
  let at = view.getUint32(end + 16, true);
  for (let i = 0; i < count; i++) {
    if (at + 46 > bytes.length || view.getUint32(at, true) !== ENTRY) throw new Error('the zip archive is damaged');
    const method = view.getUint16(at + 10, true),
      encrypted = (view.getUint16(at + 8, true) & 1) !== 0,
      size = view.getUint32(at + 20, true),
      name_length = view.getUint16(at + 28, true),
      name = text.decode(bytes.subarray(at + 46, at + 46 + name_length)),
      local = view.getUint32(at + 42, true);
    at += 46 + name_length + view.getUint16(at + 30, true) + view.getUint16(at + 32, true);
    if (at > end) throw new Error('the zip archive is damaged');
    if (name.endsWith('/')) continue;
    out.push({
      name,
      read: async () => {
        if (encrypted) throw new Error(`${name} is encrypted`);
        if (local + 30 > bytes.length) throw new Error('the zip archive is damaged');
        const from = local + 30 + view.getUint16(local + 26, true) + view.getUint16(local + 28, true),
          packed = bytes.subarray(from, from + size);
        if (method === 0) return decoded(packed);
        if (method !== 8)
          throw new Error(`${name} is compressed by method ${method}; only stored and deflate are supported`);
        return inflated(packed, 'deflate-raw');
      },
    });
  }
  return out;
}
