// White balance and exposure from a place of the picture that somebody clicks.

const MIDDLE = 0.18; // of white: what a place becomes that is exposed for
const LEAST = 1e-6; // of white: darker places say nothing about colour

export const PICKS = {
  grey: "Click something that is grey.",
  exposure: "Click what should be as bright as middle grey.",
};

/** The value at a place (y, x) of the picture [parts of white, above black], one for each channel; null outside. */
function lightAt(pane, [y, x]) {
  const { image, app: { state } } = pane;
  if (!image || image.rays || image.sections || image.plain) return null;
  const row = Math.round(y * image.detail), column = Math.round(x * image.detail);
  if (row < 0 || column < 0 || row >= image.ny || column >= image.nx) return null;
  const start = (row * image.nx + column) * image.channels, white = image.white || 1;
  const numbers = image.texture ? pane.device.sample(image, column, row) : image.numbers.subarray(start, start + image.channels);
  return Array.from(numbers).slice(0, image.channels).map((n) => ((image.offset + image.scale * n) / white - state.black) / (1 - state.black));
}

/** Settings that make a place grey, or as bright as middle grey; null where it is too dark for that. */
export function picked(pane, what, place) {
  const { state } = pane.app, light = lightAt(pane, place);
  if (!light) return null;
  if (what === "grey") {
    if (light.length !== 3 || Math.min(...light) < LEAST) return null;
    return { balance: light.map((x) => Math.min(1000, Math.max(1e-3, light[1] / x))) };
  }
  const mean = light.reduce((sum, x, c) => sum + x * (light.length === 3 ? state.balance[c] : 1), 0) / light.length;
  return mean < LEAST ? null : { ev: Math.min(12, Math.max(-12, Math.log2(MIDDLE / mean))) };
}
