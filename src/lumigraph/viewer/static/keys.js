// Keys that work everywhere on the page but in a control that uses them itself.

import { tiltLimits } from "./aperture.js";

const MODES = ["picture", "raw", "depth", "volume"];

export function listenToKeys(app, actions) {
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]")) return;
    const busy = event.target.closest?.("input, select, textarea");
    if (busy && (event.target.type === "range" || event.target.tagName === "SELECT") && event.key.startsWith("Arrow")) return;
    if (act(app, actions, event)) event.preventDefault();
  });
}

function act(app, actions, event) {
  const { state, main } = app, { key, shiftKey } = event, step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[key];
  if (step && shiftKey && state.mode === "volume" && main.model.spins(state)) { main.orbit(10 * step[0], 10 * step[1]); return true; }
  if (step && shiftKey && state.mode === "volume" && state.projection === "sections") {
    const { volumeModel: model } = app, [z, y, x] = model.cross(state), { shape } = model.about.volume.grid;
    app.set({ plane: z, cross: [y + step[1], x + step[0]].map((at, k) => Math.min(shape[k] - 1, Math.max(0, at))) });
    return true;
  }
  if (step && (shiftKey || event.target.id === "pad")) {
    if (!main.model.views || state.mode !== "picture") return false;
    main.moveView((0.5 * step[0]) / 1.4 / main.model.views.shape[1], (0.5 * step[1]) / 1.4 / main.model.views.shape[0]);
    return true;
  }
  if (step && step[0]) return walk(app, step[0]);
  if (key in actions) { actions[key](); return true; }
  if (MODES[Number(key) - 1] && main.model.modes[MODES[Number(key) - 1]]) app.set({ mode: MODES[Number(key) - 1] });
  else if (key === "e") app.set({ epi: !state.epi });
  else if (key === "a" && main.model.about.sharp) app.set({ sharp: !state.sharp });
  else if ("tyTY".includes(key) && main.model.views && state.mode === "picture") lean(app, key);
  else if (key === "m") app.set({ drag: { move: "ruler", ruler: "region", region: "move" }[state.drag] });
  else if (key === "l") app.set({ lattice: !state.lattice });
  else if (key === "[" || key === "]") app.set({ aperture: Math.min(1, Math.max(0.001, state.aperture + (key === "]" ? 0.1 : -0.1))) });
  else if (key === "," || key === ".") app.set({ ev: Math.min(12, Math.max(-12, state.ev + (key === "." ? 0.25 : -0.25))) });
  else return false;
  return true;
}

/** Tilts the sharp plane by a twentieth of what is possible: T down the picture, Y across it, Shift the other way. */
function lean(app, key) {
  const k = key.toLowerCase() === "t" ? 0 : 1, most = tiltLimits(app.main.model.views)[k], step = (key === key.toLowerCase() ? most : -most) / 20;
  app.set({ tilt: app.state.tilt.map((t, i) => (i === k ? Math.min(most, Math.max(-most, t + step)) : t)) });
}

/** One step of what the mode's slider moves. */
function walk(app, direction) {
  const { state, main: { model } } = app;
  if (state.mode === "volume") {
    const last = app.volumeModel.about.volume.depths.length - 1, [z] = app.volumeModel.cross(state);
    app.set({ plane: Math.min(last, Math.max(0, z + direction)) });
    return true;
  }
  if (state.mode !== "picture") return false;
  const [low, high] = model.focus, steps = model.views ? 100 : model.about.stack.positions.length - 1;
  app.set({ focus: Math.min(high, Math.max(low, state.focus + (direction * (high - low)) / Math.max(steps, 1))) });
  return true;
}
