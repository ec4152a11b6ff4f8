// Arrays: from the server, or out of this very file.

const ARRAY_TYPES = { 8: Uint8Array, 16: Uint16Array };

function inlineText(name) {
  return document.getElementById(`data-${name}`)?.textContent ?? null;
}

export function isExported() {
  return inlineText("about") !== null;
}

export async function loadAbout() {
  const text = inlineText("about");
  return text === null ? (await fetched("about")).json() : JSON.parse(text);
}

async function fetched(name, signal) {
  const answer = await fetch(`data/${name}`, { signal });
  if (answer.ok) return answer;
  let why = `${answer.status}`;
  try { why = (await answer.json()).error ?? why; } catch { /* not JSON: the number has to do */ }
  throw new Error(why);
}

/** An array by name: {shape, numbers, scale, offset}; values are offset + scale * number. */
export async function loadArray(name, signal) {
  const text = inlineText(name);
  return decodeBlob(text === null ? await (await fetched(name, signal)).arrayBuffer() : bytesOf(text).buffer);
}

function bytesOf(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const binary = atob(text), bytes = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; i++) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

async function decodeBlob(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const start = 4 + length;
  let numbers;
  if (header.coding === "plain") numbers = new ARRAY_TYPES[header.bits](buffer, start);
  else if (header.coding === "deflate") numbers = await inflated(new Uint8Array(buffer, start), header);
  else numbers = await unpictured(new Uint8Array(buffer, start), header);
  return { shape: header.shape, bits: header.bits, scale: header.scale, offset: header.offset, numbers };
}

/** Undoes zlib, the parting into high and low bytes, and the differences to the left. */
async function inflated(bytes, header) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const planes = new Uint8Array(await new Response(stream).arrayBuffer());
  const size = header.bits / 8, count = planes.length / size;
  const numbers = size === 1 ? planes : new Uint16Array(count);
  if (size === 2) for (let i = 0; i < count; i++) numbers[i] = planes[i] | (planes[count + i] << 8);
  for (let row = 0; row < count; row += header.width) {
    const end = row + header.width;
    for (let i = row + header.step; i < end; i++) numbers[i] += numbers[i - header.step];
  }
  return numbers;
}

async function unpictured(bytes, header) {
  const [count, ny, nx] = header.shape, channels = header.shape[3] ?? 1;
  const numbers = new Uint8Array(count * ny * nx * channels);
  const canvas = document.createElement("canvas");
  canvas.width = nx; canvas.height = ny;
  const context = canvas.getContext("2d", { willReadFrequently: true });
  let start = 0, at = 0;
  for (const size of header.sizes) {
    const blob = new Blob([bytes.subarray(start, start + size)], { type: "image/webp" });
    const how = { premultiplyAlpha: "none", colorSpaceConversion: "none" };
    context.drawImage(await createImageBitmap(blob, how), 0, 0);
    const rgba = context.getImageData(0, 0, nx, ny).data;
    for (let i = 0; i < rgba.length; i += 4) for (let c = 0; c < channels; c++) numbers[at++] = rgba[i + c];
    start += size;
  }
  return numbers;
}
