// Refocused pictures by WebGL: views moved and summed along u, then along v, as lumigraph.refocus does.

import { alphaAt, cornersOf, viewShifts } from "./aperture.js";
import { CLOSE, NEAREST_ROW, SHEAR_COLUMN, SHEAR_ROW } from "./shaders.js";

/** Views in one layer of the texture (across, down): one, where there are layers enough. */
function tiling(views, most) {
  const [nv, nu, nt, ns] = views.shape, needed = Math.ceil((nv * nu) / most.layers);
  const across = Math.min(needed, Math.floor(most.side / ns));
  const down = Math.ceil(needed / Math.max(across, 1));
  if (across < 1 || down * nt > most.side) throw new Error(`${nv} × ${nu} views of ${nt} × ${ns} are too many`);
  return [across, down];
}

/** Keys' cubic convolution, as in the shaders. */
function cubic(f) {
  return [((2 - f) * f - 1) * f, (3 * f - 5) * f * f + 2, ((4 - 3 * f) * f + 1) * f, (f - 1) * f * f].map((k) => k / 2);
}

/** How much of the views of each row v of the aperture falls on each column of a picture (v, x). */
function rowShares(weights, [nv, nu, nx, ns], { first, step }, detail, alone) {
  const shares = new Float32Array(nv * nx);
  for (let u = 0; u < nu; u++) for (let x = 0; x < nx; x++) {
    const at = x / detail + first + u * step, below = Math.floor(at);
    const seen = cubic(at - below).reduce((sum, k, i) => sum + (alone || (below + i >= 1 && below + i <= ns) ? k : 0), 0);
    for (let v = 0; v < nv; v++) shares[v * nx + x] += weights[v * nu + u] * seen;
  }
  return shares;
}

export class Refocuser {
  constructor(device, views) {
    Object.assign(this, { device, views, tiles: tiling(views, device.most) });
    const [nv, nu, nt, ns] = views.shape, [across, down] = this.tiles;
    this.size = [across * ns, down * nt, Math.ceil((nv * nu) / (across * down))];
    this.array = device.layers(views.bits, views.channels, this.size);
    this.mask = device.layers(8, 1, views.masked ? this.size : [1, 1, 1]);
  }

  /** Adds views: `numbers` of `count` of them, from the first. */
  add(first, count, numbers, array = this.array) {
    const { device, tiles: [across, down] } = this, [, , nt, ns] = this.views.shape;
    const size = nt * ns * array.channels;
    for (let k = 0; k < count; k++) {
      const index = first + k, tile = index % (across * down);
      const corner = [(tile % across) * ns, Math.floor(tile / across) * nt, Math.floor(index / (across * down))];
      device.fill(array, corner, [ns, nt], numbers.subarray(k * size, (k + 1) * size));
    }
  }

  /** Adds a part of one view: its rows and columns from a corner. */
  addPart(index, [y, x], [ny, nx], numbers, array) {
    const { tiles: [across, down] } = this, [, , nt, ns] = this.views.shape, tile = index % (across * down);
    this.device.fill(array, [(tile % across) * ns + x, Math.floor(tile / across) * nt + y, Math.floor(index / (across * down))], [nx, ny], numbers);
  }

  release() {
    for (const texture of [this.array.texture, this.mask.texture, this.rows, this.target, this.nearest, this.whole]) if (texture) this.device.gl.deleteTexture(texture);
  }

  /** The picture focused on a plane (`planeOf` of aperture.js): {nx, ny, channels, texture}; `alone`: of one view, which has no black edge. */
  picture(plane, weights, detail, alone = false) {
    const work = this.drawing(plane, weights, detail, alone);
    this.key = null;
    for (;;) { const { done, value } = work.next(); if (done) return value; }
  }

  /** The same in steps, one for each row of the aperture; of valid views, only a part {start, end} of the picture. */
  *drawing(plane, weights, detail, alone = false, part = null) {
    const { device, views } = this, [nv, nu, nt, ns] = views.shape;
    const nx = (ns - 1) * detail + 1, ny = (nt - 1) * detail + 1;
    this.prepare(nx, ny);
    const used = new Float32Array(nv);
    for (let v = 0; v < nv; v++) used[v] = weights.subarray(v * nu, (v + 1) * nu).some((w) => w > 0) ? 1 : 0;
    const all = this.weights(weights, nu, nv), rows = this.weights(used, nv, 1);
    const across = viewShifts(views, 0, 1), along = viewShifts(views, 0, 0), lean = [1 - plane.corner, -plane.slope[0], -plane.slope[1]];
    const middle = 1 - alphaAt(plane, [(nt - 1) / 2, (ns - 1) / 2]), most = Math.max(...cornersOf(plane, [nt, ns]).map((alpha) => Math.abs(1 - alpha)));
    const shear = device.program("shear-row", SHEAR_ROW), made = [all, rows];
    const cut = !views.masked && part, reach = cut && 2 + Math.ceil(most * Math.max(...[0, nv - 1].map((v) => Math.abs(along.first + v * along.step))));
    const within = (margin, draw) => {
      if (cut) device.within([cut.start[1], cut.start[0] - margin], [cut.end[1], cut.end[0] + margin]);
      draw();
      if (cut) device.everywhere();
    };
    try {
      for (let v = 0; v < nv; v++) if (used[v]) {
        within(reach, () => device.draw(shear, [nx, nt], this.rows, (at, gl) => {
        device.bind(0, gl.TEXTURE_2D_ARRAY, this.array.texture, at.views);
        device.bind(1, gl.TEXTURE_2D, all, at.weights);
        device.bind(2, gl.TEXTURE_2D_ARRAY, this.mask.texture, at.valid);
        gl.uniform1i(at.masked, views.masked ? 1 : 0);
        gl.uniform1i(at.alone, alone ? 1 : 0);
        gl.uniform1i(at.row, v);
        gl.uniform1i(at.count, nu);
        gl.uniform2i(at.size, ns, nt);
        gl.uniform2i(at.tiles, ...this.tiles);
        gl.uniform3fv(at.plane, lean);
        gl.uniform1f(at.down, along.first + v * along.step);
        gl.uniform1f(at.first, across.first);
        gl.uniform1f(at.step_, across.step);
        gl.uniform1f(at.detail, detail);
      }, v));
        yield;
      }
      const shares = views.masked ? this.weights(rowShares(weights, [nv, nu, nx, ns], { first: middle * across.first, step: middle * across.step }, detail, alone), nx, nv) : rows;
      made.push(shares);
      within(0, () => device.draw(device.program("shear-column", SHEAR_COLUMN), [nx, ny], this.target, (at, gl) => {
        device.bind(0, gl.TEXTURE_2D_ARRAY, this.rows, at.rows);
        device.bind(1, gl.TEXTURE_2D, rows, at.weights);
        device.bind(2, gl.TEXTURE_2D, shares, at.shares);
        gl.uniform1i(at.masked, views.masked ? 1 : 0);
        gl.uniform1i(at.count, nv);
        gl.uniform1i(at.alone, alone ? 1 : 0);
        gl.uniform1i(at.height, nt);
        gl.uniform3fv(at.plane, lean);
        gl.uniform1f(at.first, along.first);
        gl.uniform1f(at.step_, along.step);
        gl.uniform1f(at.detail, detail);
      }));
    } finally {
      for (const texture of new Set(made)) device.gl.deleteTexture(texture);
    }
    return { nx, ny, channels: views.channels, texture: views.masked ? this.closed(nx, ny) : this.target };
  }

  /** The picture with its unknown places filled. */
  closed(nx, ny) {
    const { device } = this;
    device.draw(device.program("nearest-row", NEAREST_ROW), [nx, ny], this.nearest, (at, gl) => {
      device.bind(0, gl.TEXTURE_2D, this.target, at.source);
      gl.uniform1i(at.height, ny);
    });
    device.draw(device.program("close", CLOSE), [nx, ny], this.whole, (at, gl) => {
      device.bind(0, gl.TEXTURE_2D, this.target, at.source);
      device.bind(1, gl.TEXTURE_2D, this.nearest, at.nearest);
      gl.uniform1i(at.width, nx);
    });
    return this.whole;
  }

  prepare(nx, ny) {
    if (this.width === nx && this.height === ny) return;
    const { gl } = this.device, [nv, , nt] = this.views.shape;
    for (const texture of [this.rows, this.target, this.nearest, this.whole]) if (texture) gl.deleteTexture(texture);
    Object.assign(this, { width: nx, height: ny });
    this.rows = this.device.floats(nx, nt, nv);
    this.target = this.device.floats(nx, ny);
    if (this.views.masked) [this.nearest, this.whole] = [this.device.floats(nx, ny), this.device.floats(nx, ny)];
  }

  weights(values, nx, ny) {
    const { gl } = this.device, texture = this.device.texture(gl.TEXTURE_2D);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R32F, nx, ny, 0, gl.RED, gl.FLOAT, values);
    return texture;
  }
}
