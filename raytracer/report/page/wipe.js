"use strict";

/* One picture, or two in the same place with a divider that is dragged (mouse, touch, arrow keys), to be looked at from
   near: fitted into the page, or with 1, 2, 4, ... pixels of the screen for each of their own.

     const wipe = new Wipe(element, left, right, { leftLabel: "A", rightLabel: "B", onmove: (position) => ... });
     wipe.show(left, right, "A", "B");     right may be null: then there is no divider
     wipe.position = 0.25;                 the left picture covers a quarter of what is seen
     wipe.zoom = 1;                        or 2, 4, 8, 0.5; "fit"

   A picture is a data: address, or whatever can be drawn (ImageBitmap, canvas, image).  Those that can be drawn are
   there at once; `await wipe.shown` waits for addresses.  Pictures of two sizes are stretched to that of the larger. */
class Wipe {
  #element;
  #frame;
  #view;
  #stage;
  #divider;
  #sides;
  #labels;
  #readout;
  #buttons = new Map();
  #two = false;
  #position = 0.5;
  #zoom = "fit";
  #asked = 0;
  #onmove;

  shown = Promise.resolve();

  constructor(element, left = null, right = null, { leftLabel = "", rightLabel = "", position = 0.5, onmove = null } = {}) {
    this.#element = element;
    this.#onmove = onmove;
    element.classList.add("wipe");

    // The right picture lies below, the left one is cut off at the divider.
    this.#sides = [make("canvas", { class: "wipe-left" }), make("canvas", { class: "wipe-right" })];
    this.#labels = [make("span", { class: "wipe-label left" }), make("span", { class: "wipe-label right" })];
    this.#stage = make("div", { class: "wipe-stage" }, this.#sides[1], this.#sides[0]);
    this.#view = make("div", { class: "wipe-view" }, this.#stage);
    this.#divider = make("div", {
      class: "wipe-divider", role: "slider", tabindex: "0", "aria-label": "divider between the pictures",
      "aria-valuemin": "0", "aria-valuemax": "100",
    });
    this.#frame = make("div", { class: "wipe-frame" }, this.#view, ...this.#labels, this.#divider);
    this.#readout = make("output", { "aria-live": "off" });
    const bar = make("div", { class: "wipe-bar" });
    for (const [zoom, text, title] of [
      ["fit", "Fit", "the whole picture (0)"], [1, "1:1", "a pixel of the screen for each pixel (1)"], [2, "2:1", "twice as large (2)"],
      [4, "4:1", "four times as large (4)"], [8, "8:1", "eight times as large (8)"],
    ]) {
      const button = make("button", { type: "button", title, onclick: () => { this.zoom = zoom; } }, text);
      this.#buttons.set(zoom, button);
      bar.append(button);
    }
    bar.append(this.#readout);
    element.replaceChildren(this.#frame, bar);

    this.#listen();
    this.#position = position;
    this.show(left, right, leftLabel, rightLabel);
    new ResizeObserver(() => this.#lay()).observe(element);
    window.addEventListener("resize", () => this.#lay());
  }

  /* Show one picture, or two; what was shown stays until the new ones can be drawn. */
  show(left, right = null, leftLabel = "", rightLabel = "") {
    const asked = ++this.#asked;
    const put = (pictures) => {
      if (asked !== this.#asked) return;
      this.#two = pictures[1] !== null;
      this.#labels[0].textContent = leftLabel;
      this.#labels[1].textContent = rightLabel;
      pictures.forEach((picture, side) => this.#draw(picture, side));
      this.#element.dataset.pictures = String(pictures.filter((picture) => picture !== null).length);
      this.#readout.textContent = "";
      this.#lay();
    };
    const wanted = [left, right];
    if (wanted.some((picture) => typeof picture === "string")) {
      this.shown = Promise.all(wanted.map(Wipe.#drawable)).then(put);
    } else {
      put(wanted);
      this.shown = Promise.resolve();
    }
  }

  get position() {
    return this.#position;
  }

  set position(value) {
    this.#position = Math.min(1, Math.max(0, value));
    this.#cut();
    this.#onmove?.(this.#position);
  }

  get zoom() {
    return this.#zoom;
  }

  set zoom(value) {
    this.#zoomAt(value, this.#view.clientWidth / 2, this.#view.clientHeight / 2);
  }

  static async #drawable(picture) {
    if (typeof picture !== "string") return picture;
    const image = new Image();
    image.src = picture;
    await image.decode();
    return image;
  }

  #draw(picture, side) {
    const canvas = this.#sides[side];
    const width = picture?.naturalWidth ?? picture?.width ?? 0;
    const height = picture?.naturalHeight ?? picture?.height ?? 0;
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
    }
    if (picture === null) return;
    // Colours under the pointer are read from it.
    const context = canvas.getContext("2d", { willReadFrequently: true });
    context.clearRect(0, 0, width, height);
    context.drawImage(picture, 0, 0);
  }

  /* Size of the stage: that of the larger picture. */
  #size() {
    const [left, right] = this.#sides;
    const larger = left.width * left.height >= right.width * right.height ? left : right;
    return [larger.width, larger.height];
  }

  /* Pixels of the screen for each pixel. */
  #scale() {
    if (this.#zoom !== "fit") return this.#zoom;
    const [width, height] = this.#size();
    const room = Math.max(180, 0.72 * window.innerHeight);
    return Math.min(this.#element.clientWidth / width, room / height, 16) * window.devicePixelRatio;
  }

  #lay() {
    const [width, height] = this.#size();
    if (width === 0 || this.#element.clientWidth === 0) return;
    const scale = this.#scale();
    const ratio = window.devicePixelRatio;
    this.#stage.style.width = `${(width * scale) / ratio}px`;
    this.#stage.style.height = `${(height * scale) / ratio}px`;
    this.#view.style.maxHeight = `${Math.max(180, 0.8 * window.innerHeight)}px`;
    this.#view.style.overflow = this.#zoom === "fit" ? "hidden" : "auto";
    this.#element.toggleAttribute("data-pixels", scale >= 2 || this.#zoom !== "fit");
    this.#element.toggleAttribute("data-scrolls", this.#scrolls());
    for (const [zoom, button] of this.#buttons) button.setAttribute("aria-pressed", String(zoom === this.#zoom));
    this.#cut();
  }

  #scrolls() {
    const view = this.#view;
    return this.#zoom !== "fit" && (view.scrollWidth > view.clientWidth + 1 || view.scrollHeight > view.clientHeight + 1);
  }

  /* Place the divider within the visible part of the pictures. */
  #cut() {
    const [left] = this.#sides;
    const x = this.#position * this.#view.clientWidth;
    this.#divider.style.left = `${x}px`;
    this.#divider.setAttribute("aria-valuenow", String(Math.round(100 * this.#position)));
    const all = this.#stage.clientWidth;
    const hidden = this.#two ? Math.max(0, all - this.#view.scrollLeft - x) : 0;
    left.style.clipPath = hidden > 0 ? `inset(0 ${hidden}px 0 0)` : "none";
  }

  /* Zoom about a place of the view. */
  #zoomAt(zoom, x, y) {
    const view = this.#view;
    const before = [this.#stage.clientWidth, this.#stage.clientHeight];
    const place = [(view.scrollLeft + x) / before[0], (view.scrollTop + y) / before[1]];
    this.#zoom = zoom;
    this.#lay();
    if (zoom === "fit") return;
    view.scrollLeft = place[0] * this.#stage.clientWidth - Math.min(x, view.clientWidth);
    view.scrollTop = place[1] * this.#stage.clientHeight - Math.min(y, view.clientHeight);
    this.#cut();
  }

  #listen() {
    const stage = this.#stage;
    const view = this.#view;
    const divide = (event) => {
      this.position = (event.clientX - view.getBoundingClientRect().left) / view.clientWidth;
    };

    // Drag the divider, or the picture where it is larger than the view.
    let pulled = null;
    const begin = (event, pull) => {
      if (event.button !== 0) return;
      pulled = { pull, x: event.clientX, y: event.clientY };
      event.currentTarget.setPointerCapture(event.pointerId);
      if (pull === divide) {
        divide(event);
        event.preventDefault();
        this.#divider.focus({ focusVisible: false, preventScroll: true });
      }
    };
    const pan = (event) => {
      view.scrollLeft -= event.clientX - pulled.x;
      view.scrollTop -= event.clientY - pulled.y;
      pulled.x = event.clientX;
      pulled.y = event.clientY;
    };
    this.#divider.addEventListener("pointerdown", (event) => begin(event, divide));
    stage.addEventListener("pointerdown", (event) => {
      if (this.#scrolls()) {
        if (event.pointerType === "mouse") begin(event, pan);
      } else if (this.#two) begin(event, divide);
    });
    for (const target of [this.#divider, stage]) {
      target.addEventListener("pointermove", (event) => pulled?.pull(event));
      for (const end of ["pointerup", "pointercancel"]) target.addEventListener(end, () => { pulled = null; });
    }
    view.addEventListener("scroll", () => this.#cut());

    this.#divider.addEventListener("keydown", (event) => {
      const step = event.shiftKey ? 0.1 : 0.02;
      const to = {
        ArrowLeft: this.#position - step, ArrowDown: this.#position - step, ArrowRight: this.#position + step,
        ArrowUp: this.#position + step, PageDown: this.#position - 0.1, PageUp: this.#position + 0.1, Home: 0, End: 1,
      }[event.key];
      if (to === undefined || event.ctrlKey || event.metaKey || event.altKey) return;
      this.position = to;
      event.preventDefault();
      event.stopPropagation();
    });

    // Two fingers on a touchpad come as a wheel with Ctrl.
    this.#frame.addEventListener("wheel", (event) => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      this.#step(event.deltaY < 0 ? 1 : -1, event);
    }, { passive: false });
    stage.addEventListener("dblclick", (event) => {
      if (this.#zoom === "fit") this.#zoomAt(Math.max(1, 2 ** Math.ceil(Math.log2(this.#scale()) + 0.01)), ...this.#seen(event));
      else this.zoom = "fit";
    });

    stage.addEventListener("pointermove", (event) => this.#read(event));
    stage.addEventListener("pointerleave", () => { this.#readout.textContent = ""; });
    document.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("select, input:not([type=range])")) return;
      const zoom = { 0: "fit", 1: 1, 2: 2, 4: 4, 8: 8 }[event.key];
      if (zoom !== undefined) this.zoom = zoom;
      else if (event.key === "+") this.#step(1);
      else if (event.key === "-") this.#step(-1);
    });
  }

  #seen(event) {
    const box = this.#view.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  /* The next larger or smaller of the zooms. */
  #step(direction, event = null) {
    const place = event === null ? [this.#view.clientWidth / 2, this.#view.clientHeight / 2] : this.#seen(event);
    const scale = this.#scale();
    const zooms = [1, 2, 4, 8, 16, 32];
    const next = direction > 0 ? zooms.find((zoom) => zoom > 1.01 * scale) : zooms.findLast((zoom) => zoom < 0.99 * scale);
    if (next !== undefined) this.#zoomAt(next, ...place);
    else if (direction < 0) this.zoom = "fit";
  }

  /* Show the pixel under the pointer, and its colours. */
  #read(event) {
    const [width, height] = this.#size();
    const box = this.#stage.getBoundingClientRect();
    const at = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
    if (width === 0 || at.some((place) => place < 0 || place >= 1)) return;
    const parts = [`x ${Math.floor(at[0] * width)}, y ${Math.floor(at[1] * height)}`];
    this.#sides.forEach((canvas, side) => {
      if (canvas.width === 0) return;
      const context = canvas.getContext("2d", { willReadFrequently: true });
      const [red, green, blue] = context.getImageData(Math.floor(at[0] * canvas.width), Math.floor(at[1] * canvas.height), 1, 1).data;
      parts.push(`${this.#two ? this.#labels[side].textContent || "AB"[side] : "RGB"} ${red} ${green} ${blue}`);
    });
    this.#readout.textContent = parts.join(" \u00b7 ");
  }
}
