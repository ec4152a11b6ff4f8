// A WebM file (Matroska, RFC 9559) of encoded video frames.

const bytesOf = (number, count) => Uint8Array.from({ length: count }, (_, k) => Math.floor(number / 256 ** (count - 1 - k)) % 256);

function joined(parts) {
  const out = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
  let at = 0;
  for (const part of parts) { out.set(part, at); at += part.length; }
  return out;
}

/** An element: its id (hexadecimal), its size in 8 bytes, its content. */
function element(id, ...parts) {
  const content = joined(parts), size = bytesOf(content.length, 8);
  size[0] |= 1; // says that the size has 8 bytes
  return joined([bytesOf(parseInt(id, 16), id.length / 2), size, content]);
}

const whole = (id, number) => element(id, bytesOf(number, 6));
const text = (id, words) => element(id, new TextEncoder().encode(words));
const real = (id, number) => { const at = new DataView(new ArrayBuffer(8)); at.setFloat64(0, number); return element(id, new Uint8Array(at.buffer)); };

/** Frames {data, key, time [ms]} that begin with a key frame, as a file; `codec` is Matroska's name, `duration` [ms] that of the film. */
export function webm({ codec, width, height, duration }, frames) {
  const head = element("1A45DFA3", whole("4286", 1), whole("42F7", 1), whole("42F2", 4), whole("42F3", 8), text("4282", "webm"), whole("4287", 4), whole("4285", 2));
  const info = element("1549A966", whole("2AD7B1", 1e6), real("4489", duration), text("4D80", "lumigraph"), text("5741", "lumigraph"));
  const track = element("AE", whole("D7", 1), whole("73C5", 1), whole("83", 1), text("86", codec),
    whole("23E383", Math.round((1e6 * duration) / frames.length)), element("E0", whole("B0", width), whole("BA", height)));
  const parts = [info, element("1654AE6B", track)], cues = [];
  let at = parts[0].length + parts[1].length;
  for (const group of groups(frames)) {
    const { time } = group[0], cluster = element("1F43B675", whole("E7", time), ...group.map((frame) => block(frame, time)));
    cues.push(element("BB", whole("B3", time), element("B7", whole("F7", 1), whole("F1", at))));
    parts.push(cluster);
    at += cluster.length;
  }
  return new Blob([head, element("18538067", ...parts, element("1C53BB6B", ...cues))], { type: "video/webm" });
}

/** Frames from key frame to key frame. */
function groups(frames) {
  const found = [];
  for (const frame of frames) if (frame.key) found.push([frame]); else found.at(-1).push(frame);
  return found;
}

function block({ data, key, time }, start) {
  return element("A3", Uint8Array.of(0x81), bytesOf(time - start, 2), Uint8Array.of(key ? 0x80 : 0), data);
}
