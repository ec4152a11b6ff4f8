// The page: settings, panes, controls, the link.

import { Controls } from "./controls.js";
import { FilmDialog, filmsOf } from "./film.js";
import { listenToKeys } from "./keys.js";
import { Model } from "./models.js";
import { Pane } from "./pane.js";
import { PICKS } from "./picking.js";
import { Player } from "./play.js";
import { pictureCanvas, savePicture, saveQuilt } from "./saving.js";
import { isExported, loadAbout } from "./source.js";
import { defaults, linkOf, parseLink } from "./state.js";

class App {
  changedAt = -1e9;
  panes = [];

  constructor(about) {
    this.about = about;
    const models = about.exhibits.map((exhibit, k) => new Model(k, exhibit, () => this.schedule()));
    this.base = { ...defaults(), focus: models[0].startFocus, mode: Object.entries(models[0].modes).find(([, there]) => there)[0] };
    this.state = { ...this.base };
    this.read();
    document.getElementById("panes").classList.toggle("two", models.length > 1);
    for (const model of models) {
      const root = document.createElement("section");
      document.getElementById("panes").append(root);
      this.panes.push(new Pane(root, model, this));
    }
    this.main = this.panes[0];
    this.controls = new Controls(this);
    this.controls.facts(about.exhibits);
    this.colours();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { this.colours(); this.schedule(); });
    addEventListener("hashchange", () => { if (location.hash !== this.link) { this.state = { ...this.base }; this.read(); this.touched(); } });
    document.title = `${models.map((model) => model.about.name).join(" and ")} – lumigraph`;
    document.getElementById("title").textContent = models.map((model) => model.about.name).join(" and ");
  }

  /** The first exhibit with a volume, whose planes the sliders count. */
  get volumeModel() {
    return this.panes.find(({ model }) => model.about.volume)?.model;
  }

  /** Shows what a written page opens with, before the graphics processor has anything to do. */
  async preview() {
    await Promise.all(this.panes.map(({ model }) => model.loadPoster()));
    if (!this.panes.some(({ model }) => model.arrays.poster)) return;
    this.schedule();
    await painted();
  }

  /** Settings out of the link; a mode that is not there is left out. */
  read() {
    const found = parseLink(location.hash);
    if (found.mode && !this.about.exhibits.some((exhibit) => new Model(0, exhibit).modes[found.mode])) delete found.mode;
    Object.assign(this.state, found);
  }

  colours() {
    const style = getComputedStyle(document.documentElement), text = style.getPropertyValue("--ground").trim();
    this.ground = [1, 3, 5].map((k) => parseInt(text.slice(k, k + 2), 16) / 255);
    this.line = style.getPropertyValue("--line").trim();
  }

  set = (changes) => {
    if ("mode" in changes && changes.mode !== this.state.mode) Object.assign(changes, { at: null, zoom: 1 });
    Object.assign(this.state, changes);
    this.touched();
  };

  /** The next click sets the white balance ("grey") or the exposure; null: it focuses again. */
  pickBy(what) {
    this.picking = this.picking === what ? null : what;
    if (this.picking) this.tell(PICKS[what]);
    this.schedule();
  }

  touched() {
    this.moving = true; // until the next frame, however late it comes
    this.changedAt = performance.now();
    this.schedule();
  }

  schedule() {
    if (this.frame) return;
    this.frame = requestAnimationFrame((now) => { this.frame = 0; this.draw(Math.max(now, performance.now())); });
  }

  draw(now) {
    const shown = this.panes.map((pane) => pane.draw(now));
    this.moving = false;
    if (shown[0] && !this.shown) this.timeFirst();
    this.controls.refresh();
    this.say();
    clearTimeout(this.linking);
    this.linking = setTimeout(() => this.writeLink(), 250);
    for (const wake of this.waiting?.splice(0) ?? []) wake();
  }

  /** Notes when the first picture has been painted: in the frame after. */
  async timeFirst() {
    this.shown = true;
    await painted();
    this.main.device?.finish();
    this.first = performance.now();
    performance.mark("first-picture");
  }

  writeLink() {
    this.link = linkOf(this.state, this.base);
    if (this.link === "#" && !location.hash) return;
    history.replaceState(null, "", this.link === "#" ? location.pathname + location.search : this.link);
  }

  /** What is going on. */
  say() {
    if (this.told && performance.now() < this.told) return;
    const { model } = this.main, failed = Object.values(model.errors)[0], status = document.getElementById("status");
    const missing = [...model.wanted].filter((name) => !model.arrays[name] && !model.errors[name]);
    let text = "";
    if (failed) text = failed;
    else if (model.views && !model.complete) text = "Loading views …";
    else if (missing.some((name) => name === "depth" || name === "confidence")) text = "Measuring depth …";
    else if (missing.includes("sharp")) text = "Focusing everywhere …";
    else if (missing.includes("stack")) text = "Preparing the focal stack …";
    else if (missing.length) text = "Loading …";
    else if (Object.values(model.finer).some(({ loading }) => loading)) text = "Loading what is finer …";
    else if (model.views && !model.refocuser) text = "Without WebGL 2: focal stack";
    else text = this.main.kept()?.every((n) => n === 1) && this.state.mode === "picture" ? "One view" : "";
    if (status.textContent !== text) status.textContent = text;
    status.classList.toggle("wrong", Boolean(failed));
  }

  tell(text, wrong = false) {
    const status = document.getElementById("status");
    status.textContent = text;
    status.classList.toggle("wrong", wrong);
    this.told = performance.now() + 3500;
    setTimeout(() => this.schedule(), 3600);
  }

  /** Draws and waits until the exact picture is there. */
  async settled() {
    this.changedAt = -1e9;
    this.moving = false;
    await new Promise((wake) => { (this.waiting ??= []).push(wake); this.schedule(); });
  }
}

/** Waits until what is drawn now is on the screen: its frame is over when the next begins. Hidden pages have no frames. */
function painted() {
  return new Promise((done) => {
    setTimeout(done, document.hidden ? 0 : 500);
    requestAnimationFrame(() => requestAnimationFrame(done));
  });
}

async function copyLink(app) {
  app.writeLink();
  try { await navigator.clipboard.writeText(location.href); app.tell("Link copied."); } catch { app.tell("The address bar holds the link."); }
}

async function fullScreen(app) {
  try { await (document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen()); } catch { app.tell("This browser does not fill the screen here."); }
}

function wire(app) {
  const actions = {
    s: () => savePicture(app), v: () => { if (filmsOf(app.main.model, app.state).length) app.film.open(); }, r: () => app.set({ turn: (app.state.turn + 1) % 4 }), 0: () => app.set({ zoom: 1, at: null }), "?": () => document.getElementById("keys").showModal(),
    w: () => here("grey"), x: () => here("exposure"), f: () => fullScreen(app), "+": () => zoom(1.25), "=": () => zoom(1.25), "-": () => zoom(0.8),
  };
  const zoom = (factor) => { const box = app.main.stage.getBoundingClientRect(); app.main.zoomAt([box.width / 2, box.height / 2], factor); };
  const here = (what) => { const { base, hover } = app.main; if (base) app.main.pick(what, hover ?? app.state.point ?? base.map((n) => (n - 1) / 2)); };
  const on = (id, act) => document.getElementById(id).addEventListener("click", act);
  on("quilt", () => saveQuilt(app)); on("save-film", actions.v); on("turn", actions.r);
  on("save", actions.s); on("fit", actions[0]); on("help", actions["?"]); on("full", actions.f); on("link", () => copyLink(app));
  on("reset", () => { app.state = { ...app.base, mode: app.state.mode, renderer: app.state.renderer }; app.touched(); });
  on("pick-grey", () => app.pickBy("grey")); on("pick-exposure", () => app.pickBy("exposure"));
  on("pixel", () => zoom(1 / ((app.main.scale[0] / app.main.image.detail / app.main.model.factor) / app.main.ratio)));
  app.player = new Player(app);
  app.film = new FilmDialog(app);
  listenToKeys(app, actions);
}

async function open() {
  const status = document.getElementById("status");
  try {
    const app = new App(await loadAbout());
    window.lumigraph = { app, set: async (changes) => { app.set(changes); await app.settled(); }, pixels: (k = 0) => app.panes[k].pixels(), picture: () => pictureCanvas(app) };
    wire(app);
    await app.preview();
    for (const pane of app.panes) pane.open();
    app.schedule();
    await Promise.all(app.panes.filter(({ model }) => model.views).map((pane) => pane.model.loadViews(pane.device, isExported())));
    window.lumigraph.ready = true;
    app.schedule();
  } catch (error) {
    status.textContent = `This page cannot be shown: ${error.message}`;
    status.classList.add("wrong");
    throw error;
  }
}

open();
