// From values to bytes on the screen: exposure, gamma, channel, colour map. The shader does the same.

import { mapColours } from "./colours.js";

export const CHANNELS = ["colour", "mono", "red", "green", "blue"];
export const LUMINANCE = [0.2126, 0.7152, 0.0722]; // Rec. 709

export const EVEN = [1, 1, 1]; // gains of red, green and blue

const mapCache = new Map();

export function cachedMap(name) {
  if (!mapCache.has(name)) mapCache.set(name, mapColours(name));
  return mapCache.get(name);
}

/** What tone settings mean for numbers that stand for offset + scale * number. */
export function toneOf(state, image) {
  const white = image.white || 1, gain = (2 ** state.ev) / (white * (1 - state.black));
  return {
    gain: gain * image.scale, lift: gain * (image.offset - state.black * white), power: 1 / state.gamma,
    map: state.map, channel: image.channels === 3 ? state.channel : "mono", balance: image.channels === 3 ? state.balance : EVEN,
  };
}

/** Weights of red, green and blue in the one value that is shown; null where all three are. */
export function channelWeights(channel) {
  if (channel === "colour") return null;
  const single = ["red", "green", "blue"].indexOf(channel);
  return single < 0 ? LUMINANCE : [0, 1, 2].map((c) => (c === single ? 1 : 0));
}

/** Bytes r, g, b, a of numbers (n pixels, interleaved channels), as the shader would show them. */
export function toneBytes(numbers, channels, tone) {
  const n = numbers.length / channels, out = new Uint8ClampedArray(4 * n);
  const { gain, lift, power, balance = EVEN } = tone, map = cachedMap(tone.map), weights = channelWeights(tone.channel);
  const byte = (x) => Math.min(1, Math.max(0, x)) ** power * 255, level = (x) => byte(gain * x + lift);
  const table = numbers.BYTES_PER_ELEMENT <= 2 && n > 65536 && !(numbers instanceof Float32Array)
    ? Float32Array.from({ length: numbers.BYTES_PER_ELEMENT === 1 ? 256 : 65536 }, (_, x) => level(x)) : null;
  const shown = table ? (x) => table[x] : level, even = balance.every((b) => b === 1);
  for (let i = 0, o = 0; i < n; i++, o += 4) {
    out[o + 3] = 255;
    if (channels === 3 && !weights) {
      for (let c = 0; c < 3; c++) out[o + c] = even ? shown(numbers[3 * i + c]) : byte(balance[c] * (gain * numbers[3 * i + c] + lift));
      continue;
    }
    const light = channels === 1 ? 0 : weights.reduce((sum, w, c) => sum + w * balance[c] * (gain * numbers[3 * i + c] + lift), 0);
    const k = 4 * Math.round(channels === 1 ? shown(numbers[i]) : byte(light));
    out[o] = map[k]; out[o + 1] = map[k + 1]; out[o + 2] = map[k + 2];
  }
  return out;
}
