// The page of an alignment: asks for the newest step every second, or shows the one that the slider has.

const at = (id) => document.getElementById(id);
const PAUSE = 1000; // ms

async function call(given) {
  const answer = await fetch("call/step", { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(given) });
  const told = await answer.json().catch(() => ({ error: `the server answered ${answer.status}` }));
  if (told.error) throw new Error(told.error);
  return told.result;
}

function filled(list, texts, tag = "li") {
  list.replaceChildren(...texts.map((text) => Object.assign(document.createElement(tag), { textContent: text })));
}

function lattice(step) {
  const [height, width] = step.shape, arm = Math.max(height, width) / 160;
  const cross = ([y, x], size) => `M${x - size} ${y}h${2 * size}M${x} ${y - size}v${2 * size}`;
  const svg = at("lattice");
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  const path = (d, name) => {
    const found = document.createElementNS("http://www.w3.org/2000/svg", "path");
    found.setAttribute("d", d);
    found.setAttribute("class", name);
    return found;
  };
  svg.replaceChildren(path(step.centers.map((one) => cross(one, arm / 2)).join(""), "lenslets"), path(cross([height / 2, width / 2], 4 * arm), "middle"));
}

let shown = null, asked = null;

function show({ count, name, step }) {
  at("title").textContent = name;
  if (!step) return;
  const slider = at("exposure");
  slider.max = count - 1;
  if (asked === null) slider.value = step.number;
  at("which").textContent = `${step.number} (0 to ${count - 1})`;
  const key = `${step.number}/${count}`;
  if (key === shown) return;
  shown = key;
  at("status").textContent = `exposure ${step.number}: ${step.status}`;
  at("white").src = step.png;
  at("white").hidden = false;
  lattice(step);
  at("rows").replaceChildren(...step.rows.map((row) => {
    const line = document.createElement("tr");
    filled(line, row, "td");
    return line;
  }));
  filled(at("moves"), step.instructions.length ? step.instructions : ["nothing moves"]);
  filled(at("notes"), step.notes);
}

async function follow() {
  try { show(await call(asked === null ? {} : { number: asked })); } catch { at("status").textContent = "The alignment has ended, or its server was stopped."; }
}

at("exposure").addEventListener("input", () => {
  asked = at("exposure").value === at("exposure").max ? null : Number(at("exposure").value);
  follow();
});
follow();
setInterval(follow, PAUSE);
