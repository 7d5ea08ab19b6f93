"use strict";

/* Shaders of the page of views with poses of their own: surfaces drawn from the depth of views, and the blend of what
   they see, as in `raytracer.lightfield.kernels.view_surfaces` and `view_blending`. */

// Views that a picture is drawn of, those of them that are most like the camera, and those that a pixel is blended of.
const SLOTS = Math.min(16, data.views.length);
const ALIKE = 8;
const BLENDED = 4;

const hasDepth = data.views[0].depth !== undefined;

/* `surfaces`: one over the depth of a pixel of a view (-1: not known), its slopes right and down, and the greatest;
   `marks`: if it is drawn, if it sees nothing else, and if its surface breaks off to the right and down. */
const COMMON = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2DArray;
struct Camera { vec3 origin, right, up, forward; vec2 pixel, corner; };
uniform vec4 cameras[${4 * (SLOTS + 1)}];
uniform ivec2 size;
uniform vec2 target;
Camera cameraOf(int slot) {
  vec4 a = cameras[4 * slot], b = cameras[4 * slot + 1], c = cameras[4 * slot + 2], d = cameras[4 * slot + 3];
  return Camera(a.xyz, b.xyz, c.xyz, d.xyz, vec2(a.w, d.w), vec2(b.w, c.w));
}
vec3 pointAt(Camera c, vec2 place, float inverse) {
  return c.forward + (c.corner.x + c.pixel.x * place.x) * c.right + (c.corner.y - c.pixel.y * place.y) * c.up + inverse * c.origin;
}
vec3 seenBy(Camera c, vec3 point, float inverse) {
  vec3 ray = point - inverse * c.origin;
  return vec3(dot(ray, c.right), dot(ray, c.up), dot(ray, c.forward));
}
vec2 placeIn(Camera c, vec3 seen) { return vec2(seen.x / seen.z - c.corner.x, c.corner.y - seen.y / seen.z) / c.pixel; }
float rayAngle(Camera a, Camera b, vec3 point, float inverse) {
  vec3 u = point - inverse * a.origin, v = point - inverse * b.origin;
  return atan(length(cross(u, v)), dot(u, v));
}
`;

const LAYER_DEPTH = `
uniform sampler2DArray depths;
uniform float high;
float depthOf(ivec2 at) {
  vec2 bytes = floor(255.0 * texelFetch(depths, ivec3(at, number), 0).rg + 0.5);
  float code = 256.0 * bytes.x + bytes.y;
  float part = (code - 1.0) / 65534.0;
  return code < 0.5 ? -1.0 : high * part * part;
}`;

const PLANE_DEPTH = `
float depthOf(ivec2 at) {
  Camera view = cameraOf(slot);
  vec3 normal = cameraOf(${SLOTS}).forward;
  float away = -dot(normal, view.origin);
  float inverse = dot(normal, pointAt(view, vec2(at) + 0.5, 0.0)) / (away == 0.0 ? -1.0 : away);
  return inverse > 0.0 ? inverse : -1.0;
}`;

/* As `pixel_slopes` in raytracer/lightfield/kernels/view_surfaces.py, where STEEPEST, BEND and FLAT are explained. */
const SLOPES = `${COMMON}
uniform int number, slot;
${hasDepth ? LAYER_DEPTH : PLANE_DEPTH}
layout(location = 0) out vec4 surface;
layout(location = 1) out vec4 mark;
float depthAt(ivec2 at) {
  return any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, size)) ? -1.0 : depthOf(at);
}
bool isStep(ivec2 at, ivec2 by) {
  float pixel = cameraOf(slot).pixel.x, a = depthAt(at), b = depthAt(at + by);
  float change = abs(b - a);
  if (a < 0.0 || b < 0.0 || change > 6.0 * pixel * max(a, b)) return true;
  float before = depthAt(at - by), after = depthAt(at + 2 * by);
  float slope = max(before < 0.0 ? 0.0 : abs(a - before), after < 0.0 ? 0.0 : abs(after - b));
  return change > 2.0 * slope + pixel * max(a, b);
}
bool mayBeMean(ivec2 at, ivec2 by) {
  float here = depthAt(at), beyond = depthAt(at + by);
  if (beyond >= 0.0 && beyond < here && !isStep(at + by, by)) return true;
  if (isStep(at, -by) || isStep(at - by, -by)) return false;
  float first = depthAt(at - by), second = depthAt(at - 2 * by);
  return abs(here - 2.0 * first + second) > 0.25 * (abs(first - second) + cameraOf(slot).pixel.x * first);
}
ivec2 side(int number) { return (2 * (number & 1) - 1) * ivec2(1 - (number >> 1), number >> 1); }
bool isWhole(ivec2 at) {
  int neighbours = 0;
  for (int number = 0; number < 4; number++) {
    if (!isStep(at, side(number))) neighbours++;
    else if (mayBeMean(at, side(number))) return false;
  }
  return neighbours > 0;
}
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  float here = depthOf(at), most = 0.0;
  vec2 total = vec2(0.0), count = vec2(0.0);
  int neighbours = 0;
  bvec2 breaks = bvec2(false);
  for (int number = 0; number < 4; number++) {
    ivec2 by = side(number);
    int axis = number >> 1;
    if (isStep(at, by)) {
      if (by[axis] > 0) breaks[axis] = true;
      continue;
    }
    neighbours++;
    if (!isWhole(at + by)) continue;
    float change = depthAt(at + by) - here;
    total[axis] += float(by[axis]) * change;
    count[axis] += 1.0;
    most = max(most, abs(change));
  }
  surface = vec4(here, total / max(count, 1.0), most);
  mark = vec4(float(isWhole(at)), float(neighbours == 4), float(breaks.x), float(breaks.y));
}`;

const FETCH = `
uniform sampler2DArray surfaces, marks;
`;

/* One over the depth of the corners of a pixel, the means of the pixels around that are of its surface; -1: not drawn. */
const CORNERS = `${COMMON}${FETCH}
uniform int slot;
out vec4 corners;
bool goesOn(ivec2 at, ivec2 by, int axis) {
  ivec2 first = min(at, at + by);
  if (first[axis] < 0) return false;
  return texelFetch(marks, ivec3(first, slot), 0)[2 + axis] < 0.5 && texelFetch(marks, ivec3(at + by, slot), 0).x > 0.5;
}
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  corners = vec4(-1.0);
  vec4 found;
  if (texelFetch(marks, ivec3(at, slot), 0).x < 0.5) return;
  vec4 here = texelFetch(surfaces, ivec3(at, slot), 0);
  for (int corner = 0; corner < 4; corner++) {
    ivec2 by = ivec2(2 * (corner & 1) - 1, 2 * (corner >> 1) - 1);
    vec2 to = vec2(by);
    float total = here.x + 0.5 * (to.x * here.y + to.y * here.z), count = 1.0;
    if (goesOn(at, ivec2(by.x, 0), 0)) {
      vec4 beside = texelFetch(surfaces, ivec3(at + ivec2(by.x, 0), slot), 0);
      total += beside.x - 0.5 * (to.x * beside.y - to.y * beside.z);
      count += 1.0;
    }
    if (goesOn(at, ivec2(0, by.y), 1)) {
      vec4 beside = texelFetch(surfaces, ivec3(at + ivec2(0, by.y), slot), 0);
      total += beside.x + 0.5 * (to.x * beside.y - to.y * beside.z);
      count += 1.0;
    }
    found[corner] = max(total / count, 0.0);
  }
  corners = found;
}`;

/* Two triangles for each pixel of a view. */
const QUADS = `${COMMON}
uniform sampler2DArray surfaces, corners;
uniform int slot;
uniform float near, push;
out float inverse;
flat out float off;
void main() {
  int quad = gl_VertexID / 4, corner = gl_VertexID % 4;
  ivec2 at = ivec2(quad % size.x, quad / size.x);
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  off = 0.0;
  inverse = texelFetch(corners, ivec3(at, slot), 0)[corner];
  if (inverse < 0.0) return;
  vec4 here = texelFetch(surfaces, ivec3(at, slot), 0);
  Camera view = cameraOf(slot), camera = cameraOf(${SLOTS});
  vec2 place = vec2(at) + vec2(corner & 1, corner >> 1);
  vec3 seen = seenBy(camera, pointAt(view, place, inverse), inverse);
  // What the depth may be off by: its change over a pixel, and a pixel's own width, as a part of the depth.
  float ahead = seenBy(camera, pointAt(view, vec2(at) + 0.5, here.x), here.x).z;
  off = (view.pixel.x + (here.x > 0.0 ? here.w / here.x : 0.0)) / max(ahead, 1e-9);
  vec2 across = 2.0 * (seen.xy - camera.corner * seen.z) / (camera.pixel * target);
  // One over the depth is linear on the screen; views less like the camera stand back by what theirs may be off.
  float kept = inverse * (1.0 - min(push * off, 0.5));
  gl_Position = vec4(across.x - seen.z, across.y + seen.z, seen.z - 2.0 * near * kept, seen.z);
}`;

/* One over the depth in the picture, and what it may be off by; nothing as near as `limit`, as views saw through that. */
const SURFACE = `${COMMON}
uniform sampler2D limit;
in float inverse;
flat in float off;
out vec4 surface;
void main() {
  // gl_FragCoord.w is the mean of one over the distance ahead.
  float found = inverse * gl_FragCoord.w;
  if (found >= texelFetch(limit, ivec2(gl_FragCoord.xy), 0).r) discard;
  surface = vec4(found, off * found, 0.0, 1.0);
}`;

/* Where a view sees through the surface, it must be farther. */
const FALSE = `${COMMON}${FETCH}
uniform sampler2D limit, surface;
out vec4 next;
void main() {
  next = texelFetch(limit, ivec2(gl_FragCoord.xy), 0);
  vec4 known = texelFetch(surface, ivec2(gl_FragCoord.xy), 0);
  if (known.r <= 0.0) return;
  vec3 point = pointAt(cameraOf(${SLOTS}), vec2(gl_FragCoord.x, target.y - gl_FragCoord.y), known.r);
  for (int slot = 0; slot < ${SLOTS}; slot++) {
    Camera view = cameraOf(slot);
    vec3 seen = seenBy(view, point, known.r);
    if (seen.z <= 0.0) continue;
    ivec2 at = ivec2(floor(placeIn(view, seen)));
    if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, size))) continue;
    if (texelFetch(marks, ivec3(at, slot), 0).y < 0.5) continue;
    vec4 there = texelFetch(surfaces, ivec3(at, slot), 0);
    if (known.r / seen.z - there.x > known.g / seen.z + there.w + view.pixel.x * there.x) { next.r = known.r; return; }
  }
}`;

/* The views that see a point best, by the angle between their rays and by their resolution, and their blend. */
const BLEND = `${COMMON}${FETCH}${ENCODE}
uniform sampler2DArray views;
uniform sampler2D surface;
uniform int numbers[${SLOTS}];
uniform float gain;
out vec4 shown;
const float NONE = 1e30;
float offOf(vec4 known, float ahead) { return known.r > 0.0 ? known.g / (known.r * ahead) : 0.0; }
bool sees(vec4 there, vec4 mark, float pixel, float inverse, float off) {
  float slope = mark.x > 0.5 || mark.y > 0.5 ? there.w : 0.0;
  return there.x >= 0.0 && abs(inverse - there.x) <= off * inverse + slope + pixel * there.x;
}
/* By which share a view sees a point at a place, of the four pixels around it, and the share that sees nothing else. */
vec2 shareSeen(int slot, vec2 place, float inverse, float off) {
  vec2 low = floor(place - 0.5), part = place - 0.5 - low, shares = vec2(0.0);
  float pixel = cameraOf(slot).pixel.x;
  for (int j = 0; j < 4; j++) {
    ivec2 step = ivec2(j & 1, j >> 1);
    ivec3 at = ivec3(clamp(ivec2(low) + step, ivec2(0), size - 1), slot);
    vec4 mark = texelFetch(marks, at, 0);
    float weight = (step.x == 1 ? part.x : 1.0 - part.x) * (step.y == 1 ? part.y : 1.0 - part.y);
    if (sees(texelFetch(surfaces, at, 0), mark, pixel, inverse, off)) shares += weight * vec2(1.0, mark.y);
  }
  return shares;
}
vec4 cubic(float t) {
  // Of the neighbours -1 to 2 of a place t after neighbour 0 (Keys 1981).
  return 0.5 * vec4(((2.0 - t) * t - 1.0) * t, (3.0 * t - 5.0) * t * t + 2.0, ((4.0 - 3.0 * t) * t + 1.0) * t, (t - 1.0) * t * t);
}
/* What a view sees of a point, of its pixels that see it: cubic where all around do, else linear. */
vec3 sampled(int slot, vec2 place, float inverse, float off) {
  vec2 low = floor(place - 0.5), part = place - 0.5 - low;
  float pixel = cameraOf(slot).pixel.x;
  vec4 across = cubic(part.x), down = cubic(part.y);
  ivec2 first = ivec2(low) - 1;
  bool whole = all(greaterThanEqual(first, ivec2(0))) && all(lessThan(first + 3, size));
  vec4 linear = vec4(0.0);
  vec3 sum = vec3(0.0);
  for (int j = 0; j < 16; j++) {
    ivec2 step = ivec2(j & 3, j >> 2);
    ivec3 at = ivec3(clamp(first + step, ivec2(0), size - 1), slot);
    bool seen = sees(texelFetch(surfaces, at, 0), texelFetch(marks, at, 0), pixel, inverse, off);
    whole = whole && seen;
    if (!seen) continue;
    vec3 light = texelFetch(views, ivec3(at.xy, numbers[slot]), 0).rgb;
    sum += across[step.x] * down[step.y] * light;
    vec2 near = max(1.0 - abs(vec2(step) - 1.0 - part), 0.0);
    linear += near.x * near.y * vec4(light, 1.0);
  }
  return whole ? sum : linear.rgb / max(linear.a, 1e-9);
}
void main() {
  const int KEPT = ${BLENDED + 1};
  vec4 known = texelFetch(surface, ivec2(gl_FragCoord.xy), 0);
  shown = vec4(0.0);
  if (known.r < 0.0) return;
  Camera camera = cameraOf(${SLOTS});
  vec3 point = pointAt(camera, vec2(gl_FragCoord.x, target.y - gl_FragCoord.y), known.r);
  float penalties[KEPT];
  int best[KEPT];
  for (int i = 0; i < KEPT; i++) { penalties[i] = NONE; best[i] = 0; }
  for (int slot = 0; slot < ${SLOTS}; slot++) {
    Camera view = cameraOf(slot);
    vec3 seen = seenBy(view, point, known.r);
    if (seen.z <= 0.0) continue;
    vec2 place = placeIn(view, seen);
    if (any(lessThan(place, vec2(0.5))) || any(greaterThan(place, vec2(size) - 0.5))) continue;
    float penalty = rayAngle(view, camera, point, known.r) + max(seen.z * view.pixel.x / camera.pixel.x - 1.0, 0.0);
    if (penalty >= penalties[KEPT - 1]) continue;
    vec2 shares = shareSeen(slot, place, known.r / seen.z, offOf(known, seen.z));
    penalty += ${(0.5 * Math.PI).toFixed(9)} * (1.0 - shares.y);
    if (shares.x < 0.5 || penalty >= penalties[KEPT - 1]) continue;
    int last = KEPT - 1;
    while (last > 0 && penalties[last - 1] > penalty) {
      penalties[last] = penalties[last - 1];
      best[last] = best[last - 1];
      last--;
    }
    penalties[last] = penalty;
    best[last] = slot;
  }
  // Weights fall to 0 at the first view that is left out (Buehler et al., sec. 4).
  float farthest = penalties[KEPT - 1], total = 0.0;
  bool falls = farthest < NONE && farthest > penalties[0];
  vec3 sum = vec3(0.0);
  for (int i = 0; i < KEPT; i++) {
    if (falls && penalties[i] >= farthest || penalties[i] == NONE) continue;
    vec3 seen = seenBy(cameraOf(best[i]), point, known.r);
    // What 32 bits leave of the angle to a ray that a view has itself.
    float weight = (falls ? 1.0 - penalties[i] / farthest : 1.0) / max(penalties[i], 1e-6);
    sum += weight * sampled(best[i], placeIn(cameraOf(best[i]), seen), known.r / seen.z, offOf(known, seen.z));
    total += weight;
  }
  if (total > 0.0) shown = vec4(encode(gain * sum / total), 1.0);
}`;
