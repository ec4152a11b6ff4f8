// A slider and a number for each parameter; what is computed when it is left out has a tick box.

const place = (p, value) => p.kind === "log" ? Math.log(value / p.low) / Math.log(p.high / p.low) : (value - p.low) / (p.high - p.low);
const value = (p, t) => {
  const v = p.kind === "log" ? p.low * (p.high / p.low) ** t : p.low + (p.high - p.low) * t;
  return p.kind === "whole" ? Math.round(v) : Number(v.toPrecision(4));
};

function element(name, attributes = {}, ...inside) {
  const node = document.createElement(name);
  Object.assign(node, attributes);
  node.append(...inside);
  return node;
}

export class Controls {
  rows = {};

  /** `changed(key, value)` is called when someone moves a control. */
  constructor(root, parameters, changed) {
    this.parameters = parameters;
    for (const p of parameters) root.append(p.kind === "choice" ? this.choice(p, changed) : this.number(p, changed));
  }

  choice(p, changed) {
    const select = element("select", { id: p.key }, ...p.choices.map((word) => element("option", { value: word, textContent: word })));
    select.addEventListener("change", () => changed(p.key, select.value));
    this.rows[p.key] = (v) => { select.value = v; };
    return element("label", { className: "row" }, element("span", { textContent: p.label }), select);
  }

  number(p, changed) {
    const slider = element("input", { type: "range", min: 0, max: 1, step: "any", id: `${p.key}-slider`, ariaLabel: p.label });
    const box = element("input", { type: "number", step: "any", id: p.key, ariaLabel: `${p.label}${p.unit ? ` in ${p.unit}` : ""}` });
    const row = element("div", { className: "row" }, element("span", { textContent: p.label }),
      element("span", { className: "value" }, box, element("span", { className: "unit", textContent: p.unit })), slider);
    if (p.kind === "whole") slider.step = 1 / (p.high - p.low);
    slider.addEventListener("input", () => { box.value = value(p, Number(slider.value)); changed(p.key, Number(box.value)); });
    box.addEventListener("change", () => {
      const wrong = box.value.trim() === "" || !Number.isFinite(Number(box.value));
      row.classList.toggle("wrong", wrong);
      if (!wrong) { slider.value = place(p, Number(box.value)); changed(p.key, Number(box.value)); }
    });
    let tick = null;
    if (p.optional) {
      tick = element("input", { type: "checkbox", id: `${p.key}-matched` });
      tick.addEventListener("change", () => changed(p.key, tick.checked ? null : Number(box.value)));
      row.append(element("label", { className: "check" }, tick, "matched to the lenslets"));
    }
    this.rows[p.key] = (v, computed) => {
      const known = v ?? computed;
      if (tick) { tick.checked = v === null; slider.disabled = box.disabled = v === null; }
      if (known === undefined) return;
      if (document.activeElement !== box) box.value = Number(known.toPrecision(v === null ? 5 : 6));
      if (document.activeElement !== slider) slider.value = place(p, known);
      slider.ariaValueText = `${Number(known.toPrecision(4))} ${p.unit}`;
    };
    return row;
  }

  /** `computed` holds values of parameters that are left out. */
  show(values, computed = {}) {
    for (const p of this.parameters) this.rows[p.key](values[p.key], computed[p.key]);
  }
}
