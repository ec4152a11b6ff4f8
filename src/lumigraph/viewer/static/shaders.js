// Shaders. A picture's first row is row 0 of its texture.

export const VERTEX = `#version 300 es
void main() { // one triangle over everything
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}`;

const CUBIC = `
// Keys' cubic convolution, a = -1/2: the weights of lumigraph.rendering.interpolate.taps.
vec4 cubic(float f) {
  return 0.5 * vec4(((2.0 - f) * f - 1.0) * f, (3.0 * f - 5.0) * f * f + 2.0,
                    ((4.0 - 3.0 * f) * f + 1.0) * f, (f - 1.0) * f * f);
}`;

/** Sum over the views of one row v of the aperture, moved along s. Alpha: the weight that was seen. */
export const SHEAR_ROW = `#version 300 es
precision highp float; precision highp int; precision highp usampler2DArray;
uniform usampler2DArray views, valid;
uniform bool masked, alone; // whether some samples are not valid; whether there is one view only
uniform sampler2D weights;
uniform int row, count;   // row of the aperture, views in it
uniform ivec2 size;       // of a view: columns, rows
uniform ivec2 tiles;      // views in one layer: across, down
uniform float first, step_, detail, down; // shifts of the views for alpha = 0: along s, and that of their row along t
uniform vec3 plane;       // 1 - alpha in the first sample, and its growth down and across
out vec4 total;
${CUBIC}
void main() {
  ivec2 place = ivec2(gl_FragCoord.xy);
  float column_ = float(place.x) / detail, still = plane.x + plane.z * column_;
  float line = (float(place.y) - down * still) / (1.0 + down * plane.y); // of the picture, which this row of the view goes to
  float defocus = still + plane.y * line;
  float at = column_ + defocus * first;
  total = vec4(0.0);
  for (int u = 0; u < count; u++) {
    float weight = texelFetch(weights, ivec2(u, row), 0).r;
    if (weight == 0.0) continue;
    float x = at + defocus * float(u) * step_, below = floor(x);
    vec4 k = weight * cubic(x - below);
    int index = row * count + u, tile = index % (tiles.x * tiles.y), left = int(below) - 1;
    ivec2 corner = ivec2(tile % tiles.x, tile / tiles.x) * size;
    for (int i = 0; i < 4; i++) {
      int column = left + i;
      if (k[i] == 0.0) continue;
      if (alone) column = clamp(column, 0, size.x - 1); // nothing else shows what is beyond the edge
      else if (column < 0 || column >= size.x) continue; // beyond the edge nothing is seen
      ivec3 from = ivec3(corner + ivec2(column, place.y), index / (tiles.x * tiles.y));
      if (masked && texelFetch(valid, from, 0).r == 0u) continue;
      total += k[i] * vec4(vec3(texelFetch(views, from, 0).rgb), 1.0);
    }
  }
}`;

/** Sum over the rows of the aperture, moved along t, divided by the weight that was seen. */
export const SHEAR_COLUMN = `#version 300 es
precision highp float; precision highp int; precision highp sampler2DArray;
uniform sampler2DArray rows;
uniform sampler2D weights, shares; // of rows v; light that row v would give column x if all samples were valid
uniform bool alone, masked;
uniform int count;
uniform int height;
uniform float first, step_, detail;
uniform vec3 plane; // 1 - alpha in the first sample, and its growth down and across
out vec4 picture;
${CUBIC}
void main() {
  ivec2 place = ivec2(gl_FragCoord.xy);
  vec2 sample_ = vec2(place) / detail;
  float defocus = plane.x + plane.y * sample_.y + plane.z * sample_.x, at = sample_.y + defocus * first;
  vec4 total = vec4(0.0);
  float whole = 0.0;
  for (int v = 0; v < count; v++) {
    if (texelFetch(weights, ivec2(v, 0), 0).r == 0.0) continue;
    float share = masked ? texelFetch(shares, ivec2(place.x, v), 0).r : 0.0;
    float y = at + defocus * float(v) * step_, below = floor(y);
    vec4 k = cubic(y - below);
    int top = int(below) - 1;
    for (int i = 0; i < 4; i++) {
      int line = alone ? clamp(top + i, 0, height - 1) : top + i;
      if (line < 0 || line >= height) continue;
      total += k[i] * texelFetch(rows, ivec3(place.x, line, v), 0);
      whole += k[i] * share;
    }
  }
  // _LEAST_SEEN and _LEAST_VALID of lumigraph.rendering.refocus
  picture = vec4(total.a > 0.05 ? total.rgb / total.a : vec3(0.0), total.a > 0.3 * whole ? 1.0 : 0.0);
}`;

// Places that too few valid samples show take the nearest that is known, as lumigraph.refocus does; of several as near, the
// leftmost, then the uppermost. Two passes: the nearest of the own column, then of those.

/** How far off the nearest known sample of the own column is: (rows down, 1), or (0, 0) where there is none. */
export const NEAREST_ROW = `#version 300 es
precision highp float; precision highp int;
uniform sampler2D source;
uniform int height;
out vec4 found;
void main() {
  ivec2 place = ivec2(gl_FragCoord.xy);
  found = vec4(0.0);
  for (int step = 0; step < height; step++) {
    bool above = place.y - step >= 0 && texelFetch(source, place - ivec2(0, step), 0).a > 0.0;
    bool below = place.y + step < height && texelFetch(source, place + ivec2(0, step), 0).a > 0.0;
    if (above || below) { found = vec4(above ? -step : step, 1.0, 0.0, 0.0); return; }
  }
}`;

export const CLOSE = `#version 300 es
precision highp float; precision highp int;
uniform sampler2D source, nearest;
uniform int width;
out vec4 picture;
void main() {
  ivec2 place = ivec2(gl_FragCoord.xy), from = place;
  picture = texelFetch(source, place, 0);
  if (picture.a > 0.0) return;
  float least = 1e18;
  for (int step = 0; step < width && float(step) * float(step) <= least; step++) for (int side = -1; side <= 1; side += 2) {
    int x = place.x + side * step;
    if (x < 0 || x >= width || (step == 0 && side > 0)) continue;
    vec2 off = texelFetch(nearest, ivec2(x, place.y), 0).rg;
    float far = float(step) * float(step) + off.x * off.x;
    if (off.y > 0.0 && (far < least || (far == least && x < from.x))) { least = far; from = ivec2(x, place.y + int(off.x)); }
  }
  picture = vec4(texelFetch(source, from, 0).rgb, 1.0);
}`;

const SOURCE = (whole) => `#version 300 es
precision highp float; precision highp int;
${whole ? "precision highp usampler2DArray; uniform usampler2DArray source;" : "uniform sampler2D source;"}
uniform ivec2 size;  // of the picture
uniform int stride;  // pixels between the samples of a kernel
vec3 raw(ivec2 p) {
  p = clamp(p, ivec2(0), size - 1);
  return ${whole ? "vec3(texelFetch(source, ivec3(p, 0), 0).rgb)" : "texelFetch(source, p, 0).rgb"};
}`;

/** Bilateral filter (Tomasi and Manduchi 1998): the mean of near pixels that differ by no more than noise does. */
export const DENOISE = (whole) => `${SOURCE(whole)}
uniform float width, channels; // standard deviations of the noise that are averaged, in numbers of the picture
out vec4 picture;
void main() {
  ivec2 place = ivec2(gl_FragCoord.xy);
  vec3 here = raw(place), total = vec3(0.0);
  float sum = 0.0;
  for (int j = -3; j <= 3; j++) for (int i = -3; i <= 3; i++) {
    vec3 other = raw(place + stride * ivec2(i, j)), off = (other - here) / width;
    float k = exp(-0.125 * float(i * i + j * j) - dot(off, off) / (2.0 * channels));
    total += k * other;
    sum += k;
  }
  picture = vec4(total / sum, 1.0);
}`;

/** Unsharp mask where the picture is in focus. */
export const SHARPEN = (whole) => `${SOURCE(whole)}
uniform sampler2D focus;         // how much each lenslet's place is in focus
uniform ivec2 grid;              // of lenslets
uniform vec2 origin;             // the picture's first pixel, in lenslets
uniform float factor, amount;    // lenslets for a pixel
out vec4 picture;
float lenslet(ivec2 p) { return texelFetch(focus, clamp(p, ivec2(0), grid - 1), 0).r; }
void main() {
  ivec2 place = ivec2(gl_FragCoord.xy);
  vec3 here = raw(place), blurred = vec3(0.0);
  float sum = 0.0;
  for (int j = -3; j <= 3; j++) for (int i = -3; i <= 3; i++) {
    float k = exp(-0.22 * float(i * i + j * j)); // a standard deviation of 1.5 samples
    blurred += k * raw(place + stride * ivec2(i, j));
    sum += k;
  }
  vec2 at = origin + factor * vec2(place), below = floor(at), f = at - below;
  ivec2 p = ivec2(below);
  float share = mix(mix(lenslet(p), lenslet(p + ivec2(1, 0)), f.x), mix(lenslet(p + ivec2(0, 1)), lenslet(p + ivec2(1, 1)), f.x), f.y);
  picture = vec4(max(vec3(0.0), here + amount * share * (here - blurred / sum)), 1.0);
}`;

/** A picture on the screen: zoomed, exposed, coloured. */
export const SHOW = (whole) => `#version 300 es
precision highp float; precision highp int;
${whole ? "precision highp usampler2DArray; uniform usampler2DArray source;" : "uniform sampler2D source;"}
uniform sampler2D colours;
uniform ivec2 size, turn;  // of the picture; cosine and sine by which it is turned
uniform int layer;
uniform vec2 origin, scale; // of the picture's first sample on the target [px], and target px per sample
uniform float height;      // of the target, to turn it over; 0 leaves it
uniform bool smooth_, coloured;
uniform vec3 ground, mixing, balance;
uniform float gain, lift, power;
out vec4 colour;

vec3 raw(ivec2 p) {
  p = clamp(p, ivec2(0), size - 1);
  return ${whole ? "vec3(texelFetch(source, ivec3(p, layer), 0).rgb)" : "texelFetch(source, p, 0).rgb"};
}
vec3 value(vec2 place) {
  if (scale.x < 1.0 || scale.y < 1.0) { // made smaller: the mean of what falls into the target's pixel
    vec2 reach = max(vec2(1.0), 1.0 / scale);
    ivec2 n = ivec2(clamp(ceil(reach), vec2(1.0), vec2(8.0)));
    vec3 total = vec3(0.0);
    for (int j = 0; j < n.y; j++) for (int i = 0; i < n.x; i++)
      total += raw(ivec2(floor(place + 0.5 + ((vec2(i, j) + 0.5) / vec2(n) - 0.5) * reach)));
    return total / float(n.x * n.y);
  }
  if (!smooth_) return raw(ivec2(floor(place + 0.5)));
  vec2 below = floor(place), f = place - below;
  ivec2 p = ivec2(below);
  return mix(mix(raw(p), raw(p + ivec2(1, 0)), f.x), mix(raw(p + ivec2(0, 1)), raw(p + ivec2(1, 1)), f.x), f.y);
}
void main() {
  vec2 target = vec2(gl_FragCoord.x, height > 0.0 ? height - gl_FragCoord.y : gl_FragCoord.y);
  vec2 off = target - origin;
  vec2 place = vec2(float(turn.x) * off.x + float(turn.y) * off.y, float(turn.x) * off.y - float(turn.y) * off.x) / scale;
  if (any(lessThan(place, vec2(-0.5))) || any(greaterThanEqual(place, vec2(size) - 0.5))) {
    colour = vec4(ground, 1.0);
    return;
  }
  vec3 x = value(place);
  if (coloured) {
    colour = vec4(pow(clamp(balance * (gain * x + lift), 0.0, 1.0), vec3(power)), 1.0);
  } else {
    float level = pow(clamp(dot(balance * (gain * x + lift), mixing), 0.0, 1.0), power);
    colour = vec4(texelFetch(colours, ivec2(int(floor(level * 255.0 + 0.5)), 0), 0).rgb, 1.0);
  }
}`;
