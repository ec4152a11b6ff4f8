// A pull of focus, a walk around the aperture and a turn of a volume, as films on the page.

/** Seconds for once there and back, or around. */
export const ROUNDS = { pull: 6, sway: 4, orbit: 8 };

/** Settings of a film at a part (0 to 1) of its round. */
export function moment(what, model, state, part) {
  const turn = 2 * Math.PI * part;
  if (what === "orbit") return { orbit: [(((state.orbit[0] + 360 * part + 180) % 360) + 360) % 360 - 180, state.orbit[1]] };
  if (what === "pull") {
    const [low, high] = model.focus;
    return { focus: low + ((high - low) * (1 - Math.cos(turn))) / 2 };
  }
  const middle = model.views.shape.slice(0, 2).map((n) => (n - 1) / 2);
  return { aperture: 0.001, view: [middle[0] * (1 + 0.7 * Math.sin(turn)), middle[1] * (1 + 0.7 * Math.cos(turn))] };
}

export class Player {
  constructor(app) {
    Object.assign(this, { app, what: "", began: 0 });
    for (const id of Object.keys(ROUNDS)) document.getElementById(id).addEventListener("click", () => this.toggle(id));
  }

  /** Stops the film that runs; what it started from comes back. */
  stop() {
    if (this.what) this.toggle(this.what);
  }

  /** Starts a film, or stops the one that runs. */
  toggle(what) {
    const { app } = this, same = this.what === what;
    if (this.what) app.set(this.before);
    this.what = same ? "" : what;
    this.tell();
    if (!this.what) return;
    const { focus, view, aperture, orbit, mode } = app.state;
    Object.assign(this, { before: { focus, view, aperture, orbit }, mode, began: performance.now() });
    this.step();
  }

  tell() {
    for (const id of Object.keys(ROUNDS)) document.getElementById(id).setAttribute("aria-pressed", String(this.what === id));
  }

  step() {
    const { app, what } = this, part = (performance.now() - this.began) / 1000 / ROUNDS[what];
    if (!what) return;
    if (app.state.mode !== this.mode) { this.what = ""; this.tell(); return; }
    app.set(moment(what, app.main.model, { ...app.state, ...this.before }, part));
    requestAnimationFrame(() => this.step());
  }
}
