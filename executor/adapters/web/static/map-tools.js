// What is drawn and edited on the map: boxes and lassos that choose, rings, lines and places. All places are in metres.
import { awayFrom, isInside } from "./map-view.js";

/** @import { Place } from "../documents.js" */
/** @import { Painter } from "./map-painter.js" */

/** @typedef {"select-box" | "select-lasso" | "polygon" | "line" | "place" | "edit-area"} ToolName */

/**
 * What tools know of the map.
 * @typedef {object} Board
 * @property {() => number} scale pixels in a metre
 * @property {(place: Place, except?: Place[]) => Place} snap
 * @property {(isChosen: (middle: Place) => boolean) => unknown[]} chooseSegments
 */

/** Pixels within which a corner is meant. */
export const NEAR_PX = 12;

class Tool {
  /**
   * @param {Board} board
   * @param {(found: any) => void} done
   */
  constructor(board, done) {
    this.board = board;
    this.done = done;
    /** @type {Place[]} */
    this.corners = [];
    /** @type {Place | null} */
    this.hovered = null;
  }

  /**
   * @param {Place} one
   * @param {Place} other
   */
  isNear(one, other, pixels = NEAR_PX) {
    return Math.hypot(one[0] - other[0], one[1] - other[1]) * this.board.scale() < pixels;
  }

  /**
   * Whether a drag begins at a place, instead of moving the map.
   * @param {Place} _place
   */
  press(_place) {
    return false;
  }

  /**
   * @param {Place} place
   * @param {boolean} free
   */
  click(place, free) {
    this.point(place, free);
  }

  /**
   * @param {Place} place
   * @param {boolean} free
   */
  drag(place, free) {
    this.point(place, free);
  }

  /** @param {Place} place */
  release(place) {
    this.point(place, true);
  }

  drop() {
    this.hovered = null;
  }

  /**
   * @param {Place | null} place
   * @param {boolean} [free]
   */
  point(place, free = false) {
    this.hovered = place && !free ? this.board.snap(place) : place;
  }

  removeCorner() {
    this.corners.pop();
  }

  finish() {
    this.corners = [];
  }

  /** @param {Painter} painter */
  draw(painter) {
    this.drawRing(painter, this.corners, true);
  }

  /**
   * @param {Painter} painter
   * @param {Place[]} places
   * @param {boolean} isClosed
   */
  drawRing(painter, places, isClosed) {
    const colour = painter.colours("focus");
    if (isClosed && places.length > 2) painter.area([places], { colour, fill: 0.12, width: 2.5 });
    else painter.lines([places], { colour, width: 2.5, dash: isClosed ? [7, 4] : [] });
  }

  /**
   * @param {Painter} painter
   * @param {Place[]} places
   * @param {number} radius
   */
  drawHandles(painter, places, radius, filled = -1) {
    const [focus, map] = [painter.colours("focus"), painter.colours("map")];
    const corners = /** @type {[number, number][]} */ ([[-radius, -radius], [radius, -radius], [radius, radius], [-radius, radius]]);
    places.forEach((place, index) => {
      painter.shape(painter.view.pixels(place), corners, { fill: index === filled ? focus : map, edge: focus });
    });
  }
}

class Choosing extends Tool {
  /**
   * @param {Board} board
   * @param {(ids: any) => void} done
   * @param {boolean} isBox
   */
  constructor(board, done, isBox) {
    super(board, done);
    this.isBox = isBox;
  }

  /** @param {Place} place */
  press(place) {
    this.corners = [place];
    return true;
  }

  /** @param {Place} place */
  drag(place) {
    const [first] = this.corners;
    if (this.isBox) this.corners.splice(1, 3, [place[0], first[1]], place, [first[0], place[1]]);
    else this.corners.push(place);
  }

  release() {
    const ring = this.corners;
    this.corners = [];
    if (ring.length > 2) this.done(this.board.chooseSegments((middle) => isInside(middle, ring)));
  }

  drop() {
    this.corners = [];
  }
}

class Drawing extends Tool {
  /**
   * @param {Board} board
   * @param {(places: any) => void} done
   * @param {boolean} isClosed
   */
  constructor(board, done, isClosed) {
    super(board, done);
    this.isClosed = isClosed;
  }

  get least() {
    return this.isClosed ? 3 : 2;
  }

  /**
   * @param {Place} place
   * @param {boolean} free
   */
  click(place, free) {
    const corner = free ? place : this.board.snap(place);
    const last = this.corners.at(-1);
    const ends = (last && this.isNear(corner, last)) || (this.isClosed && this.corners.length > 2 && this.isNear(corner, this.corners[0]));
    if (ends) this.finish();
    else this.corners.push(corner);
  }

  finish() {
    if (this.corners.length < this.least) return;
    const places = this.corners;
    this.corners = [];
    this.done(places);
  }

  /** @param {Painter} painter */
  draw(painter) {
    const next = this.hovered ? [...this.corners, this.hovered] : this.corners;
    this.drawRing(painter, next, this.isClosed);
    this.drawHandles(painter, this.corners, 5, this.isClosed && this.corners.length > 2 ? 0 : this.corners.length - 1);
    if (this.hovered) painter.ring(painter.view.pixels(this.hovered), 6, painter.colours("focus"));
  }
}

class Placing extends Tool {
  /**
   * @param {Board} board
   * @param {(place: any) => void} done
   * @param {boolean} isSnapping
   */
  constructor(board, done, isSnapping) {
    super(board, done);
    this.isSnapping = isSnapping;
  }

  /**
   * @param {Place | null} place
   * @param {boolean} [free]
   */
  point(place, free = false) {
    super.point(place, free || !this.isSnapping);
  }

  /**
   * @param {Place} place
   * @param {boolean} free
   */
  click(place, free) {
    this.done(free || !this.isSnapping ? place : this.board.snap(place));
  }

  /** @param {Painter} painter */
  draw(painter) {
    if (this.hovered) painter.ring(painter.view.pixels(this.hovered), 8, painter.colours("focus"));
  }
}

class Editing extends Tool {
  /**
   * @param {Board} board
   * @param {(ring: any) => void} done
   * @param {Place[]} ring
   */
  constructor(board, done, ring) {
    super(board, done);
    const isClosed = ring.length > 3 && ring[0].every((value, axis) => value === ring[ring.length - 1][axis]);
    this.given = ring;
    this.corners = ring.slice(0, isClosed ? -1 : undefined);
    // The corner that was touched last.
    this.touched = -1;
    /** @type {Place[] | null} */
    this.before = null;
  }

  /** @returns {Place[]} */
  get middles() {
    return this.corners.map(([east, north], index) => {
      const [nextEast, nextNorth] = this.corners[(index + 1) % this.corners.length];
      return [(east + nextEast) / 2, (north + nextNorth) / 2];
    });
  }

  /** @param {Place} place */
  press(place) {
    this.before = [...this.corners];
    const away = (/** @type {Place} */ one) => Math.hypot(one[0] - place[0], one[1] - place[1]);
    const nearest = (/** @type {Place[]} */ places) => places.reduce((best, one, index) => (away(one) < away(places[best]) ? index : best), 0);
    const corner = nearest(this.corners);
    if (this.isNear(place, this.corners[corner], 1.5 * NEAR_PX)) {
      this.touched = corner;
      return true;
    }
    const middle = nearest(this.middles);
    if (!this.isNear(place, this.middles[middle], 1.5 * NEAR_PX)) return false;
    this.corners.splice(middle + 1, 0, this.middles[middle]);
    this.touched = middle + 1;
    return true;
  }

  /**
   * @param {Place} place
   * @param {boolean} free
   */
  drag(place, free) {
    this.corners[this.touched] = free ? place : this.board.snap(place, this.given);
  }

  release() {
    this.before = null;
  }

  drop() {
    if (this.before) this.corners = this.before;
    [this.before, this.touched] = [null, -1];
  }

  click() {
    this.finish();
  }

  removeCorner() {
    if (this.touched < 0 || this.corners.length < 4) return;
    this.corners.splice(this.touched, 1);
    this.touched = -1;
  }

  finish() {
    this.done(this.corners);
  }

  /** @param {Painter} painter */
  draw(painter) {
    this.drawRing(painter, this.corners, true);
    this.drawHandles(painter, this.middles, 3);
    this.drawHandles(painter, this.corners, 5, this.touched);
  }
}

/**
 * @param {ToolName} name
 * @param {Board} board
 * @param {(found: any) => void} done
 * @param {any} given
 * @returns {Tool}
 */
export function makeTool(name, board, done, given) {
  if (name === "select-box" || name === "select-lasso") return new Choosing(board, done, name === "select-box");
  if (name === "polygon" || name === "line") return new Drawing(board, done, name === "polygon");
  if (name === "edit-area") return new Editing(board, done, given);
  return new Placing(board, done, Boolean(given?.snap));
}

/**
 * The place among some that is meant by one nearby; the place itself where none is.
 * @param {Place} place
 * @param {Iterable<Place>} candidates
 * @param {number} scale pixels in a metre
 * @param {Place[]} except
 */
export function snapTo(place, candidates, scale, except = []) {
  let [found, least] = [place, NEAR_PX / scale];
  for (const one of candidates) {
    const away = Math.hypot(one[0] - place[0], one[1] - place[1]);
    if (away < least && !except.some((other) => Math.hypot(other[0] - one[0], other[1] - one[1]) < 0.1)) [found, least] = [one, away];
  }
  return found;
}

/**
 * The nearest of some lines; null where none is near.
 * @template {{ ends: [Place, Place] }} Line
 * @param {Place} place
 * @param {Iterable<Line>} lines
 * @param {number} mostM
 * @returns {Line | null}
 */
export function nearestLine(place, lines, mostM) {
  /** @type {Line | null} */
  let found = null;
  let least = mostM;
  for (const one of lines) {
    const away = awayFrom(place, ...one.ends);
    if (away < least) [found, least] = [one, away];
  }
  return found;
}
