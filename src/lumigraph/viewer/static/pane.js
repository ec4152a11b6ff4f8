// One exhibit on the screen: its canvas, what is drawn over it, and the pointer.

import { freedom, keptViews, middleView } from "./aperture.js";
import { CanvasDevice } from "./canvas.js";
import { openDevice } from "./device.js";
import { drawEpis } from "./epi.js";
import { sharpestAlpha, sharpestPlane } from "./focusing.js";
import { clearOverlay, depthTexts, drawCross, drawLattice, drawMark, drawScaleBar } from "./overlay.js";
import { toneOf } from "./tone.js";

const STILL = 4; // CSS px that a click may move
const SETTLED = 250; // ms without a change, after which a slow machine draws the exact picture
const MOST_PIXELS = 4e6;
const HEAVY = 12, FEWER_PIXELS = 2.4e5; // ms for one picture on the screen, above which those of a movement are coarser

export class Pane {
  constructor(root, model, app) {
    Object.assign(this, { model, app, root, pointers: new Map(), hover: null });
    root.className = "pane";
    root.innerHTML = `<div class="stage" tabindex="0" role="img"><canvas></canvas><canvas hidden></canvas><canvas></canvas><div class="name"></div><div class="readout"></div></div>
      <canvas class="strip right" aria-label="Epipolar-plane image along the column"></canvas>
      <canvas class="strip bottom" aria-label="Epipolar-plane image along the row"></canvas>`;
    this.stage = root.querySelector(".stage");
    [this.canvas, this.quick, this.overlay] = this.stage.querySelectorAll("canvas");
    this.strips = { right: root.querySelector(".right"), bottom: root.querySelector(".bottom") };
    this.name = root.querySelector(".name");
    this.readout = root.querySelector(".readout");
    this.name.textContent = model.about.name;
    this.listen();
    new ResizeObserver(() => app.schedule()).observe(this.stage);
  }

  /** Asks for the graphics processor, which takes its time where it is software: the first picture does without. */
  open() {
    const { app, canvas } = this;
    this.device = (app.state.renderer === "canvas" ? null : openDevice(canvas)) ?? new CanvasDevice(canvas);
    canvas.addEventListener("webglcontextlost", () => app.tell("The graphics processor was lost. Load the page again.", true));
  }

  /** Middle of what is seen, in samples of this exhibit: the link's, which counts in those of the first. */
  middle(base) {
    const { at } = this.app.state, first = this.app.panes[0].base ?? base;
    return at ? at.map((a, k) => (a * base[k]) / first[k]) : base.map((n) => (n - 1) / 2);
  }

  layout({ base, aspect, detail }) {
    const [ny, nx] = base, { width, height } = this.canvas;
    const fit = Math.min(width / nx, height / (ny * aspect)), across = fit * this.app.state.zoom;
    const scale = [across, across * aspect], [y, x] = this.middle(base);
    const origin = [width / 2 - x * scale[0], height / 2 - y * scale[1]];
    Object.assign(this, { base, scale, origin });
    return { origin, scale: scale.map((s) => s / detail) };
  }

  draw(now) {
    const { state } = this.app, box = this.stage.getBoundingClientRect();
    this.root.classList.toggle("epi", Boolean(state.epi && state.mode === "picture" && this.model.views));
    this.stage.classList.toggle("grab", state.mode === "raw" || state.mode === "volume");
    const settled = !this.app.moving && now - this.app.changedAt > SETTLED && !this.pointers.size, most = this.heavy && !settled ? FEWER_PIXELS : MOST_PIXELS;
    this.ratio = Math.min(window.devicePixelRatio, 2, Math.sqrt(most / Math.max(box.width * box.height, 1)));
    for (const canvas of [this.canvas, this.quick, this.overlay]) {
      const size = [box.width, box.height].map((n) => Math.max(1, Math.round(n * this.ratio)));
      if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width, canvas.height] = size;
    }
    const image = this.model.image(state, this.device, settled);
    if (!image) return this.blank();
    if (this.device && !this.device.fits(image)) return this.app.tell(`${image.nx} × ${image.ny} pixels are too many for this graphics processor.`, true);
    const view = { ...this.layout(image), smooth: state.smooth && !image.sharp && this.scale[0] / image.detail < 24, ground: this.app.ground };
    this.tone = image.plain ? { gain: 1 / 255, lift: 0, power: 1, map: "grey", channel: "colour" } : toneOf(state, image);
    const device = this.deviceFor(image, settled);
    device.show(image, view, this.tone);
    if (device === this.device) {
      this.drawFine(state, view, settled);
      if (this.image && this.heavy === undefined) this.weigh(image, view);
    }
    this.image = image;
    this.over(state, image);
    if ((this.heavy || (this.model.slow && !image.exact) || this.model.factor > 1) && !settled) setTimeout(() => this.app.schedule(), SETTLED + 20);
    return true;
  }

  /** Over the picture, what is finer of it, in the part where that is exact. */
  drawFine(state, view, settled) {
    const { origin: [left, top], scale: [across, down], canvas: { width, height }, base: [ny, nx] } = this;
    const place = ([y, x]) => [left + x * across, top + y * down];
    const low = [Math.max(0, -top / down), Math.max(0, -left / across)], high = [Math.min(ny - 1, (height - top) / down), Math.min(nx - 1, (width - left) / across)];
    this.finest = this.model.fine(state, this.device, { low, high, scale: across }, settled);
    if (!this.finest) return;
    const { image, origin, factor } = this.finest, clip = [...place(this.finest.low), ...place(this.finest.high)];
    this.device.show(image, { ...view, origin: place(origin), scale: [across * factor, down * factor], clip }, toneOf(state, image));
  }

  /** Where WebGL is software, the browser's own canvas shows the planes of a stack twice as fast; and the first picture. */
  deviceFor(image, settled) {
    const quick = Boolean(image.early || (this.heavy && !settled && image.numbers && this.device.kind === "webgl"));
    this.quick.hidden = !quick;
    this.canvas.hidden = quick;
    return quick ? (this.quickDevice ??= new CanvasDevice(this.quick)) : this.device;
  }

  /** Whether pictures reach the screen too slowly for a movement. */
  weigh(image, view) {
    if (this.model.slow) { this.heavy = true; return; } // no need to wait for what is being drawn
    this.device.finish();
    const start = performance.now();
    this.device.show(image, view, this.tone);
    this.device.finish();
    this.heavy = performance.now() - start > HEAVY;
  }

  blank() {
    if (!this.device) return false;
    const { gl, context } = this.device, g = this.app.ground;
    if (gl) { gl.bindFramebuffer(gl.FRAMEBUFFER, null); gl.clearColor(...g, 1); gl.clear(gl.COLOR_BUFFER_BIT); }
    else { context.fillStyle = `rgb(${g.map((x) => 255 * x).join(" ")})`; context.fillRect(0, 0, this.canvas.width, this.canvas.height); }
    clearOverlay(this.overlay, 1);
    return false;
  }

  over(state, image) {
    const lattice = this.model.about.raw?.lattice, drawn = image.unit || (state.mode === "raw" ? lattice && state.lattice : state.point) || this.root.classList.contains("epi");
    this.overlay.hidden = !drawn;
    this.tellPlace(image);
    const label = this.describe(state);
    if (label !== this.label) this.stage.setAttribute("aria-label", (this.label = label));
    if (!drawn) return;
    const context = clearOverlay(this.overlay, this.ratio), size = { width: this.overlay.width / this.ratio, height: this.overlay.height / this.ratio };
    if (state.mode === "raw" && lattice && state.lattice) {
      const [top, left] = this.toPicture(0, 0), [bottom, right] = this.toPicture(size.width, size.height);
      drawLattice(context, lattice, { ...size, scale: this.scale[0] / this.ratio, toScreen: (y, x) => this.toScreen(y, x), bounds: { top, left, bottom, right }, picture: image.base });
    }
    const place = this.hover ?? state.point ?? image.base.map((n) => (n - 1) / 2);
    if (this.root.classList.contains("epi") && this.model.complete) {
      drawCross(context, this.toScreen(...place), size, this.app.line);
      drawEpis(this.strips, this.model, state, place, { origin: this.origin, scale: this.scale, ratio: this.ratio, tone: this.tone, colour: this.app.line });
    }
    if (state.point && state.mode !== "raw" && state.mode !== "volume") drawMark(context, this.toScreen(...state.point));
    if (image.unit) drawScaleBar(context, image.unit / (this.scale[0] / this.ratio), size);
  }

  describe(state) {
    const what = { picture: `picture focused on ${state.focus.toFixed(3)}`, raw: "raw image", depth: "depth map", volume: "volume" }[state.mode];
    return `${this.model.about.name}: ${what}. ${this.readout.textContent}`;
  }

  /** Position and value under the pointer. */
  tellPlace(image) {
    if (!this.hover) { if (this.readout.textContent) this.readout.textContent = ""; return; }
    const [y, x] = this.hover, { factor } = this.model, parts = [`y ${(factor * y).toFixed(1)}  x ${(factor * x).toFixed(1)} px`];
    const row = Math.round(y * image.detail), column = Math.round(x * image.detail);
    if (row < 0 || column < 0 || row >= image.ny || column >= image.nx) { this.readout.textContent = ""; return; }
    if (this.app.state.mode === "depth") {
      const found = this.model.depthAt(y, x);
      if (found) parts.push(...depthTexts(this.model.about.depth, found));
    } else {
      const start = (row * image.nx + column) * image.channels;
      const numbers = image.texture ? this.device.sample(image, column, row) : image.numbers.subarray(start, start + image.channels);
      const values = Array.from(numbers).slice(0, image.channels).map((n) => Number((image.offset + image.scale * n).toPrecision(4)));
      parts.push(`value ${values.join(", ")}`);
    }
    this.readout.textContent = parts.join("  ·  ");
  }

  toScreen(y, x) {
    return [(this.origin[0] + x * this.scale[0]) / this.ratio, (this.origin[1] + y * this.scale[1]) / this.ratio];
  }

  toPicture(left, top) {
    return [(top * this.ratio - this.origin[1]) / this.scale[1], (left * this.ratio - this.origin[0]) / this.scale[0]];
  }

  inStage(event) {
    const box = this.stage.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  /** Focus that makes a place sharp; null where nothing says so. */
  focusAt([y, x]) {
    const { model, app: { state } } = this, base = this.base;
    if (!base || y < -0.5 || x < -0.5 || y > base[0] - 0.5 || x > base[1] - 0.5) return null;
    const place = [Math.round(y), Math.round(x)];
    if (state.mode === "depth") return model.depthAt(y, x)?.value ?? null;
    if (state.mode !== "picture") return null;
    if (model.views) return model.complete ? sharpestAlpha(model.views, model.views.numbers, place) : null;
    const array = model.arrays.stack;
    if (!array) return null;
    const [count, ny, nx] = array.shape;
    return sharpestPlane({ nx, ny, count, channels: array.shape[3] ?? 1, numbers: array.numbers, positions: model.about.stack.positions }, place);
  }

  click(place) {
    const focus = this.focusAt(place);
    if (focus !== null) this.app.set({ focus, point: place });
  }

  zoomAt([left, top], factor, moved = [0, 0]) {
    if (!this.base) return;
    const { state } = this.app, place = this.toPicture(left, top), zoom = Math.min(400, Math.max(0.25, state.zoom * factor));
    const grown = this.scale.map((s) => (s * zoom) / state.zoom), { width, height } = this.canvas;
    const at = [
      place[0] - ((top + moved[1]) * this.ratio - height / 2) / grown[1], place[1] - ((left + moved[0]) * this.ratio - width / 2) / grown[0],
    ];
    const first = this.app.panes[0].base;
    this.app.set({ zoom, at: zoom === 1 && factor < 1 ? null : at.map((a, k) => (a * first[k]) / this.base[k]) });
  }

  /** Moves the viewpoint by a part of the stage; an aperture that has no room is closed to one view first. */
  moveView(dx, dy) {
    const { views } = this.model, { state, set } = this.app;
    let { aperture } = state;
    if (freedom(views, aperture).every(([low, high]) => low === high)) {
      aperture = 0.001;
      this.app.tell("Aperture closed to one view: drag moves the viewpoint. “Full” opens it again.");
    }
    const range = freedom(views, aperture), view = middleView(views, aperture, state.view);
    const moved = [dy, dx].map((d, k) => Math.min(range[k][1], Math.max(range[k][0], view[k] + 1.4 * d * views.shape[k])));
    set({ aperture, view: moved });
  }

  listen() {
    const { stage, pointers } = this;
    stage.addEventListener("pointerdown", (event) => {
      stage.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, { last: this.inStage(event), start: this.inStage(event), moved: pointers.size > 0 });
      for (const other of pointers.values()) if (pointers.size > 1) other.moved = true;
    });
    stage.addEventListener("pointermove", (event) => this.move(event));
    stage.addEventListener("pointerup", (event) => {
      const pointer = pointers.get(event.pointerId);
      pointers.delete(event.pointerId);
      stage.classList.remove("held");
      if (pointer && !pointer.moved && event.button === 0) this.click(this.toPicture(...this.inStage(event)));
      else this.app.touched();
    });
    stage.addEventListener("pointercancel", (event) => { pointers.delete(event.pointerId); stage.classList.remove("held"); });
    stage.addEventListener("pointerleave", () => { if (!this.app.state.epi) this.hover = null; this.app.schedule(); });
    stage.addEventListener("wheel", (event) => {
      event.preventDefault();
      const step = event.deltaY * (event.deltaMode === 1 ? 16 : 1);
      this.zoomAt(this.inStage(event), Math.exp(-Math.max(-240, Math.min(240, step)) * 0.0022));
    }, { passive: false });
    stage.addEventListener("dblclick", (event) => event.preventDefault());
  }

  move(event) {
    const here = this.inStage(event), pointer = this.pointers.get(event.pointerId);
    if (this.base) this.hover = this.toPicture(...here);
    if (!pointer) { this.app.schedule(); return; }
    const step = here.map((h, k) => h - pointer.last[k]);
    if (Math.hypot(...here.map((h, k) => h - pointer.start[k])) > STILL) pointer.moved = true;
    if (!pointer.moved) return;
    this.stage.classList.add("held");
    if (this.pointers.size === 2) this.pinch(event.pointerId, here);
    else if (this.model.views && this.app.state.mode === "picture" && !event.shiftKey && event.buttons !== 4) {
      const box = this.stage.getBoundingClientRect();
      this.moveView(step[0] / box.width, step[1] / box.height);
    } else this.zoomAt(pointer.last, 1, step);
    pointer.last = here;
  }

  pinch(id, here) {
    const [other] = [...this.pointers].filter(([key]) => key !== id).map(([, pointer]) => pointer.last), { last } = this.pointers.get(id);
    const middle = (a) => a.map((x, k) => (x + other[k]) / 2), far = (a) => Math.max(8, Math.hypot(a[0] - other[0], a[1] - other[1]));
    const before = middle(last), after = middle(here);
    this.zoomAt(before, far(here) / far(last), after.map((x, k) => x - before[k]));
  }

  /** The picture in its own size, as bytes. */
  pixels() {
    if (this.finest) return this.finePixels(this.finest);
    const image = this.model.image(this.app.state, this.device, true);
    return image && { width: image.nx, height: image.ny, data: this.device.pixels(image, this.tone ?? toneOf(this.app.state, image)), aspect: image.aspect, unit: image.unit && image.unit / image.detail };
  }

  /** What is finer than the picture in its own size, cut to where it is exact. */
  finePixels({ image, origin, factor, low, high }) {
    const { aspect, unit } = this.image, start = low.map((l, k) => Math.max(0, Math.ceil((l - origin[k]) / factor)));
    const [height, width] = high.map((h, k) => Math.min(k ? image.nx : image.ny, Math.floor((h - origin[k]) / factor) + 1) - start[k]);
    const whole = new ImageData(this.device.pixels(image, toneOf(this.app.state, image)), image.nx, image.ny), sheet = new OffscreenCanvas(image.nx, image.ny).getContext("2d");
    sheet.putImageData(whole, 0, 0);
    return { width, height, data: sheet.getImageData(start[1], start[0], width, height).data, aspect, unit: unit && unit * factor };
  }

  /** How many views are kept (v, u). */
  kept() {
    return this.model.views ? keptViews(this.model.views, this.app.state.aperture) : null;
  }
}

