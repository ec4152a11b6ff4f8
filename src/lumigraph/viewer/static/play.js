// A pull of focus, and a walk around the aperture, as films on the page.

const PULL = 6, ROUND = 4; // seconds there and back, and once around

export class Player {
  constructor(app) {
    Object.assign(this, { app, what: "", began: 0 });
    for (const id of ["pull", "sway"]) document.getElementById(id).addEventListener("click", () => this.toggle(id));
  }

  /** Starts a film, or stops the one that runs; what it started from comes back. */
  toggle(what) {
    const { app } = this, same = this.what === what;
    if (this.what) app.set(this.before);
    this.what = same ? "" : what;
    for (const id of ["pull", "sway"]) document.getElementById(id).setAttribute("aria-pressed", String(this.what === id));
    if (!this.what) return;
    const { focus, view, aperture } = app.state;
    Object.assign(this, { before: { focus, view, aperture }, began: performance.now() });
    if (what === "sway") app.set({ aperture: 0.001 });
    this.step();
  }

  step() {
    const { app } = this, { model } = app.main, seconds = (performance.now() - this.began) / 1000;
    if (!this.what || app.state.mode !== "picture") { this.what = ""; return; }
    if (this.what === "pull") {
      const [low, high] = model.focus, part = (1 - Math.cos((2 * Math.PI * seconds) / PULL)) / 2;
      app.set({ focus: low + (high - low) * part });
    } else {
      const turn = (2 * Math.PI * seconds) / ROUND, middle = model.views.shape.slice(0, 2).map((n) => (n - 1) / 2);
      app.set({ view: [middle[0] * (1 + 0.7 * Math.sin(turn)), middle[1] * (1 + 0.7 * Math.cos(turn))] });
    }
    requestAnimationFrame(() => this.step());
  }
}
