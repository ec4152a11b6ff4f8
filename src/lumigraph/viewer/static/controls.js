// The controls beside the picture, and what they say.

import { freedom, keptViews, middleView, tiltLimits, viewShifts } from "./aperture.js";
import { MAPS } from "./colours.js";
import { Histogram } from "./histogram.js";
import { depthMap } from "./models.js";
import { canQuilt } from "./quilt.js";
import { filmsOf } from "./film.js";
import { rulerText } from "./measures.js";
import { depthText, lengthText, signed } from "./overlay.js";
import { turned } from "./turning.js";
import { cachedMap } from "./tone.js";

const by = (id) => document.getElementById(id);
const SELECTS = { shape: String, drag: String, detail: Number, projection: String, map: String, channel: String };
const RANGES = ["focus", "trust", "plane", "density", "ev", "black", "gamma", "sharpen", "denoise"];
const TILTS = ["tilt-down", "tilt-across"];
const CHECKS = ["epi", "lattice", "smooth", "sharp"];

/** Writes into an output only what is new: the browser lays a page out afresh after every write. */
function tell(id, text) {
  const output = by(id), name = output.tagName === "OUTPUT" ? "value" : "textContent";
  if (output[name] !== text) output[name] = text;
}

export class Controls {
  constructor(app) {
    this.app = app;
    for (const name of MAPS) by("map").append(new Option(name[0].toUpperCase() + name.slice(1), name));
    for (const id of RANGES) by(id).addEventListener("input", (e) => app.set({ [id]: id === "density" ? 10 ** Number(e.target.value) : Number(e.target.value) }));
    TILTS.forEach((id, k) => by(id).addEventListener("input", (e) => app.set({ tilt: app.state.tilt.map((t, i) => (i === k ? Number(e.target.value) : t)) })));
    ["cross-y", "cross-x"].forEach((id, k) => by(id).addEventListener("input", (e) => {
      const [, ...cross] = app.volumeModel.cross(app.state);
      cross[k] = Number(e.target.value);
      app.set({ cross });
    }));
    for (const [id, read] of Object.entries(SELECTS)) by(id).addEventListener("change", (e) => app.set({ [id]: read(e.target.value) }));
    for (const id of CHECKS) by(id).addEventListener("change", (e) => app.set({ [id]: e.target.checked }));
    by("aperture").addEventListener("input", (e) => app.set({ aperture: Math.max(0.001, Number(e.target.value) / 100) }));
    by("open").addEventListener("click", () => app.set({ aperture: 1, view: null }));
    by("clear").addEventListener("click", () => app.set({ ruler: null, region: null }));
    by("close").addEventListener("click", () => app.set({ aperture: 0.001 }));
    for (const button of by("modes").children) button.addEventListener("click", () => app.set({ mode: button.dataset.mode }));
    by("modes").addEventListener("keydown", (event) => this.walk(event));
    this.histogram = new Histogram(by("histogram"));
    this.pad();
  }

  /** Arrow keys inside the row of modes, as radio buttons have them. */
  walk(event) {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const shown = [...by("modes").children].filter((button) => !button.hidden);
    const next = shown[(shown.indexOf(document.activeElement) + step + shown.length) % shown.length];
    event.preventDefault(); event.stopPropagation();
    next.focus(); next.click();
  }

  /** The aperture in small: drag in it to move the viewpoint. */
  pad() {
    const pad = by("pad"), move = (event) => {
      if (!event.buttons) return;
      const { views } = this.app.main.model, box = pad.getBoundingClientRect();
      const off = turned([(event.clientX - box.left) / box.width - 0.5, (event.clientY - box.top) / box.height - 0.5], -this.app.state.turn);
      const place = [off[1] + 0.5, off[0] + 0.5];
      const aperture = freedom(views, this.app.state.aperture).every(([low, high]) => low === high) ? 0.001 : this.app.state.aperture;
      const range = freedom(views, aperture), even = keptViews(views, aperture).map((k) => (k % 2 ? 0 : 0.5));
      this.app.set({ aperture, view: place.map((p, k) => Math.min(range[k][1], Math.max(range[k][0], p * views.shape[k] - 0.5 + even[k]))) });
    };
    pad.addEventListener("pointerdown", (event) => { pad.setPointerCapture(event.pointerId); move(event); });
    pad.addEventListener("pointermove", move);
  }

  drawPad() {
    const key = JSON.stringify([this.app.state.aperture, this.app.state.view, this.app.state.shape, this.app.state.turn, this.app.line, devicePixelRatio]);
    if (key === this.padKey) return;
    this.padKey = key;
    const { views } = this.app.main.model, { state } = this.app, pad = by("pad"), ratio = Math.min(devicePixelRatio, 2), side = 120 * ratio;
    if (pad.width !== side) pad.width = pad.height = side;
    const context = pad.getContext("2d"), [nv, nu] = views.shape, kept = keptViews(views, state.aperture), middle = middleView(views, state.aperture, state.view);
    const style = getComputedStyle(document.documentElement), cell = [side / nv, side / nu];
    context.clearRect(0, 0, side, side);
    context.translate(side / 2, side / 2); context.rotate((state.turn * Math.PI) / 2); context.translate(-side / 2, -side / 2);
    context.fillStyle = style.getPropertyValue("--soft");
    context.globalAlpha = 0.45;
    const step = Math.max(1, Math.ceil(Math.max(nv, nu) / 24));
    for (let v = 0; v < nv; v += step) for (let u = 0; u < nu; u += step) {
      if (views.lit[v * nu + u] !== "1") continue;
      context.beginPath(); context.arc((u + 0.5) * cell[1], (v + 0.5) * cell[0], 1.6 * ratio, 0, 7); context.fill();
    }
    const [top, left] = middle.map((m, k) => (m - Math.floor(kept[k] / 2)) * cell[k]), size = kept.map((k, i) => k * cell[i]);
    context.fillStyle = context.strokeStyle = style.getPropertyValue("--mark");
    context.lineWidth = 2 * ratio;
    context.beginPath();
    if (state.shape === "round") context.ellipse(left + size[1] / 2, top + size[0] / 2, size[1] / 2, size[0] / 2, 0, 0, 7);
    else context.rect(left, top, size[1], size[0]);
    context.globalAlpha = 0.28; context.fill();
    context.globalAlpha = 1; context.stroke();
    context.resetTransform();
    const text = `view ${middle.map((m) => m.toFixed(1)).join(", ")} of ${nv} × ${nu}`;
    pad.setAttribute("aria-valuetext", text);
    pad.setAttribute("aria-valuenow", String(Math.round(middle[1])));
    pad.setAttribute("aria-valuemax", String(nu - 1));
    const baseline = views.aperture.pitch[1];
    const off = middle.map((m, k) => (m - Math.floor(views.shape[k] / 2)) * views.aperture.pitch[k]);
    const place = views.metric ? ` (y ${lengthText(off[0])}, x ${lengthText(off[1])})` : "";
    tell("view-out", `Viewpoint ${text}${place}.${baseline ? " Drag the picture, or here." : ""}`);
  }

  refresh() {
    const { state, main: { model } } = this.app, { about } = model;
    for (const button of by("modes").children) {
      const mode = button.dataset.mode, there = this.app.panes.some((pane) => pane.model.modes[mode]);
      button.hidden = !there;
      button.setAttribute("aria-checked", String(state.mode === mode));
      button.tabIndex = state.mode === mode ? 0 : -1;
    }
    by("modes").hidden = [...by("modes").children].filter((button) => !button.hidden).length < 2;
    for (const group of document.querySelectorAll("[data-modes]")) group.hidden = !group.dataset.modes.includes(state.mode);
    for (const id of ["sway", "orbit"]) by(id).hidden = false;
    by("save-film").hidden = !filmsOf(model, state).length;
    for (const part of document.querySelectorAll('[data-part="sharp"]')) part.hidden = !about.sharp;
    by("quilt").hidden = state.mode !== "picture" || !canQuilt(model);
    for (const part of document.querySelectorAll('[data-part="views"]')) part.hidden ||= !model.views;
    for (const part of document.querySelectorAll('[data-part="map"]')) part.hidden = !about.depth;
    for (const part of document.querySelectorAll('[data-part="lattice"]')) part.hidden = !about.raw?.lattice;
    this.focus(model, state);
    if (model.views) { this.aperture(model, state); this.finish(model, state); }
    if (this.app.volumeModel) this.volume(this.app.volumeModel.about.volume, state);
    if (state.mode === "depth") this.depth(model, state);
    this.measures(state);
    const channels = this.app.main.image?.plain ? 3 : this.app.main.image?.channels ?? 1;
    document.querySelector('[data-colour="channel"]').hidden = channels !== 3 || state.mode === "depth";
    document.querySelector('[data-colour="map"]').hidden = channels === 3 && state.channel === "colour" && state.mode !== "depth";
    for (const part of document.querySelectorAll("[data-light]")) part.hidden = state.mode === "depth";
    if (state.mode !== "depth") this.histogram.draw(model, state, this.app.main.image);
    for (const id of ["ev", "black", "gamma"]) by(id).value = state[id];
    tell("ev-out", `${state.ev > 0 ? "+" : ""}${state.ev.toFixed(2)} EV`);
    by("pick-grey").hidden = channels !== 3;
    for (const what of ["grey", "exposure"]) by(`pick-${what}`).setAttribute("aria-pressed", String(this.app.picking === what));
    tell("black-out", `${Math.round(100 * state.black)} %`);
    tell("gamma-out", state.gamma.toFixed(2));
    for (const id of ["shape", "projection", "channel", "drag"]) by(id).value = state[id];
    by("map").value = state.mode === "depth" ? depthMap(state) : state.map;
    for (const id of CHECKS) by(id).checked = state[id];
  }

  focus(model, state) {
    const [low, high] = model.focus, { stack } = model.about, input = by("focus");
    Object.assign(input, { min: low, max: high, value: state.focus });
    const metres = Boolean(model.views && model.about.depth?.metres), relative = Boolean(model.views?.relative);
    by("focus-label").textContent = model.views ? (!relative ? "Focus α′" : metres ? "Focus" : "Disparity") : stack?.label ?? "Focus";
    if (model.views) {
      const shift = model.factor * viewShifts(model.views, state.focus, 1).step, parts = relative ? [] : [state.focus.toFixed(4)];
      parts.push(signed(shift, (x) => `${x.toFixed(2)} ${model.samples(state).word} per view`));
      if (metres) parts.push(`${depthText(model.about.depth, state.focus)} from the focused plane`);
      else if (model.views.metric) parts.push(`image at ${lengthText(model.views.separation / state.focus)}`);
      tell("focus-out", parts.join(" · "));
    } else tell("focus-out", stackText(stack, this.app.main.image?.position ?? state.focus));
    input.setAttribute("aria-valuetext", by("focus-out").value);
  }

  aperture(model, state) {
    const kept = keptViews(model.views, state.aperture), exact = model.refocuser && state.renderer !== "stack";
    by("aperture").value = 100 * state.aperture;
    tell("aperture-out", `${kept[0]} × ${kept[1]} views`);
    by("detail").value = state.detail ?? model.views.detail;
    for (const id of ["shape", "detail"]) by(id).disabled = model.complete && !exact;
    this.drawPad();
  }

  /** How the plane that is sharp leans, and what is done to the picture after refocusing. */
  finish(model, state) {
    const exact = model.refocuser && state.renderer !== "stack", limits = tiltLimits(model.views), word = model.samples(state).word;
    TILTS.forEach((id, k) => {
      Object.assign(by(id), { min: -limits[k], max: limits[k], value: state.tilt[k], disabled: (model.complete && !exact) || state.sharp || !limits[k] });
      const shift = -model.factor * viewShifts(model.views, 1 - state.tilt[k], 1).step;
      tell(`${id}-out`, state.tilt[k] ? `${model.views.relative ? "" : `${signed(state.tilt[k], (x) => x.toFixed(4))} · `}${signed(shift, (x) => `${x.toFixed(2)} ${word} per view`)}` : "level");
      by(id).setAttribute("aria-valuetext", by(`${id}-out`).value);
    });
    for (const id of ["sharpen", "denoise"]) {
      Object.assign(by(id), { value: state[id], disabled: model.complete && !exact });
      tell(`${id}-out`, `${Math.round(100 * state[id])} %`);
    }
  }

  volume(volume, state) {
    const { volumeModel: model } = this.app, cross = model.cross(state), sections = state.projection === "sections";
    const places = model.placeOf(cross), shape = [volume.depths.length, ...volume.grid.shape];
    ["plane", "cross-y", "cross-x"].forEach((id, k) => {
      Object.assign(by(id), { max: shape[k] - 1, value: cross[k] });
      tell(`${id}-out`, `${cross[k] + 1} of ${shape[k]} · ${"zyx"[k]} ${lengthText(places[k])}`);
      by(id).setAttribute("aria-valuetext", by(`${id}-out`).value);
    });
    by("plane").disabled = state.projection !== "plane" && !sections;
    document.querySelector('[data-part="cross"]').hidden = !sections;
    const spins = this.app.main.model.spins(state);
    for (const part of document.querySelectorAll('[data-part="rays"]')) part.hidden = !spins;
    tell("flat", !spins && this.app.main.model.wantsRays(state) ? "3-D needs WebGL 2, which this browser does not offer here. Shown instead: the largest value along z." : "");
    by("density").value = Math.log10(state.density);
    by("density").disabled = state.projection !== "fog";
    tell("density-out", state.density.toFixed(1));
    tell("orbit-out", `${state.orbit[0].toFixed(0)}°, ${state.orbit[1].toFixed(0)}°`);
    by("projection").value = state.projection;
  }

  depth(model, state) {
    by("trust").value = state.trust;
    tell("trust-out", state.trust.toFixed(2));
    const range = model.depthRange(), map = cachedMap(depthMap(state));
    const colours = Array.from({ length: 17 }, (_, k) => { const i = 4 * Math.round((k * 255) / 16); return `rgb(${map[i]} ${map[i + 1]} ${map[i + 2]})`; });
    by("legend-bar").style.background = `linear-gradient(to right, ${colours.join(", ")})`;
    const { metres, shift } = model.about.depth, metric = !metres && !shift && model.views?.metric && model.about.depth.label.startsWith("Focus"), place = (x) => lengthText(model.views.separation / x);
    const shown = (x) => (metric ? place(x) : depthText(model.about.depth, x, 3, range[1] - range[0]));
    by("legend-low").textContent = range ? shown(range[0]) : "";
    by("legend-high").textContent = range ? shown(range[1]) : "";
    by("legend-label").textContent = metres ? "from focus" : shift ? "Disparity" : metric ? "image distance" : model.about.depth.label;
  }

  measures(state) {
    const { main } = this.app, { image, model } = main, { ruler } = state;
    by("clear").hidden = !ruler && !state.region;
    if (!image) return;
    tell("ruler-out", ruler ? `Length ${rulerText(ruler, image.unit, image.aspect, model.samples(state))}` : "");
    const key = JSON.stringify([state.region, state.mode, state.focus, state.view, state.aperture, state.plane, state.cross, state.projection, state.trust, image.nx, image.exact]);
    if (key !== this.regionKey && !main.pointers.size) { this.regionKey = key; tell("region-out", state.region && main.device ? `Region ${main.regionText(state)}` : ""); }
  }

  facts(exhibits) {
    by("facts").replaceChildren(...exhibits.flatMap((about) => [["File", about.name], ...about.facts]).flatMap(([what, value]) => {
      const [term, text] = [document.createElement("dt"), document.createElement("dd")];
      term.textContent = what; text.textContent = value;
      return [term, text];
    }));
  }
}

/** Where a picture of a stack is focused, with the digits that tell it from its neighbours. */
function stackText(stack, position) {
  const { positions = [], unit = "" } = stack ?? {}, step = Math.abs((positions.at(-1) ?? 0) - (positions[0] ?? 0)) / Math.max(positions.length - 1, 1);
  if (unit === "m") return lengthText(position);
  const digits = step > 0 ? Math.min(8, Math.max(0, 1 - Math.floor(Math.log10(step)))) : 3;
  return `${Number(position.toFixed(digits))} ${unit}`.trim();
}
