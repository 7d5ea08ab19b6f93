"use strict";

// Most pixels of decoded pictures in memory: 4 bytes each.
const KEPT_PIXELS = 96e6;

/* Cache of decoded pictures, which are decoded ahead: those near the shown point first. */
class Gallery {
  #decoded = new Map();
  #pending = new Map();
  #pixels = 0;
  #points;

  constructor(points) {
    this.#points = points;
  }

  /* Return the picture if it is decoded, else undefined; null where there is none. */
  at(point) {
    if (point.picture === null) return null;
    const picture = this.#decoded.get(point);
    if (picture !== undefined) {
      this.#decoded.delete(point);
      this.#decoded.set(point, picture);
    }
    return picture;
  }

  async decode(point) {
    if (point.picture === null || this.#decoded.has(point)) return;
    if (!this.#pending.has(point)) this.#pending.set(point, this.#load(point).finally(() => this.#pending.delete(point)));
    await this.#pending.get(point);
  }

  async #load(point) {
    const image = new Image();
    image.src = point.picture;
    await image.decode();
    const picture = await createImageBitmap(image);
    this.#decoded.set(point, picture);
    this.#pixels += picture.width * picture.height;
    for (const [other, oldest] of this.#decoded) {
      if (this.#pixels <= KEPT_PIXELS || other === point) break;
      this.#decoded.delete(other);
      this.#pixels -= oldest.width * oldest.height;
      oldest.close();
    }
  }

  /* Decode the pictures near a point, nearest first, one after the other; a later call ends an earlier one. */
  async near(index) {
    const away = (point) => Math.hypot(...point.index.map((number, axis) => number - index[axis]));
    const asked = (this.wanted = index);
    let pixels = 0;
    for (const point of this.#points.filter(({ picture }) => picture !== null).sort((a, b) => away(a) - away(b))) {
      await this.decode(point);
      const picture = this.at(point);
      pixels += picture === undefined ? 0 : picture.width * picture.height;
      if (this.wanted !== asked || pixels > KEPT_PIXELS / 2) return;
    }
  }
}
