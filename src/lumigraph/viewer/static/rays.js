// A volume from any side: rays through a 3-D texture, by their largest value or as a glowing fog.

const MOST_SIDE = 512, LARGEST = 769, LEAST = 129; // samples of the texture, pixels of the picture across
const SLOW = 45; // ms for one picture, above which those of a movement have a quarter of the pixels across
export const RAYS = ["brightest", "fog"];

const SHADER = `#version 300 es
precision highp float; precision highp int; precision highp sampler3D;
uniform sampler3D volume;
uniform vec3 count, held, thinned; // samples x, y, z of the file, of the texture, and of the file for one of the texture's
uniform vec3 spacing;              // of the file's samples [pixels of the picture]
uniform mat3 turn;                 // from (right, down, away from the eye) to (x, y, z)
uniform float side, step_, density; // pixels across, between samples of a ray, fog in the brightest place over the picture's side
uniform bool fog;
out vec4 colour;
void main() {
  vec3 ahead = turn * vec3(0.0, 0.0, 1.0), middle = turn * vec3(gl_FragCoord.xy - 0.5 * side, 0.0);
  vec3 box = 0.5 * count * spacing, slope = 1.0 / (ahead + vec3(equal(ahead, vec3(0.0))) * 1e-9);
  vec3 one = (-box - middle) * slope, other = (box - middle) * slope, near = min(one, other), far = max(one, other);
  float from = clamp(max(near.x, max(near.y, near.z)), -side, side), to = clamp(min(far.x, min(far.y, far.z)), -side, side);
  int first = int(ceil(from / step_)), last = int(floor(to / step_));
  vec3 most = vec3(0.0), total = vec3(0.0);
  float through = 1.0;
  for (int k = first; k <= last; k++) {
    vec3 place = (middle + float(k) * step_ * ahead) / spacing + 0.5 * (count - 1.0);
    vec3 x = texture(volume, (place / thinned + 0.5) / held).rgb;
    most = max(most, x);
    float opacity = 1.0 - exp(-density * clamp(max(x.r, max(x.g, x.b)), 0.0, 1.0) * step_ / side);
    total += through * opacity * x;
    through *= 1.0 - opacity;
    if (fog && through < 0.004) break;
  }
  colour = vec4(fog ? total : most, 1.0);
}`;

/** Where x, y and z point on the screen (right, down, away), for a yaw and a pitch [degrees]: rows. */
export function axesOf([yaw, pitch]) {
  const [c, s, d, t] = [yaw, pitch].flatMap((angle) => [Math.cos((angle * Math.PI) / 180), Math.sin((angle * Math.PI) / 180)]);
  return [[c, 0, -s], [-t * s, d, -t * c], [d * s, t, d * c]];
}

export class RayCaster {
  constructor(device, array, { spacing: [dz, dy, dx], white }) {
    const [nz, ny, nx] = array.shape, channels = array.shape[3] ?? 1;
    Object.assign(this, { device, channels, white, took: 0, targets: new Map(), count: [nx, ny, nz], spacing: [dx, dy, dz || dx] });
    const lengths = this.count.map((n, k) => n * this.spacing[k]), longest = Math.hypot(...lengths);
    this.side = 8 * Math.ceil(Math.min(LARGEST, Math.max(LEAST, longest / Math.min(...this.spacing))) / 8) + 1;
    this.pixel = longest / this.side;
    this.thinned = this.count.map((n) => Math.ceil(n / MOST_SIDE));
    this.held = this.count.map((n, k) => Math.ceil(n / this.thinned[k]));
    this.upload(array, [ny, nx, channels]);
  }

  /** Values in parts of white, as half floats, which the graphics processor interpolates. */
  upload({ numbers, scale, offset }, [ny, nx, channels]) {
    const { device: { gl }, held: [mx, my, mz], thinned: [sx, sy, sz] } = this, plane = new Float32Array(mx * my * channels);
    this.texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_3D, this.texture);
    for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_3D, filter, gl.LINEAR);
    for (const wrap of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T, gl.TEXTURE_WRAP_R]) gl.texParameteri(gl.TEXTURE_3D, wrap, gl.CLAMP_TO_EDGE);
    gl.texStorage3D(gl.TEXTURE_3D, 1, channels === 1 ? gl.R16F : gl.RGB16F, mx, my, mz);
    for (let z = 0; z < mz; z++) {
      let at = 0;
      for (let y = 0; y < my; y++) for (let x = 0; x < mx; x++) for (let c = 0; c < channels; c++) {
        plane[at++] = (offset + scale * numbers[((z * sz * ny + y * sy) * nx + x * sx) * channels + c]) / this.white;
      }
      gl.texSubImage3D(gl.TEXTURE_3D, 0, 0, 0, z, mx, my, 1, channels === 1 ? gl.RED : gl.RGB, gl.FLOAT, plane);
    }
  }

  /** The volume as it is seen: {nx, ny, texture, ...}; coarser while it moves where the machine is slow. */
  image({ orbit, projection, density }, settled) {
    const detail = !settled && this.took > SLOW ? 0.25 : 1, n = (this.side - 1) * detail + 1, start = performance.now();
    if (!this.targets.has(n)) this.targets.set(n, this.device.floats(n, n));
    const pixel = this.pixel / detail, spacing = this.spacing.map((d) => d / pixel), target = this.targets.get(n);
    this.device.draw(this.device.program("rays", SHADER), [n, n], target, (at, gl) => {
      this.device.bind(0, gl.TEXTURE_3D, this.texture, at.volume);
      for (const [name, values] of Object.entries({ count: this.count, held: this.held, thinned: this.thinned, spacing })) gl.uniform3fv(at[name], values);
      gl.uniformMatrix3fv(at.turn, false, axesOf(orbit).flat());
      gl.uniform1f(at.side, n);
      gl.uniform1f(at.step_, Math.min(...spacing) * (detail < 1 ? 1 : 0.5)); // half: its samples fall on the planes
      gl.uniform1f(at.density, density);
      gl.uniform1i(at.fog, projection === "fog" ? 1 : 0);
    });
    if (detail === 1) { this.device.finish(); this.took = performance.now() - start; }
    return {
      nx: n, ny: n, channels: this.channels, texture: target, bits: 16, scale: this.white, offset: 0, white: this.white,
      base: [this.side, this.side], aspect: 1, detail, unit: this.pixel, rays: true, exact: detail === 1,
    };
  }
}

/** Where x, y and z point, at the lower left of a context of some height. */
export function drawAxes(context, orbit, turn, height) {
  const rows = axesOf(orbit), [x0, y0] = [46, height - 46];
  context.font = "600 12px system-ui, sans-serif";
  context.textAlign = "center";
  [["x", "#ff8a66"], ["y", "#7ce0a3"], ["z", "#8cc4ff"]].forEach(([name, colour], k) => {
    const [x, y] = turn([rows[0][k], rows[1][k]]);
    Object.assign(context, { strokeStyle: colour, fillStyle: colour, lineWidth: 2 });
    context.beginPath(); context.moveTo(x0, y0); context.lineTo(x0 + 26 * x, y0 + 26 * y); context.stroke();
    context.fillText(name, x0 + 36 * x, y0 + 36 * y + 4);
  });
}
