// One exhibit on the screen: its canvas, what is drawn over it, and the pointer.

import { alphaAt, freedom, keptViews, middleView, planeOf } from "./aperture.js";
import { CanvasDevice } from "./canvas.js";
import { openDevice } from "./device.js";
import { drawEpis } from "./epi.js";
import { sharpestAlpha, sharpestPlane } from "./focusing.js";
import { drawMeasures, regionText, samplesOf } from "./measures.js";
import { clearOverlay, depthTexts, lengthText, drawCross, drawLattice, drawMark, drawScaleBar } from "./overlay.js";
import { drawAxes } from "./rays.js";
import { drawSections, panelAt, samplesAt } from "./sections.js";
import { picked } from "./picking.js";
import { toneOf } from "./tone.js";
import { turned } from "./turning.js";

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
    this.model.turns = this.device.kind === "webgl";
    canvas.addEventListener("webglcontextlost", () => app.tell("The graphics processor was lost. Load the page again.", true));
  }

  /** Middle of what is seen, in samples of this exhibit: the link's, which counts in those of the first. */
  middle(base) {
    const { at } = this.app.state, first = this.app.panes[0].base ?? base;
    return at ? at.map((a, k) => (a * base[k]) / first[k]) : base.map((n) => (n - 1) / 2);
  }

  layout({ base, aspect, detail }) {
    const [ny, nx] = base, { width, height } = this.canvas, { zoom, turn } = this.app.state;
    const [wide, tall] = turned([nx, ny * aspect], turn).map(Math.abs), across = Math.min(width / wide, height / tall) * zoom;
    const scale = [across, across * aspect], [y, x] = this.middle(base), step = turned([x * scale[0], y * scale[1]], turn);
    const origin = [width / 2 - step[0], height / 2 - step[1]];
    Object.assign(this, { base, scale, origin, turn, aspect });
    return { origin, scale: scale.map((s) => s / detail), turn };
  }

  /** A place of the picture on the canvas. */
  onCanvas([y, x]) {
    const step = turned([x * this.scale[0], y * this.scale[1]], this.turn);
    return this.origin.map((o, k) => o + step[k]);
  }

  /** What of the picture is on the screen: its least and largest places [y, x]. */
  corners() {
    const { width, height } = this.canvas, found = [[0, 0], [width, height]].map(([x, y]) => this.toPicture(x / this.ratio, y / this.ratio));
    return [Math.min, Math.max].map((end) => [0, 1].map((k) => end(found[0][k], found[1][k])));
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
    if (!this.device && !image.early) return this.blank(); // a written page shows only its poster before it has a device
    if (this.device && !this.device.fits(image)) return this.app.tell(`${image.nx} × ${image.ny} pixels are too many for this graphics processor.`, true);
    const view = { ...this.layout(image), smooth: state.smooth && !image.sharp && this.scale[0] / image.detail < 24, ground: this.app.ground };
    this.tone = this.toneFor(state, image);
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

  /** Colours of a map stay as they are. */
  toneFor(state, image) {
    return image.plain ? { gain: 1 / 255, lift: 0, power: 1, map: "grey", channel: "colour" } : toneOf(state, image);
  }

  /** Over the picture, what is finer of it, in the part where that is exact. */
  drawFine(state, view, settled) {
    const { scale: [across, down], base } = this, [first, last] = this.corners();
    const low = first.map((n) => Math.max(0, n)), high = last.map((n, k) => Math.min(base[k] - 1, n));
    this.finest = this.model.fine(state, this.device, { low, high, scale: across }, settled);
    if (!this.finest) return;
    const { image, origin, factor } = this.finest, ends = [this.onCanvas(this.finest.low), this.onCanvas(this.finest.high)];
    const clip = [Math.min, Math.max].flatMap((end) => [0, 1].map((k) => end(ends[0][k], ends[1][k])));
    this.device.show(image, { ...view, origin: this.onCanvas(origin), scale: [across * factor, down * factor], clip }, toneOf(state, image));
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
    const lattice = this.model.about.raw?.lattice, drawn = image.unit || state.ruler || state.region || (state.mode === "raw" ? lattice && state.lattice : state.point) || this.root.classList.contains("epi");
    this.overlay.hidden = !drawn;
    this.tellPlace(image);
    const label = this.describe(state);
    if (label !== this.label) this.stage.setAttribute("aria-label", (this.label = label));
    if (!drawn) return;
    const context = clearOverlay(this.overlay, this.ratio), size = { width: this.overlay.width / this.ratio, height: this.overlay.height / this.ratio };
    if (state.mode === "raw" && lattice && state.lattice) {
      const [[top, left], [bottom, right]] = this.corners();
      drawLattice(context, lattice, { ...size, scale: this.scale[0] / this.ratio, turn: state.turn, toScreen: (y, x) => this.toScreen(y, x), bounds: { top, left, bottom, right }, picture: image.base });
    }
    const place = this.hover ?? state.point ?? image.base.map((n) => (n - 1) / 2);
    if (this.root.classList.contains("epi") && this.model.complete) {
      drawCross(context, this.toScreen(...place), size, this.app.line);
      drawEpis(this.strips, this.model, state, place, { origin: this.origin, scale: this.scale, turn: state.turn, ratio: this.ratio, tone: this.tone, colour: this.app.line });
    }
    if (state.point && state.mode !== "raw" && state.mode !== "volume") drawMark(context, this.toScreen(...state.point));
    drawMeasures(context, state, (y, x) => this.toScreen(y, x), image.unit, image.aspect, this.model.samples(state));
    if (image.sections) this.drawCross(context, image, (y, x) => this.toScreen(y, x));
    if (image.rays) drawAxes(context, state.orbit, (step) => turned(step, state.turn), size.height);
    if (image.unit) drawScaleBar(context, image.unit / (this.scale[0] / this.ratio), size);
  }

  /** Where sections cross, on the screen or in what is saved. */
  drawCross(context, { sections: { layout, cross } }, place) {
    const { ground, line, state } = this.app;
    drawSections(context, layout, cross, state.turn, place, { ground: `rgb(${ground.map((x) => 255 * x).join(" ")})`, line });
  }

  /** Sections cross at a place of one of them. */
  cut(place, from = place) {
    const { layout, cross } = this.image.sections, panel = panelAt(layout, from);
    if (!panel) return;
    const [plane, ...rest] = samplesAt(layout, panel, place, cross);
    this.app.set({ plane, cross: rest });
  }

  /** Where a place of a section is in the volume. */
  placeText({ sections: { layout, cross } }, place) {
    const panel = panelAt(layout, place);
    if (!panel) return "";
    const found = this.model.placeOf(samplesAt(layout, panel, place, cross));
    return [2, 1, 0].map((k) => `${"zyx"[k]} ${lengthText(found[k])}`).join("  ");
  }

  describe(state) {
    const what = { picture: `picture focused on ${state.focus.toFixed(3)}`, raw: "raw image", depth: "depth map", volume: "volume" }[state.mode];
    return `${this.model.about.name}: ${what}. ${this.readout.textContent}`;
  }

  /** Position and value under the pointer. */
  tellPlace(image) {
    if (!this.hover) { if (this.readout.textContent) this.readout.textContent = ""; return; }
    const [y, x] = this.hover, { factor, word } = this.model.samples(this.app.state), parts = image.rays ? [] : image.sections ? [this.placeText(image, this.hover)] : [`y ${(factor * y).toFixed(1)}  x ${(factor * x).toFixed(1)} ${word}`];
    const row = Math.round(y * image.detail), column = Math.round(x * image.detail);
    if (row < 0 || column < 0 || row >= image.ny || column >= image.nx || parts[0] === "") { this.readout.textContent = ""; return; }
    if (this.app.state.mode === "depth") {
      const found = this.model.depthAt(y, x);
      if (found) parts.push(...depthTexts(this.model.about.depth, found, this.model.depthSpan()));
    } else {
      const start = (row * image.nx + column) * image.channels;
      const numbers = image.texture ? this.device.sample(image, column, row) : image.numbers.subarray(start, start + image.channels);
      const values = Array.from(numbers).slice(0, image.channels).map((n) => Number((image.offset + image.scale * n).toPrecision(4)));
      parts.push(`value ${values.join(", ")}`);
    }
    this.readout.textContent = parts.join("  ·  ");
  }

  toScreen(y, x) {
    return this.onCanvas([y, x]).map((at) => at / this.ratio);
  }

  toPicture(left, top) {
    const [x, y] = turned([left * this.ratio - this.origin[0], top * this.ratio - this.origin[1]], -this.turn);
    return [y / this.scale[1], x / this.scale[0]];
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

  /** Turns a volume by a movement [CSS px]: what is in front follows. */
  orbit(dx, dy) {
    const { orbit: [yaw, pitch], turn } = this.app.state, [x, y] = turned([dx, dy], -turn);
    this.app.set({ orbit: [((((yaw + 0.5 * x + 180) % 360) + 360) % 360) - 180, Math.min(90, Math.max(-90, pitch + 0.5 * y))] });
  }

  /** A click with a tool sets one end, then the other. */
  mark(place) {
    const { drag } = this.app.state;
    this.app.set({ [drag]: this.marked ? [...this.marked, ...place] : [...place, ...place] });
    this.marked = this.marked ? null : place;
  }

  /** Makes a place grey, or as bright as middle grey. */
  pick(what, place) {
    const found = picked(this, what, place);
    if (found) this.app.set(found);
    else this.app.tell("There is too little light, or no colour, to set that by.");
  }

  click(place) {
    const { picking } = this.app;
    if (picking) { this.app.pickBy(null); this.pick(picking, place); return; }
    if (this.app.state.drag !== "move") { this.mark(place); return; }
    if (this.image?.sections) { this.cut(place); return; }
    if (this.app.state.sharp) { this.app.tell("Everything is in focus. Uncheck “All in focus” to choose."); return; }
    const focus = this.focusAt(place);
    if (focus === null) return;
    const { views } = this.model, leaning = views ? alphaAt(planeOf(views, 0, this.app.state.tilt), place) : 0; // the plane goes through the place and leans as before
    this.app.set({ focus: focus - leaning, point: place });
  }

  zoomAt([left, top], factor, moved = [0, 0]) {
    if (!this.base) return;
    const { state } = this.app, place = this.toPicture(left, top), zoom = Math.min(400, Math.max(0.25, state.zoom * factor));
    const grown = this.scale.map((s) => (s * zoom) / state.zoom), { width, height } = this.canvas;
    const step = turned([(left + moved[0]) * this.ratio - width / 2, (top + moved[1]) * this.ratio - height / 2], -this.turn);
    const at = [place[0] - step[1] / grown[1], place[1] - step[0] / grown[0]];
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
    const range = freedom(views, aperture), view = middleView(views, aperture, state.view), step = turned([dx, dy], -state.turn);
    const moved = [step[1], step[0]].map((d, k) => Math.min(range[k][1], Math.max(range[k][0], view[k] + 1.4 * d * views.shape[k])));
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
      if (pointer && !pointer.moved && event.button === 0 && this.base) this.click(this.toPicture(...this.inStage(event)));
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
    const { state } = this.app, plain = !event.shiftKey && event.buttons !== 4;
    if (this.pointers.size === 2) this.pinch(event.pointerId, here);
    else if (state.drag !== "move" && plain && this.base) this.app.set({ [state.drag]: [...this.toPicture(...pointer.start), ...this.hover] });
    else if (state.mode === "volume" && this.model.spins(state) && plain) this.orbit(...step);
    else if (this.image?.sections && plain) this.cut(this.hover, this.toPicture(...pointer.start));
    else if (this.model.views && state.mode === "picture" && plain) {
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

  /** What a region of the picture holds; of several channels, their mean. */
  regionText({ region, mode, trust }) {
    const { image, model } = this, found = region && image && samplesOf(mode === "depth" || !image ? region : region.map((x) => x * image.detail), mode === "depth" ? image.base : [image.ny, image.nx]);
    if (!found) return "";
    const { rows: [top, bottom], columns: [left, right] } = found, wide = right - left + 1, values = [];
    const { depth, confidence } = model.arrays, { channels } = image;
    const numbers = image.texture ? this.device.sample(image, left, top, wide, bottom - top + 1) : null;
    for (let y = top; y <= bottom; y++) for (let x = left; x <= right; x++) {
      const at = y * image.nx + x, own = numbers ? 4 * ((y - top) * wide + x - left) : at * channels, from = numbers ?? image.numbers;
      if (mode !== "depth") { let sum = 0; for (let c = 0; c < channels; c++) sum += from[own + c]; values.push(image.offset + (image.scale * sum) / channels); }
      else if (confidence.numbers[at] >= 255 * trust) values.push(depth.offset + depth.scale * depth.numbers[at]);
    }
    return `${wide} × ${bottom - top + 1} px: ${regionText(values)}`;
  }

  /** The picture that settings ask for in its own size: bytes, and where places of the exhibit lie in it. */
  pixels(state = this.app.state, finest = state === this.app.state ? this.finest : null) {
    if (finest) return this.finePixels(finest);
    const image = this.model.image(state, this.device, true);
    if (!image) return image;
    const { nx: width, ny: height, aspect, unit, detail } = image, place = Object.assign((y, x) => [y * detail, x * detail], { step: detail });
    const over = image.sections && ((context, where) => this.drawCross(context, image, where));
    return { width, height, data: this.device.pixels(image, this.toneFor(state, image)), aspect, unit: unit && unit / detail, place, samples: this.model.samples(state), over };
  }

  /** What is finer than the picture in its own size, cut to where it is exact. */
  finePixels({ image, origin, factor, low, high }) {
    const { aspect, unit } = this.image, start = low.map((l, k) => Math.max(0, Math.ceil((l - origin[k]) / factor)));
    const [height, width] = high.map((h, k) => Math.min(k ? image.nx : image.ny, Math.floor((h - origin[k]) / factor) + 1) - start[k]);
    const whole = new ImageData(this.device.pixels(image, toneOf(this.app.state, image)), image.nx, image.ny), sheet = new OffscreenCanvas(image.nx, image.ny).getContext("2d");
    sheet.putImageData(whole, 0, 0);
    const place = Object.assign((y, x) => [y, x].map((n, k) => (n - origin[k]) / factor - start[k]), { step: 1 / factor });
    return { width, height, data: sheet.getImageData(start[1], start[0], width, height).data, aspect, unit: unit && unit * factor, place, samples: this.model.samples(this.app.state) };
  }

  /** How many views are kept (v, u). */
  kept() {
    return this.model.views ? keptViews(this.model.views, this.app.state.aperture) : null;
  }
}

