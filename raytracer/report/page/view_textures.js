"use strict";

/* Shared by the pages of light fields: the views as layers of a texture in linear light, and what comes with them.

   A page defines `painter`, which draws it, and `update`, which has it draw what is new. */

class Trouble extends Error {}

/* Covers the picture with one triangle. */
const FULL_SCREEN = `#version 300 es
void main() { gl_Position = vec4(vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0), 0.0, 1.0); }`;

/* The light that the 8 bits of a view stand for: those of sRGB up to a share of the codes, beyond that logarithms. */
const DECODE = `#version 300 es
precision highp float;
uniform highp sampler2D view;
uniform float share, peak;
out vec4 light;
vec3 linear(vec3 code) { return mix(pow((code + 0.055) / 1.055, vec3(2.4)), code / 12.92, lessThanEqual(code, vec3(0.04045))); }
void main() {
  vec3 code = texelFetch(view, ivec2(gl_FragCoord.xy), 0).rgb;
  vec3 bright = exp2((code - share) / (1.0 - share) * log2(peak));
  light = vec4(mix(linear(min(code / share, 1.0)), bright, greaterThan(code, vec3(share))), 1.0);
}`;

/* For shaders: what a display shows of light. */
const ENCODE = `
vec3 encode(vec3 linear) {
  vec3 light = clamp(linear, 0.0, 1.0);
  return mix(1.055 * pow(light, vec3(1.0 / 2.4)) - 0.055, 12.92 * light, lessThanEqual(light, vec3(0.0031308)));
}`;

function bytesOf(base64) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let place = 0; place < text.length; place++) bytes[place] = text.charCodeAt(place);
  return bytes;
}

/* WebGL 2 of a canvas; `use` is what needs it. */
function webglOf(canvas, use) {
  const gl = canvas.getContext("webgl2", { antialias: false, depth: false, alpha: true });
  if (!gl) throw new Trouble(`This browser has no WebGL 2, which ${use} need.`);
  if (gl.isContextLost()) throw new Trouble("This browser's WebGL has stopped; load the page again to look around.");
  gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
  gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, false);
  return gl;
}

function programOf(gl, fragment, vertex = FULL_SCREEN) {
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
    throw new Trouble("This browser's WebGL does not take the page's shaders.");
  }
  return { program, place: (name) => gl.getUniformLocation(program, name) };
}

function textureOf(gl, kind, filter) {
  const texture = gl.createTexture();
  gl.bindTexture(kind, texture);
  for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(kind, side, filter);
  for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(kind, side, gl.CLAMP_TO_EDGE);
  return texture;
}

/* The views as layers of a texture in linear light; `code`: {share, peak}, how 8 bits hold light. */
class ViewTextures {
  constructor(gl, width, height, count, code) {
    Object.assign(this, { gl, width, height, code, ldr: code.peak <= 1, there: new Set() });
    // Views brighter than white are drawn into the texture, which takes one of these.
    if (!this.ldr && !gl.getExtension("EXT_color_buffer_float") && !gl.getExtension("EXT_color_buffer_half_float")) {
      throw new Trouble("This browser's WebGL cannot hold light beyond white, which this light field has.");
    }
    const most = Math.min(gl.getParameter(gl.MAX_TEXTURE_SIZE), gl.getParameter(gl.MAX_3D_TEXTURE_SIZE));
    if (Math.max(width, height) > most || count > gl.getParameter(gl.MAX_ARRAY_TEXTURE_LAYERS)) {
      throw new Trouble(`This browser's WebGL holds no more than ${most} pixels in a row: too few for these views.`);
    }
    this.layers = textureOf(gl, gl.TEXTURE_2D_ARRAY, gl.LINEAR);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, this.ldr ? gl.SRGB8_ALPHA8 : gl.RGBA16F, width, height, count);
    if (!this.ldr) {
      this.decodes = programOf(gl, DECODE);
      this.coded = textureOf(gl, gl.TEXTURE_2D, gl.NEAREST);
      gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA8, width, height);
      this.target = gl.createFramebuffer();
    }
  }

  /* Take a view's picture. */
  put(number, picture) {
    const { gl, width, height } = this;
    gl.activeTexture(gl.TEXTURE0);
    if (this.ldr) {
      gl.bindTexture(gl.TEXTURE_2D_ARRAY, this.layers);
      gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, 0, 0, 0, number, width, height, 1, gl.RGBA, gl.UNSIGNED_BYTE, picture);
    } else {
      gl.bindTexture(gl.TEXTURE_2D, this.coded);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, picture);
      gl.bindFramebuffer(gl.FRAMEBUFFER, this.target);
      gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, this.layers, 0, number);
      gl.viewport(0, 0, width, height);
      gl.useProgram(this.decodes.program);
      gl.uniform1i(this.decodes.place("view"), 0);
      gl.uniform1f(this.decodes.place("share"), this.code.share);
      gl.uniform1f(this.decodes.place("peak"), this.code.peak);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
      gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    }
    this.there.add(number);
  }
}

/* Decode a picture that is a data URI. */
function decodePicture(uri) {
  const [head, content] = uri.split(",");
  const blob = new Blob([bytesOf(content)], { type: /data:(.*?);/.exec(head)[1] });
  return createImageBitmap(blob, { colorSpaceConversion: "none", premultiplyAlpha: "none" });
}

/* Have a painter take all views, in an order, as they are decoded, some ahead; or show the still picture.

   make : makes the painter, or throws Trouble.
   picturesOf : the data URIs of a view.
   put : gives a painter a view's number and pictures. */
async function loadOnto(make, order, picturesOf, put) {
  try {
    const mine = make();
    if (!(await decodeInto(mine, order, picturesOf, put))) return;
  } catch (error) {
    if (!(error instanceof Trouble)) throw error;
    painter = null;
    showStill(error.message);
    return;
  }
  find("#loading").hidden = true;
  update();
  document.body.dataset.views = String(order.length);
}

/* Returns false where the painter is not the one of the page any more. */
async function decodeInto(mine, order, picturesOf, put) {
  const [bar, words] = [find("#loading progress"), find("#loading span")];
  bar.max = order.length;
  find("#loading").hidden = false;
  const decode = (number) => Promise.all(picturesOf(number).map(decodePicture));
  const ahead = 4;
  const coming = order.slice(0, ahead).map(decode);
  for (const [place, number] of order.entries()) {
    if (place + ahead < order.length) coming.push(decode(order[place + ahead]));
    let bitmaps;
    try {
      bitmaps = await coming.shift();
    } catch {
      throw new Trouble("The views in this page cannot be read by this browser.");
    }
    if (mine !== painter || mine.gl.isContextLost()) return false;
    put(mine, number, ...bitmaps);
    for (const bitmap of bitmaps) bitmap.close();
    bar.value = place + 1;
    words.textContent = `${place + 1} of ${order.length} views`;
    if (place === 0 || (place + 1) % 8 === 0) update();
  }
  return true;
}

/* Save a picture as PNG. */
function saveAs(picture, name) {
  picture.toBlob((blob) => {
    const link = make("a", { href: URL.createObjectURL(blob), download: `${name}.png` });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  });
}

/* A copy of a canvas that WebGL draws into. */
function copyOf(canvas) {
  const copy = make("canvas", { width: canvas.width, height: canvas.height });
  copy.getContext("2d", { willReadFrequently: true }).drawImage(canvas, 0, 0);
  return copy;
}

/* Show a picture that does not need WebGL, and say why. */
function showStill(text) {
  find("#trouble").hidden = false;
  find("#trouble").textContent = `${text} Shown is the view from the middle.`;
  find("#loading").hidden = true;
  find("#picture").replaceWith(make("img", { id: "still", src: data.still, alt: "the light field from the middle" }));
  find("#camera").hidden = true;
  find("#help").hidden = find("#keys").hidden = true;
  document.body.dataset.failed = "";
}

/* Fill what is above the picture, and size its stage, which is returned: at most so `wide` on the screen. */
function fillStage(width, height, wide) {
  find("#name").textContent = data.name;
  find("#extent").textContent = data.extent;
  find("#notes").replaceChildren(...data.notes.map((note) => make("p", { class: "warning" }, note)));
  Object.assign(find("#picture"), { width, height });
  const stage = find("#stage");
  stage.style.setProperty("--shape", String(width / height));
  stage.style.setProperty("--wide", `${wide}px`);
  return stage;
}

// Stops around the exposure that a page begins with.
const EV_RANGE = 8;

const evText = (ev) => `${ev > 0 ? "+" : ""}${ev} EV`;

const roundedNumber = (value, digits = 5) => String(Number(value.toPrecision(digits)));

/* The number in a part of the address; NaN if there is none. */
const numberIn = (text) => (text === null || text.trim() === "" ? NaN : Number(text));
