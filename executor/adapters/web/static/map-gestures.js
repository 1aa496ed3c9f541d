// Mouse, fingers and keys over the map: what they mean, in places. The keyboard has a crosshair in the map's middle.

/** @import { Place } from "../documents.js" */

/**
 * What gestures are told to; places are in metres.
 * @typedef {object} Hearer
 * @property {(pixel: Place) => Place} metres
 * @property {() => boolean} takesWheel
 * @property {(place: Place | null, free?: boolean) => void} point
 * @property {(place: Place, free: boolean) => void} click free: not to snap
 * @property {(place: Place) => boolean} press whether a drag begins here, instead of moving the map
 * @property {(place: Place, free: boolean) => void} drag
 * @property {(place: Place) => void} release
 * @property {() => void} drop ends a drag as if it had not begun
 * @property {() => void} removeCorner
 * @property {() => void} cancel
 * @property {(right: number, down: number) => void} move
 * @property {(factor: number, at?: Place) => void} zoom
 * @property {() => void} fit
 * @property {() => void} later
 */

const STILL_PX = 6;
const STEP_PX = 60;
const FINE_PX = 6;
/** @type {Record<string, [number, number]>} */
export const MOVES = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

/** @param {MouseEvent} event @returns {Place} */
const at = (event) => [event.offsetX, event.offsetY];

export class Gestures {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {Hearer} hearer
   */
  constructor(canvas, hearer) {
    this.canvas = canvas;
    this.hearer = hearer;
    /** @type {Map<number, Place>} */
    this.pointers = new Map();
    /**
     * Where one finger, or a mouse, came down and has stayed.
     * @type {Place | null}
     */
    this.pressed = null;
    /**
     * The pixel that a mouse rests on: the map moves under it.
     * @type {Place | null}
     */
    this.rests = null;
    this.isDragging = false;
    // Whether keys were used last: then there is a crosshair.
    this.isKeyed = false;
    canvas.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !hearer.takesWheel()) return;
      event.preventDefault();
      hearer.zoom(Math.exp(-event.deltaY / 400), at(event));
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.over(event));
    canvas.addEventListener("pointerup", (event) => this.up(event));
    canvas.addEventListener("pointercancel", (event) => this.lose(event));
    canvas.addEventListener("pointerleave", (event) => {
      // A finger that was lifted has still asked for a place.
      if (event.pointerType !== "mouse") return;
      this.rests = null;
      hearer.point(null);
    });
    canvas.addEventListener("keydown", (event) => this.key(event));
    canvas.addEventListener("blur", () => this.setKeyed(false));
  }

  /** @returns {Place} */
  get crosshair() {
    return [this.canvas.clientWidth / 2, this.canvas.clientHeight / 2];
  }

  /** @param {boolean} isKeyed */
  setKeyed(isKeyed) {
    if (this.isKeyed === isKeyed) return;
    if (!isKeyed && this.isDragging) this.dropDrag();
    this.isKeyed = isKeyed;
    this.hearer.later();
  }

  dropDrag() {
    this.isDragging = false;
    this.hearer.drop();
  }

  /** @param {PointerEvent} event */
  down(event) {
    if (event.button !== 0) return;
    this.setKeyed(false);
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, at(event));
    if (this.pointers.size > 1) {
      if (this.isDragging) this.dropDrag();
      this.pressed = null;
      return;
    }
    this.pressed = at(event);
    this.rests = event.pointerType === "mouse" ? this.pressed : null;
    const place = this.hearer.metres(this.pressed);
    this.hearer.point(place);
    this.isDragging = this.hearer.press(place);
  }

  /** @param {PointerEvent} event */
  over(event) {
    const now = at(event);
    this.rests = event.pointerType === "mouse" ? now : null;
    this.hearer.point(this.hearer.metres(now), event.altKey);
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const other = [...this.pointers].find(([id]) => id !== event.pointerId)?.[1];
    if (other) {
      const apart = (/** @type {Place} */ one) => Math.max(10, Math.hypot(one[0] - other[0], one[1] - other[1]));
      this.hearer.move((now[0] - before[0]) / 2, (now[1] - before[1]) / 2);
      this.hearer.zoom(apart(now) / apart(before), [(now[0] + other[0]) / 2, (now[1] + other[1]) / 2]);
    } else if (this.isDragging) {
      if (!this.isStill(now)) this.hearer.drag(this.hearer.metres(now), event.altKey);
    } else {
      this.hearer.move(now[0] - before[0], now[1] - before[1]);
    }
    if (this.pressed && !this.isStill(now)) this.pressed = null;
    this.pointers.set(event.pointerId, now);
  }

  /** @param {Place} now */
  isStill(now) {
    return this.pressed !== null && Math.hypot(now[0] - this.pressed[0], now[1] - this.pressed[1]) < STILL_PX;
  }

  /** @param {PointerEvent} event */
  up(event) {
    if (!this.pointers.delete(event.pointerId)) return;
    const place = this.hearer.metres(at(event));
    const { isDragging, pressed } = this;
    [this.isDragging, this.pressed] = [false, null];
    if (isDragging) this.hearer.release(place);
    else if (pressed) this.hearer.click(place, event.altKey);
  }

  /** @param {PointerEvent} event */
  lose(event) {
    if (this.pointers.delete(event.pointerId) && this.isDragging) this.dropDrag();
    this.pressed = null;
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { hearer } = this;
    const { key } = event;
    const step = event.shiftKey ? FINE_PX : STEP_PX;
    if (MOVES[key]) hearer.move(step * MOVES[key][0], step * MOVES[key][1]);
    else if (key === "+" || key === "=") hearer.zoom(1.4);
    else if (key === "-") hearer.zoom(1 / 1.4);
    else if (key === "0") hearer.fit();
    else if (key === "Enter") hearer.click(hearer.metres(this.crosshair), false);
    else if (key === " ") this.hold();
    else if (key === "Backspace" || key === "Delete") hearer.removeCorner();
    else if (key === "Escape") hearer.cancel();
    else return;
    event.preventDefault();
    this.setKeyed(key !== "Escape");
    const place = hearer.metres(this.crosshair);
    hearer.point(place);
    if (this.isDragging && MOVES[key]) hearer.drag(place, false);
    hearer.later();
  }

  /** What a mouse button does that is held: Space presses, the next one releases. */
  hold() {
    const place = this.hearer.metres(this.crosshair);
    if (this.isDragging) {
      this.isDragging = false;
      this.hearer.release(place);
    } else this.isDragging = this.hearer.press(place);
  }
}
