// What is shown, as a link can say it: #mode=picture&focus=0.952&aperture=60%25 ...

import { MAPS } from "./colours.js";
import { TOOLS } from "./measures.js";
import { CHANNELS } from "./tone.js";

const number = (low, high) => (text) => {
  const value = Number(text);
  return text.trim() !== "" && Number.isFinite(value) && value >= low && value <= high ? value : undefined;
};
const choice = (...words) => (text) => (words.includes(text) ? text : undefined);
const toggle = (text) => ({ on: true, off: false })[text];
const several = (count) => (low, high) => (text) => {
  const values = text.split(",").map((word) => number(low, high)(word));
  return values.length === count && values.every((value) => value !== undefined) ? values : undefined;
};
const pair = several(2), three = several(3), four = several(4);

const plain = (digits) => (value) => String(Number(value.toFixed(digits)));
const switched = (value) => (value ? "on" : "off");
const both = (digits) => (value) => value.map(plain(digits)).join(",");

/** name: [default, reader of text (undefined where wrong), writer]; null defaults depend on the file. */
const FIELDS = {
  mode: [null, choice("picture", "raw", "depth", "volume"), String],
  focus: [null, number(-1e9, 1e9), plain(5)],
  tilt: [[0, 0], pair(-10, 10), both(5)],
  sharpen: [0, number(0, 3), plain(2)],
  denoise: [0, number(0, 1), plain(2)],
  aperture: [1, (text) => { const p = number(0.1, 100)(text.replace("%", "")); return p && p / 100; }, (v) => `${plain(1)(100 * v)}%`],
  shape: ["square", choice("square", "round"), String],
  view: [null, pair(-1e4, 1e4), both(2)],
  detail: [null, (text) => [1, 2, 4, 8].find((n) => String(n) === text), String],
  plane: [null, number(0, 1e6), plain(0)],
  projection: ["plane", choice("plane", "sections", "max-z", "max-y", "max-x", "brightest", "fog"), String],
  cross: [null, pair(0, 1e6), both(0)],
  trust: [0.1, number(0, 1), plain(2)],
  ev: [0, number(-12, 12), plain(2)],
  balance: [[1, 1, 1], three(1e-3, 1000), both(3)],
  black: [0, number(-2, 0.98), plain(3)],
  gamma: [1, number(0.2, 5), plain(2)],
  map: ["grey", choice(...MAPS), String],
  channel: ["colour", choice(...CHANNELS), String],
  lattice: [true, toggle, switched],
  epi: [false, toggle, switched],
  smooth: [true, toggle, switched],
  turn: [0, (text) => ({ 0: 0, 90: 1, 180: 2, 270: 3 })[text], (v) => String(90 * v)],
  sharp: [false, toggle, switched],
  drag: ["move", choice("move", ...TOOLS), String],
  ruler: [null, four(-1e6, 1e6), both(2)],
  region: [null, four(-1e6, 1e6), both(2)],
  orbit: [[30, 20], pair(-180, 180), both(1)],
  density: [30, number(0.1, 1000), plain(1)],
  at: [null, pair(-1e6, 1e6), both(2)],
  zoom: [1, number(0.05, 400), plain(3)],
  point: [null, pair(-1e6, 1e6), both(1)],
  renderer: ["auto", choice("auto", "stack", "canvas"), String],
};

export function defaults() {
  return Object.fromEntries(Object.entries(FIELDS).map(([name, [value]]) => [name, value]));
}

/** Settings that a link holds; what is unknown or wrong is left out. */
export function parseLink(hash) {
  const found = {};
  for (const part of hash.replace(/^#/, "").split("&")) {
    const [name, text = ""] = part.split("=");
    if (!Object.hasOwn(FIELDS, name)) continue;
    let value;
    try { value = FIELDS[name][1](decodeURIComponent(text)); } catch { continue; }
    if (value !== undefined) found[name] = value;
  }
  return found;
}

/** The part of a link after #, of what differs from `base`. */
export function linkOf(state, base) {
  const parts = [];
  for (const [name, [, , write]] of Object.entries(FIELDS)) {
    if (state[name] === null || state[name] === undefined) continue;
    const text = write(state[name]);
    if (base[name] !== null && base[name] !== undefined && write(base[name]) === text) continue;
    parts.push(`${name}=${encodeURIComponent(text).replaceAll("%2C", ",")}`);
  }
  return `#${parts.join("&")}`;
}
