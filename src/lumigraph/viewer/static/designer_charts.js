// Small line charts in SVG: one quantity over the magnification, both logarithmic, and the camera's own point.

const NS = "http://www.w3.org/2000/svg", WIDTH = 300, HEIGHT = 150, LEFT = 46, BOTTOM = 20, TOP = 10, RIGHT = 10;

function add(parent, name, attributes, text) {
  const node = document.createElementNS(NS, name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  if (text !== undefined) node.textContent = text;
  parent.append(node);
  return node;
}

export const short = (value) => {
  if (value === null || value === undefined) return "–";
  const size = Math.abs(value);
  return size !== 0 && (size < 0.001 || size >= 1e5) ? value.toExponential(1).replace("+", "") : String(Number(value.toPrecision(3)));
};

/** 1, 2 and 5 times powers of ten between two numbers, at most five of them. */
function ticks(low, high) {
  const all = [];
  for (let p = Math.floor(Math.log10(low)); p <= Math.ceil(Math.log10(high)); p++)
    for (const d of [1, 2, 5]) { const value = d * 10 ** p; if (value >= low * 0.999 && value <= high * 1.001) all.push(value); }
  let found = all;
  if (found.length > 5) found = all.filter((value) => Math.abs(Math.log10(value) % 1) < 1e-9);
  while (found.length > 5) found = found.filter((_, k) => k % 2 === 0);
  return found.length ? found : [low, high];
}

/** An SVG of a curve {values, here} over positions. */
export function chart(positions, at, curve) {
  const svg = document.createElementNS(NS, "svg");
  svg.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
  svg.setAttribute("role", "img");
  svg.setAttribute("aria-label", `${curve.name}: ${short(curve.here)} ${curve.unit}`);
  const xs = positions.map(Math.abs), here = Math.abs(at);
  const points = xs.map((x, k) => [x, curve.values[k]]).filter(([x, y]) => x > 0 && y !== null && y > 0);
  if (!points.length) { add(svg, "text", { x: WIDTH / 2, y: HEIGHT / 2, "text-anchor": "middle" }, "no camera here"); return svg; }
  const values = points.map(([, y]) => y).concat(curve.here > 0 ? [curve.here] : []);
  let [low, high] = [Math.min(...values), Math.max(...values)];
  if (high < low * 1.5) { low /= 1.5; high *= 1.5; }
  const [first, last] = [Math.min(...xs, here), Math.max(...xs, here)];
  const X = (x) => LEFT + (WIDTH - LEFT - RIGHT) * Math.log(x / first) / Math.log(last / first);
  const Y = (y) => HEIGHT - BOTTOM - (HEIGHT - BOTTOM - TOP) * Math.log(y / low) / Math.log(high / low);
  for (const y of ticks(low, high)) {
    add(svg, "line", { class: "grid", x1: LEFT, x2: WIDTH - RIGHT, y1: Y(y), y2: Y(y) });
    add(svg, "text", { x: LEFT - 5, y: Y(y) + 4, "text-anchor": "end" }, short(y));
  }
  for (const x of ticks(first, last)) add(svg, "text", { x: X(x), y: HEIGHT - 5, "text-anchor": "middle" }, short(x));
  add(svg, "line", { class: "rule", x1: X(here), x2: X(here), y1: TOP, y2: HEIGHT - BOTTOM });
  // a gap stays a gap
  let path = "", open = false;
  xs.forEach((x, k) => {
    const y = curve.values[k];
    if (y === null || !(y > 0)) { open = false; return; }
    path += `${open ? "L" : "M"}${X(x).toFixed(1)} ${Y(y).toFixed(1)}`;
    open = true;
  });
  add(svg, "path", { class: "curve", d: path });
  if (curve.here > 0) add(svg, "circle", { class: "here", cx: X(here), cy: Y(curve.here), r: 5 });
  return svg;
}
