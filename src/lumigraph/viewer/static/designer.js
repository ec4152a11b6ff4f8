// The designer: values go to the server, which computes; the newest question of a kind is the only one that waits.

import { chart, short } from "./designer_charts.js";
import { Controls } from "./designer_controls.js";

const at = (id) => document.getElementById(id);

async function call(name, given) {
  const answer = await fetch(`call/${name}`, { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(given) });
  const told = await answer.json().catch(() => ({ error: `the server answered ${answer.status}` }));
  if (told.error) throw new Error(told.error);
  return told.result;
}

/** Asks again only when the last answer is there, and then for the newest values. */
class Asker {
  constructor(name, given, show) { Object.assign(this, { name, given, show, answered: 0 }); }

  async ask() {
    if (this.busy) { this.again = true; return; }
    this.busy = true;
    do {
      this.again = false;
      try { this.show(await call(this.name, this.given()), null); } catch (error) { this.show(null, error); }
    } while (this.again);
    this.busy = false;
    this.answered += 1;
  }
}

class Designer {
  errors = {};

  constructor(about) {
    this.about = about;
    this.start = Object.fromEntries(about.parameters.map((p) => [p.key, p.value]));
    this.values = { ...this.start };
    this.dz = 0;
    at("title").textContent = about.name;
    document.title = `${about.name} – designer – lumigraph`;
    this.controls = new Controls(at("parameters"), about.parameters, (key, value) => this.set({ [key]: value }));
    const given = () => ({ values: this.values });
    this.askers = {
      design: new Asker("design", given, (found, error) => this.designed(found, error)),
      point: new Asker("point", () => ({ ...given(), dz: this.dz }), (found, error) => this.pointed(found, error)),
      layout: new Asker("layout", given, (found, error) => this.drawn(found, error)),
    };
    at("depth").min = -about.depth.reach; at("depth").max = about.depth.reach; at("depth").value = 0;
    at("depth").addEventListener("input", () => this.setDepth(Number(at("depth").value) * about.depth.scale));
    at("save").addEventListener("click", () => this.save());
    at("copy").addEventListener("click", () => this.copy());
    at("reset").addEventListener("click", () => { this.values = { ...this.start }; this.controls.show(this.values); this.setDepth(0); this.ask(); });
    this.read();
    this.controls.show(this.values);
    this.setDepth(this.dz);
    this.ask();
  }

  /** Values out of the link. */
  read() {
    for (const part of location.hash.replace(/^#/, "").split("&")) {
      const [key, text = ""] = part.split("="), p = this.about.parameters.find((each) => each.key === key);
      if (key === "dz" && Number.isFinite(Number(text))) this.dz = Number(text) * this.about.depth.scale;
      if (!p) continue;
      if (p.kind === "choice") { if (p.choices.includes(text)) this.values[key] = text; }
      else if (text === "matched" && p.optional) this.values[key] = null;
      else if (text !== "" && Number.isFinite(Number(text))) this.values[key] = Number(text);
    }
  }

  link() {
    const parts = Object.entries(this.values).filter(([key, value]) => value !== this.start[key]).map(([key, value]) => `${key}=${value ?? "matched"}`);
    if (this.dz) parts.push(`dz=${Number((this.dz / this.about.depth.scale).toPrecision(4))}`);
    history.replaceState(null, "", parts.length ? `#${parts.join("&")}` : location.pathname + location.search);
  }

  set(changes) { Object.assign(this.values, changes); this.ask(); }

  setDepth(dz) {
    this.dz = dz;
    const { unit, scale } = this.about.depth;
    at("depth-out").textContent = `${Number((dz / scale).toPrecision(3))} ${unit}${dz > 0 ? ", farther" : dz < 0 ? ", nearer" : ""}`;
    if (document.activeElement !== at("depth")) at("depth").value = dz / scale;
    this.askers.point.ask();
    this.later();
  }

  ask() { for (const asker of Object.values(this.askers)) asker.ask(); this.later(); }

  later() { clearTimeout(this.linking); this.linking = setTimeout(() => this.link(), 250); }

  say() {
    const text = this.errors.design ?? (this.saved ? this.saved : "");
    at("status").textContent = text;
    at("status").title = text;
    at("status").classList.toggle("wrong", Boolean(this.errors.design));
    at("sheet").classList.toggle("stale", Boolean(this.errors.design));
    const told = this.errors.design ? [this.errors.design] : [...(this.warnings ?? []), ...(this.errors.point ? [this.errors.point] : [])];
    at("warnings").hidden = !told.length;
    at("warnings").querySelector("ul").replaceChildren(...told.map((line) => Object.assign(document.createElement("li"), { textContent: line })));
    at("save").disabled = at("copy").disabled = Boolean(this.errors.design);
  }

  designed(found, error) {
    this.errors.design = error?.message;
    if (found) {
      this.toml = found.toml;
      this.warnings = found.warnings;
      at("toml").textContent = found.toml;
      at("kind").textContent = found.title;
      this.controls.show(this.values, found.diameter ? { "main_lens.diameter": found.diameter * 1e3 } : {});
      this.tables(found.sections);
      this.charts(found.curves);
    }
    this.say();
  }

  tables(sections) {
    at("tables").replaceChildren(...sections.map(({ title, rows }) => {
      const table = document.createElement("table"), box = Object.assign(document.createElement("div"), { tabIndex: 0, role: "group", ariaLabel: title });
      table.createCaption().textContent = title;
      const body = table.createTBody();
      for (const [name, text, source] of rows) {
        const row = body.insertRow(), head = document.createElement("th");
        head.scope = "row"; head.textContent = name; row.append(head);
        row.insertCell().textContent = text; row.insertCell().textContent = source;
      }
      box.append(table);
      return box;
    }));
  }

  charts({ label, at: here, positions, curves }) {
    at("axis").textContent = `Over the magnification ${label}; the dot is this camera, ${short(here)}.`;
    at("charts").replaceChildren(...curves.map((curve) => {
      const box = Object.assign(document.createElement("div"), { className: "chart" }), head = document.createElement("h3");
      const now = Object.assign(document.createElement("output"), { textContent: `${short(curve.here)} ${curve.unit}` });
      head.append(curve.name, now);
      box.append(head, chart(positions, here, curve), Object.assign(document.createElement("p"), { textContent: curve.equation }));
      return box;
    }));
  }

  pointed(found, error) {
    this.errors.point = error?.message;
    if (error) at("spot").lastElementChild.textContent = "No image.";
    at("point").classList.toggle("old", Boolean(error));
    if (found) {
      at("point").src = found.png;
      at("point").hidden = false;
      at("point").style.aspectRatio = `${found.shape[1]} / ${found.shape[0]}`;
      const size = found.shape.map((n) => Number((n * found.pixel_pitch * 1e3).toPrecision(3))).join(" × ");
      const lenslets = found.lenslets ? `${found.lenslets.join(" × ")} lenslets, ` : "";
      at("about-point").textContent = `${lenslets}${found.shape.join(" × ")} px, ${size} mm on the sensor; wave optics, `
        + `${found.seconds.toFixed(2)} s; brightness is the square root of the intensity.`;
      at("notes").textContent = found.notes.join(" ");
    }
    this.say();
  }

  drawn(found, error) {
    at("layout").hidden = Boolean(found && !found.svg);
    at("drawing").hidden = !found?.svg && !at("drawing").src;
    if (found?.svg) at("drawing").src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(found.svg)}`;
    this.errors.layout = error?.message;
    if (error) at("rays").lastElementChild.textContent = "No drawing.";
  }

  save() {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([this.toml], { type: "application/toml" }));
    link.download = `${this.about.name.replace(/\.toml$/, "")}.toml`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
    this.tell(`Saved ${link.download}`);
  }

  async copy() {
    try { await navigator.clipboard.writeText(this.toml); this.tell("Copied."); } catch { this.tell("The camera file is below the buttons."); }
  }

  tell(text) { this.saved = text; this.say(); setTimeout(() => { this.saved = ""; this.say(); }, 3500); }

  /** Waits until nothing is asked. */
  async settled() {
    while (Object.values(this.askers).some((asker) => asker.busy)) await new Promise((wake) => setTimeout(wake, 20));
  }
}

try {
  window.lumigraph = new Designer(await (await fetch("data/about")).json());
} catch (error) {
  at("status").textContent = `This page cannot be shown: ${error.message}`;
  at("status").classList.add("wrong");
  throw error;
}
