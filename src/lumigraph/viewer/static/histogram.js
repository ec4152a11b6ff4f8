// How often each value occurs, with black, white and the curve of gamma over it.

const BINS = 120, MOST = 60000;

/** Counts of values between low and high, both in parts of the white value; at most 60,000 values are looked at. */
function counted(array, white) {
  const { numbers } = array, step = Math.max(1, Math.floor(numbers.length / MOST)), values = [];
  for (let k = 0; k < numbers.length; k += step) values.push((array.offset + array.scale * numbers[k]) / white);
  let low = 0, high = 1;
  for (const x of values) if (Number.isFinite(x)) { low = Math.min(low, x); high = Math.max(high, x); }
  const counts = new Float64Array(BINS);
  for (const x of values) if (Number.isFinite(x)) counts[Math.min(BINS - 1, Math.floor(((x - low) / (high - low)) * BINS))] += 1;
  return { counts, low, high };
}

/** The values that stand behind the picture of a mode. */
function behind(model, state) {
  if (state.mode === "picture" && model.views) return model.complete ? model.views : null;
  return model.arrays[{ picture: "stack", raw: "raw", volume: "volume" }[state.mode]] ?? null;
}

export class Histogram {
  constructor(canvas) {
    this.canvas = canvas;
  }

  draw(model, state, image) {
    const array = image && behind(model, state), known = Boolean(array?.numbers?.length);
    this.canvas.hidden = !known;
    if (!known) return;
    const white = image.white || 1;
    if (this.array !== array.numbers || this.white !== white) {
      [this.array, this.white, this.found, this.key] = [array.numbers, white, counted(array, white), ""];
    }
    const ratio = Math.min(devicePixelRatio, 2), box = this.canvas.getBoundingClientRect();
    const key = [state.ev, state.black, state.gamma, box.width, ratio, matchMedia("(prefers-color-scheme: dark)").matches].join();
    if (key === this.key || !box.width) return;
    this.key = key;
    this.canvas.width = Math.round(box.width * ratio); this.canvas.height = Math.round(box.height * ratio);
    this.paint(state);
  }

  paint({ ev, black, gamma }) {
    const { counts, low, high } = this.found, { width, height } = this.canvas, context = this.canvas.getContext("2d");
    const style = getComputedStyle(document.documentElement), most = Math.log1p(Math.max(...counts));
    const across = (value) => ((value - low) / (high - low)) * width, top = black + (1 - black) / 2 ** ev;
    context.fillStyle = style.getPropertyValue("--soft");
    counts.forEach((n, k) => { const tall = (Math.log1p(n) / most) * height; context.fillRect((k * width) / BINS, height - tall, width / BINS, tall); });
    context.strokeStyle = style.getPropertyValue("--line"); context.lineWidth = Math.max(1, height / 40);
    context.beginPath(); context.moveTo(0, height);
    for (let k = 0; k <= 64; k++) context.lineTo(across(black + ((top - black) * k) / 64), height * (1 - (k / 64) ** (1 / gamma)));
    context.lineTo(width, 0); context.stroke();
    const text = `Histogram: black at ${Math.round(100 * black)} %, white at ${Math.round(100 * top)} % of the brightest, gamma ${gamma.toFixed(2)}`;
    this.canvas.setAttribute("aria-label", text);
    this.canvas.title = text;
  }
}
