// WebGL 2: textures of whole numbers, programs, and pictures on the screen.

import { SHOW, VERTEX } from "./shaders.js";
import { cachedMap, channelWeights } from "./tone.js";

/** A device on a canvas; null where there is no WebGL 2 that can draw into floats. */
export function openDevice(canvas) {
  const gl = canvas.getContext("webgl2", { antialias: false, alpha: false, powerPreference: "high-performance" });
  return gl?.getExtension("EXT_color_buffer_float") ? new Device(canvas, gl) : null;
}

class Device {
  kind = "webgl";

  constructor(canvas, gl) {
    Object.assign(this, { canvas, gl, programs: new Map(), maps: new Map(), images: new WeakMap() });
    this.most = { layers: gl.getParameter(gl.MAX_ARRAY_TEXTURE_LAYERS), side: gl.getParameter(gl.MAX_TEXTURE_SIZE) };
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.bindVertexArray(gl.createVertexArray());
  }

  /** A program of one fragment shader, with its uniforms by name. */
  program(name, source) {
    if (this.programs.has(name)) return this.programs.get(name);
    const { gl } = this, program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, source]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
      const logs = gl.getAttachedShaders(program).map((shader) => gl.getShaderInfoLog(shader)).join(" ");
      throw new Error(`shader ${name}: ${gl.getProgramInfoLog(program)} ${logs}`);
    }
    const uniforms = {};
    for (let k = 0; k < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); k++) {
      const info = gl.getActiveUniform(program, k);
      uniforms[info.name] = gl.getUniformLocation(program, info.name);
    }
    this.programs.set(name, { program, uniforms });
    return this.programs.get(name);
  }

  /** A texture that is read sample by sample. */
  texture(target) {
    const { gl } = this, texture = gl.createTexture();
    gl.bindTexture(target, texture);
    for (const [name, value] of [
      [gl.TEXTURE_MIN_FILTER, gl.NEAREST], [gl.TEXTURE_MAG_FILTER, gl.NEAREST],
      [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE],
    ]) gl.texParameteri(target, name, value);
    return texture;
  }

  /** Formats of whole numbers: [stored, given, type]. */
  formats(bits, channels) {
    const { gl } = this;
    return [
      { 8: { 1: gl.R8UI, 3: gl.RGB8UI }, 16: { 1: gl.R16UI, 3: gl.RGB16UI } }[bits][channels],
      channels === 1 ? gl.RED_INTEGER : gl.RGB_INTEGER, bits === 8 ? gl.UNSIGNED_BYTE : gl.UNSIGNED_SHORT,
    ];
  }

  /** An empty array of layers of whole numbers. */
  layers(bits, channels, [nx, ny, n]) {
    const { gl } = this, texture = this.texture(gl.TEXTURE_2D_ARRAY);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, this.formats(bits, channels)[0], nx, ny, n);
    return { texture, bits, channels };
  }

  fill(array, [x, y, layer], [nx, ny], numbers) {
    const { gl } = this, [, format, type] = this.formats(array.bits, array.channels);
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, array.texture);
    gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, 0, x, y, layer, nx, ny, 1, format, type, numbers);
  }

  /** Float textures to draw into: one, or `layers` of them. */
  floats(nx, ny, layers = 0) {
    const { gl } = this, target = layers ? gl.TEXTURE_2D_ARRAY : gl.TEXTURE_2D, texture = this.texture(target);
    if (layers) gl.texStorage3D(target, 1, gl.RGBA32F, nx, ny, layers);
    else gl.texStorage2D(target, 1, gl.RGBA32F, nx, ny);
    return texture;
  }

  /** Draws with a program into a texture, one of its layers, or (null) the canvas. */
  draw({ program, uniforms }, [nx, ny], target, set, layer = -1) {
    const { gl } = this;
    this.buffer ??= gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, target ? this.buffer : null);
    if (target && layer >= 0) gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, target, 0, layer);
    else if (target) gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, target, 0);
    gl.viewport(0, 0, nx, ny);
    gl.useProgram(program);
    set(uniforms, gl);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  bind(unit, target, texture, place) {
    const { gl } = this;
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(target, texture);
    gl.uniform1i(place, unit);
  }

  /** The texture of an image that came as numbers: made when it is first shown. */
  textureOf(image) {
    const { gl } = this;
    if (image.texture) return image.texture;
    if (!this.images.has(image.numbers)) {
      const array = this.layers(image.bits, image.channels, [image.nx, image.ny, 1]);
      this.fill(array, [0, 0, 0], [image.nx, image.ny], image.numbers);
      this.images.set(image.numbers, array.texture);
    }
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, null);
    return this.images.get(image.numbers);
  }

  forget(image) {
    const texture = image && this.images.get(image.numbers);
    if (texture) this.gl.deleteTexture(texture);
    if (texture) this.images.delete(image.numbers);
  }

  map(name) {
    const { gl } = this;
    if (!this.maps.has(name)) {
      const texture = this.texture(gl.TEXTURE_2D);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(cachedMap(name)));
      this.maps.set(name, texture);
    }
    return this.maps.get(name);
  }

  fits(image) {
    return Math.max(image.nx, image.ny) <= this.most.side;
  }

  /** Shows an image: {nx, ny, channels, bits, numbers} or {nx, ny, channels, texture (floats)}. */
  show(image, { origin, scale, smooth, ground, clip, turn = 0 }, tone, target = null) {
    const whole = !image.texture, weights = channelWeights(tone.channel);
    const texture = this.textureOf(image), map = this.map(tone.map);
    const size = target ? [image.nx, image.ny] : [this.canvas.width, this.canvas.height];
    if (clip) this.clipTo(clip, size[1]);
    this.draw(this.program(whole ? "show-whole" : "show", SHOW(whole)), size, target, (at, gl) => {
      this.bind(0, whole ? gl.TEXTURE_2D_ARRAY : gl.TEXTURE_2D, texture, at.source);
      this.bind(1, gl.TEXTURE_2D, map, at.colours);
      gl.uniform2i(at.size, image.nx, image.ny);
      gl.uniform2i(at.turn, [1, 0, -1, 0][turn], [0, 1, 0, -1][turn]);
      if (at.layer) gl.uniform1i(at.layer, 0);
      gl.uniform2fv(at.origin, origin);
      gl.uniform2fv(at.scale, scale);
      gl.uniform1f(at.height, target ? 0 : size[1]);
      gl.uniform1i(at.smooth_, smooth ? 1 : 0);
      gl.uniform1i(at.coloured, image.channels === 3 && !weights ? 1 : 0);
      gl.uniform3fv(at.ground, ground ?? [0, 0, 0]);
      gl.uniform3fv(at.mixing, image.channels === 1 ? [1, 0, 0] : weights ?? [0, 0, 0]);
      gl.uniform1f(at.gain, tone.gain);
      gl.uniform1f(at.lift, tone.lift);
      gl.uniform3fv(at.balance, tone.balance ?? [1, 1, 1]);
      gl.uniform1f(at.power, tone.power);
    });
    this.everywhere();
  }

  /** What is drawn next changes a part of a texture only: from a corner (x, y) to another. */
  within([left, top], [right, bottom]) {
    const { gl } = this;
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(left, top, Math.max(0, right - left), Math.max(0, bottom - top));
  }

  everywhere() {
    this.gl.disable(this.gl.SCISSOR_TEST);
  }

  /** What is drawn next changes a part of the canvas only: [left, top, right, bottom] from its upper left corner. */
  clipTo(clip, height) {
    const [left, top, right, bottom] = clip.map(Math.round);
    this.within([left, height - bottom], [right, height - top]);
  }

  /** Bytes r, g, b, a of an image in its own size, as it is shown. */
  pixels(image, tone) {
    const { gl } = this, target = this.texture(gl.TEXTURE_2D), bytes = new Uint8ClampedArray(4 * image.nx * image.ny);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA8, image.nx, image.ny);
    this.show(image, { origin: [0.5, 0.5], scale: [1, 1], smooth: false }, tone, target);
    gl.readPixels(0, 0, image.nx, image.ny, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(bytes.buffer));
    gl.deleteTexture(target);
    return bytes;
  }

  /** Numbers r, g, b, a of samples of a drawn texture, from one on. */
  sample(image, x, y, nx = 1, ny = 1) {
    const { gl } = this, numbers = new Float32Array(4 * nx * ny);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.buffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, image.texture, 0);
    gl.readPixels(x, y, nx, ny, gl.RGBA, gl.FLOAT, numbers);
    return numbers;
  }

  /** Waits until everything is drawn. */
  finish() {
    const { gl } = this, bound = gl.checkFramebufferStatus(gl.FRAMEBUFFER) && gl.getParameter(gl.FRAMEBUFFER_BINDING);
    if (bound) gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.FLOAT, new Float32Array(4));
    else gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  }
}
