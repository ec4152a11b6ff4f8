// A film as a file: every frame is drawn exactly, however long that takes, and encoded by the browser.

import { WIDEST } from "./models.js";
import { ROUNDS, moment } from "./play.js";
import { nameOf, pictureCanvas, saveBlob } from "./saving.js";
import { webm } from "./webm.js";

const RATE = 25, LEAST_BITS = 1e6; // frames a second, pixels, bits a second
const CODECS = { "vp09.00.41.08": "V_VP9", vp8: "V_VP8" };
const by = (id) => document.getElementById(id);

/** What can move in a mode: [film, words]. */
export function filmsOf(model, state) {
  if (state.mode === "picture") return [["pull", "Focus, there and back"], ...(model.views ? [["sway", "Viewpoint, once around"]] : [])];
  return state.mode === "volume" && model.spins(state) ? [["orbit", "Volume, once around"]] : [];
}

async function codecFor(size) {
  if (!globalThis.VideoEncoder) throw new Error("This browser cannot write films: it has no WebCodecs.");
  const bitrate = Math.max(LEAST_BITS, 4 * size.width * size.height), rest = { ...size, bitrate, framerate: RATE, latencyMode: "quality" };
  for (const codec of Object.keys(CODECS)) if ((await VideoEncoder.isConfigSupported({ codec, ...rest })).supported) return { codec, ...rest };
  throw new Error("This browser encodes neither VP9 nor VP8.");
}

/** Settings of every frame of a film. */
function frames(app, what, count) {
  const start = { ...app.state };
  return Array.from({ length: count }, (_, k) => ({ ...start, ...moment(what, app.main.model, start, k / count) }));
}

/** The film as a WebM file; `told` is called with the number of frames that are done. */
export async function film(app, what, seconds, told, signal) {
  const count = Math.round(seconds * RATE), states = frames(app, what, count), { model, device } = app.main, plan = model.filmPlan(states);
  const finer = plan && (await model.filmWindow(plan, device, signal));
  try {
    return await encoded(count, (k) => pictureCanvas(app, states[k], finer?.at(states[k])), told, signal);
  } finally {
    finer?.release();
  }
}

/** Frames as a WebM file. */
async function encoded(count, frameOf, told, signal) {
  const first = frameOf(0), shrink = Math.min(1, WIDEST / first.width), sheet = document.createElement("canvas");
  [sheet.width, sheet.height] = [first.width, first.height].map((n) => Math.max(2, 2 * Math.floor((n * shrink) / 2))); // encoders want even sizes: an odd one loses its last line
  const size = { width: sheet.width, height: sheet.height }, setting = await codecFor(size), coded = [];
  let wrong = null;
  const encoder = new VideoEncoder({ error: (error) => { wrong = error; }, output: (chunk) => {
    const data = new Uint8Array(chunk.byteLength);
    chunk.copyTo(data);
    coded.push({ data, key: chunk.type === "key", time: Math.round(chunk.timestamp / 1000) });
  } });
  try {
    encoder.configure(setting);
    for (let k = 0; k < count && !wrong; k++) {
      signal.throwIfAborted();
      sheet.getContext("2d").drawImage(k ? frameOf(k) : first, 0, 0, first.width * shrink, first.height * shrink);
      const frame = new VideoFrame(sheet, { timestamp: (k * 1e6) / RATE, duration: 1e6 / RATE });
      encoder.encode(frame, { keyFrame: k % RATE === 0 });
      frame.close();
      told(k + 1, count);
      do await new Promise((done) => setTimeout(done, 0)); while (encoder.encodeQueueSize > 4 && !wrong);
    }
    if (!wrong) await encoder.flush();
  } finally {
    if (encoder.state !== "closed") encoder.close();
  }
  if (wrong) throw wrong;
  return webm({ codec: CODECS[setting.codec], ...size, duration: (1000 * count) / RATE }, coded);
}

/** The dialog that asks for a film, shows how far it is, and stops it. */
export class FilmDialog {
  constructor(app) {
    this.app = app;
    by("film-seconds").addEventListener("input", () => this.length());
    by("film-what").addEventListener("change", () => { by("film-seconds").value = ROUNDS[by("film-what").value]; this.length(); this.size(); });
    by("film-start").addEventListener("click", () => this.save());
    by("film-stop").addEventListener("click", () => by("film").close());
    by("film").addEventListener("close", () => this.stop?.abort());
  }

  open() {
    const films = filmsOf(this.app.main.model, this.app.state);
    this.app.player.stop();
    by("film-what").replaceChildren(...films.map(([name, words]) => new Option(words, name)));
    by("film-seconds").value = ROUNDS[films[0][0]];
    this.length();
    this.size();
    this.show(false, "");
    by("film").showModal();
  }

  /** How large the film will be, and of a streamed file, how fine. */
  size() {
    const { model } = this.app.main, { width, height } = pictureCanvas(this.app, { ...this.app.state }, null), plan = model.filmPlan(frames(this.app, by("film-what").value, RATE));
    const times = plan ? model.factor / plan.step : 1, step = model.factor / times;
    by("film-size").textContent = `${times > 1 ? "About " : ""}${times * width} × ${times * height} px${step > 1 ? `: every ${step} samples of the file` : ""}.`;
  }

  length() {
    const seconds = Number(by("film-seconds").value);
    by("film-out").value = `${seconds} s, ${seconds * RATE} frames`;
    by("film-seconds").setAttribute("aria-valuetext", by("film-out").value);
  }

  show(busy, words) {
    for (const id of ["film-what", "film-seconds", "film-start"]) by(id).disabled = busy;
    by("film-progress").hidden = !busy;
    by("film-stop").textContent = busy ? "Cancel" : "Close";
    by("film-told").textContent = words;
  }

  async save() {
    const { app } = this, what = by("film-what").value;
    this.stop = new AbortController();
    this.show(true, "Drawing …");
    try {
      const blob = await film(app, what, Number(by("film-seconds").value), (done, count) => {
        by("film-progress").value = done / count;
        by("film-told").textContent = `Frame ${done} of ${count}`;
      }, this.stop.signal);
      saveBlob(app, blob, `${nameOf(app)}-${{ pull: "focus", sway: "parallax", orbit: "orbit" }[what]}.webm`);
      by("film").close();
    } catch (error) {
      this.show(false, error.name === "AbortError" ? "" : error.message);
    }
  }
}
