/** The document in the address: deflated JSON, in the letters that addresses may have. */

import type { BenchDocument } from "./protocol";

/** Bytes that become letters at once: byte by byte a whole picture takes milliseconds. */
const AT_ONCE = 8192;

export function base64(bytes: Uint8Array): string {
  let letters = "";
  for (let at = 0; at < bytes.length; at += AT_ONCE) letters += String.fromCharCode(...bytes.subarray(at, at + AT_ONCE));
  return btoa(letters);
}

async function through(bytes: Uint8Array, by: CompressionStream | DecompressionStream): Promise<Uint8Array> {
  const stream = new Blob([bytes as BlobPart]).stream().pipeThrough(by as ReadableWritablePair<Uint8Array, Uint8Array>);
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

export async function written(document: BenchDocument): Promise<string> {
  const json = new TextEncoder().encode(JSON.stringify(document));
  const bytes = await through(json, new CompressionStream("deflate-raw"));
  return "#d=" + base64(bytes).replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "");
}

/** The document of an address's fragment; null where there is none. An error where it is damaged. */
export async function read(fragment: string): Promise<BenchDocument | null> {
  const found = /^#d=(.*)$/.exec(fragment);
  if (!found) return null;
  const letters = atob(found[1]!.replaceAll("-", "+").replaceAll("_", "/"));
  const bytes = Uint8Array.from(letters, (letter) => letter.charCodeAt(0));
  const json = await through(bytes, new DecompressionStream("deflate-raw"));
  return JSON.parse(new TextDecoder().decode(json)) as BenchDocument;
}
