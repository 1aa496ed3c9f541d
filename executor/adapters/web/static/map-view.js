// Which part of the ground the map shows, and where degrees lie in local metres.

/** @import { Place } from "../documents.js" */

/** @typedef {{ lat_deg: number, lon_deg: number }} Frame */
/** @typedef {[number, number, number, number]} Bounds west, south, east, north */

const PAD_PX = 46;
const MOST_PX_M = 20;
const LEAST_PX_M = 0.002;
// A shorter line is not seen between others.
export const LEAST_PX = 12;

export class View {
  constructor() {
    this.width = 0;
    this.height = 0;
    // Pixels in a metre.
    this.scale = 1;
    /** @type {Place} */
    this.middle = [0, 0];
    this.isFitted = true;
  }

  /**
   * @param {Place} place in metres
   * @returns {Place}
   */
  pixels([east, north]) {
    return [this.width / 2 + (east - this.middle[0]) * this.scale, this.height / 2 - (north - this.middle[1]) * this.scale];
  }

  /**
   * @param {Place} pixel
   * @returns {Place}
   */
  metres([x, y]) {
    return [this.middle[0] + (x - this.width / 2) / this.scale, this.middle[1] - (y - this.height / 2) / this.scale];
  }

  /** @param {Place[]} places */
  fit(places) {
    this.isFitted = true;
    const [west, south, east, north] = boundsOf(places);
    // Nothing to show, or hidden: then it is fitted when it is seen.
    if (east < west || !this.width || !this.height) return;
    this.middle = [(west + east) / 2, (south + north) / 2];
    const [width, height] = [this.width, this.height].map((one) => Math.max(one - 2 * PAD_PX, one / 2));
    this.scale = Math.min(width / Math.max(east - west, 20), height / Math.max(north - south, 20));
  }

  /**
   * @param {number} factor
   * @param {Place} at the pixel that stays where it is
   */
  zoom(factor, at = [this.width / 2, this.height / 2]) {
    const before = this.metres(at);
    this.scale = Math.min(MOST_PX_M, Math.max(LEAST_PX_M, this.scale * factor));
    const after = this.metres(at);
    this.middle = [this.middle[0] + before[0] - after[0], this.middle[1] + before[1] - after[1]];
    this.isFitted = false;
  }

  /**
   * @param {number} right
   * @param {number} down
   */
  move(right, down) {
    this.middle = [this.middle[0] - right / this.scale, this.middle[1] + down / this.scale];
    this.isFitted = false;
  }

  /**
   * Shows a line; nothing moves where it is seen already.
   * @param {Place[]} ends
   */
  show(ends) {
    const pixels = ends.map((end) => this.pixels(end));
    const inside = pixels.every(([x, y]) => x > PAD_PX && y > PAD_PX && x < this.width - PAD_PX && y < this.height - PAD_PX);
    const long = Math.hypot(pixels[0][0] - pixels[1][0], pixels[0][1] - pixels[1][1]);
    if (inside && long >= LEAST_PX) return;
    this.middle = [(ends[0][0] + ends[1][0]) / 2, (ends[0][1] + ends[1][1]) / 2];
    if (long < LEAST_PX) this.scale = Math.min(MOST_PX_M, (this.scale * 4 * LEAST_PX) / Math.max(1, long));
    const most = Math.max(LEAST_PX, Math.min(this.width, this.height) - 2 * PAD_PX);
    if (long > most) this.scale *= most / long;
    this.isFitted = false;
  }
}

/**
 * @param {Place[]} places
 * @returns {Bounds}
 */
export function boundsOf(places) {
  /** @type {Bounds} */
  const found = [Infinity, Infinity, -Infinity, -Infinity];
  for (const [east, north] of places) {
    if (east < found[0]) found[0] = east;
    if (north < found[1]) found[1] = north;
    if (east > found[2]) found[2] = east;
    if (north > found[3]) found[3] = north;
  }
  return found;
}

/**
 * How far a place lies from a line between two others.
 * @param {Place} place
 * @param {Place} a
 * @param {Place} b
 */
export function awayFrom([x, y], [ax, ay], [bx, by]) {
  const length = Math.max(1e-9, (bx - ax) ** 2 + (by - ay) ** 2);
  const share = Math.min(1, Math.max(0, ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length));
  return Math.hypot(x - ax - share * (bx - ax), y - ay - share * (by - ay));
}

/**
 * Whether a place is inside a ring.
 * @param {Place} place
 * @param {Place[]} ring
 */
export function isInside([x, y], ring) {
  let inside = false;
  ring.forEach(([ax, ay], index) => {
    const [bx, by] = ring[(index + 1) % ring.length];
    if (ay > y !== by > y && x < ax + ((y - ay) / (by - ay)) * (bx - ax)) inside = !inside;
  });
  return inside;
}

const RAD = Math.PI / 180;
const AXIS_M = 6378137;
const E2 = 0.00669437999014;

/**
 * Metres along the meridian from the equator.
 * @param {number} lat
 */
const meridian = (lat) => AXIS_M * ((1 - E2 / 4 - (3 * E2 ** 2) / 64) * lat
  - ((3 * E2) / 8 + (3 * E2 ** 2) / 32) * Math.sin(2 * lat) + ((15 * E2 ** 2) / 256) * Math.sin(4 * lat));

/** @param {number} lat */
const bend = (lat) => Math.sqrt(1 - E2 * Math.sin(lat) ** 2);

/**
 * The azimuthal equidistant projection about a frame, as the program has it: within 0.2 m up to 30 km away.
 * @param {Frame} frame
 */
export function projectionOf({ lat_deg, lon_deg }) {
  const zero = meridian(lat_deg * RAD);
  return {
    /**
     * @param {Place} place latitude and longitude
     * @returns {Place}
     */
    toMetres([latDeg, lonDeg]) {
      const lat = latDeg * RAD;
      const east = (AXIS_M * (((((lonDeg - lon_deg) % 360) + 540) % 360) - 180) * RAD * Math.cos(lat)) / bend(lat);
      return [east, meridian(lat) - zero + (east ** 2 * Math.tan(lat) * bend(lat)) / (2 * AXIS_M)];
    },
    /**
     * @param {Place} place in metres
     * @returns {Place}
     */
    toDegrees([east, north]) {
      let lat = lat_deg * RAD;
      for (let round = 0; round < 12; round += 1) {
        const wanted = zero + north - (east ** 2 * Math.tan(lat) * bend(lat)) / (2 * AXIS_M);
        lat += ((wanted - meridian(lat)) * bend(lat) ** 3) / (AXIS_M * (1 - E2));
      }
      const lonDeg = lon_deg + (east * bend(lat)) / (AXIS_M * Math.cos(lat)) / RAD;
      return [lat / RAD, ((((lonDeg + 180) % 360) + 360) % 360) - 180];
    },
  };
}

/** Places that are metres already. */
export const METRES = {
  toMetres: (/** @type {Place} */ place) => place,
  toDegrees: (/** @type {Place} */ place) => place,
};
