// How the map's lines, signs and names are drawn on a canvas.
import { boundsOf } from "./map-view.js";

/** @import { Place } from "../documents.js" */
/** @import { View } from "./map-view.js" */

/**
 * Where a name was written, in pixels: left, top, width.
 * @typedef {[number, number, number]} Taken
 */
/** @typedef {{ colour: string, width: number, dash?: number[], alpha?: number, isBright?: boolean }} Look */

const FONT = "system-ui, sans-serif";

/** The colours of the page's style; read once for each picture. */
export function readColours() {
  const style = getComputedStyle(document.documentElement);
  return (/** @type {string} */ name) => style.getPropertyValue(`--${name}`).trim();
}

export class Painter {
  /**
   * @param {CanvasRenderingContext2D} context
   * @param {View} view
   * @param {boolean} isEdged whether lines need an edge, as over a picture of the ground
   */
  constructor(context, view, isEdged) {
    this.context = context;
    this.view = view;
    this.isEdged = isEdged;
    this.colours = readColours();
    // No name is written over another one.
    /** @type {Taken[]} */
    this.taken = [];
  }

  /**
   * Draws lines of one look at once; what is out of sight is left out, since dashes cost where nobody sees them, too.
   * @param {Place[][]} lines
   * @param {Look} look
   */
  lines(lines, look) {
    const context = this.context;
    context.beginPath();
    if (!this.trace(lines)) return;
    const { colour, width, dash = [], alpha = 1, isBright = false } = look;
    context.save();
    context.lineJoin = context.lineCap = "round";
    if (this.isEdged && alpha > 0.4) {
      context.globalAlpha = 0.65 * alpha;
      context.strokeStyle = this.colours(isBright ? "edge" : "map");
      context.lineWidth = width + 2.5;
      context.stroke();
    }
    context.globalAlpha = alpha;
    context.strokeStyle = colour;
    context.lineWidth = width;
    if (dash.length) context.lineCap = "butt";
    context.setLineDash(dash);
    context.stroke();
    context.restore();
  }

  /**
   * Adds what is seen of lines to the path; says whether that is anything.
   * @param {Place[][]} lines
   */
  trace(lines) {
    const { context, view } = this;
    const [right, low] = [view.width + 20, view.height + 20];
    let [lastX, lastY, any] = [NaN, NaN, false];
    for (const line of lines) {
      let [ax, ay] = [NaN, NaN];
      for (const place of line) {
        const [bx, by] = view.pixels(place);
        if (Math.max(ax, bx) > -20 && Math.min(ax, bx) < right && Math.max(ay, by) > -20 && Math.min(ay, by) < low) {
          // Spans that meet are one line: half the work.
          if (ax !== lastX || ay !== lastY) context.moveTo(ax, ay);
          context.lineTo(bx, by);
          [lastX, lastY, any] = [bx, by, true];
        }
        [ax, ay] = [bx, by];
      }
    }
    return any;
  }

  /**
   * Little squares, as many as there are.
   * @param {Place[]} places
   * @param {string} colour
   */
  dots(places, colour) {
    const { context, view } = this;
    context.fillStyle = colour;
    context.beginPath();
    for (const place of places) {
      const [x, y] = view.pixels(place);
      if (x > -6 && y > -6 && x < view.width + 6 && y < view.height + 6) context.rect(x - 3, y - 3, 6, 6);
    }
    context.fill();
  }

  /**
   * @param {Place[][]} rings
   * @param {{ colour: string, fill: number, alpha?: number, width?: number, dash?: number[] }} look
   */
  area(rings, { colour, fill, alpha = 1, width = 2, dash = [] }) {
    const { context, view } = this;
    context.save();
    context.beginPath();
    for (const ring of rings) {
      ring.forEach((place, index) => {
        context[index ? "lineTo" : "moveTo"](...view.pixels(place));
      });
      context.closePath();
    }
    context.fillStyle = context.strokeStyle = colour;
    context.globalAlpha = fill;
    context.fill("evenodd");
    context.globalAlpha = alpha;
    context.lineWidth = width;
    context.setLineDash(dash);
    context.stroke();
    context.restore();
  }

  /**
   * @param {Place} pixel
   * @param {number} radius
   * @param {string} colour
   * @param {number[]} dash
   */
  ring([x, y], radius, colour, dash = []) {
    const context = this.context;
    context.setLineDash(dash);
    context.strokeStyle = colour;
    context.lineWidth = 2.5;
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.stroke();
    context.setLineDash([]);
  }

  /**
   * Strokes lines between pixels beside a pixel: a sign.
   * @param {Place} pixel
   * @param {[number, number, number, number][]} strokes
   * @param {string} colour
   * @param {number} width
   */
  sign([x, y], strokes, colour, width) {
    const context = this.context;
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.setLineDash([]);
    context.beginPath();
    for (const [ax, ay, bx, by] of strokes) {
      context.moveTo(x + ax, y + ay);
      context.lineTo(x + bx, y + by);
    }
    context.stroke();
  }

  /**
   * A shape about a pixel, filled and edged.
   * @param {Place} pixel
   * @param {[number, number][]} corners
   * @param {{ fill: string, edge: string, turnDeg?: number, width?: number }} look
   */
  shape([x, y], corners, { fill, edge, turnDeg = 0, width = 2.2 }) {
    const context = this.context;
    context.save();
    context.translate(x, y);
    context.rotate((turnDeg * Math.PI) / 180);
    context.beginPath();
    for (const corner of corners) context.lineTo(...corner);
    context.closePath();
    context.fillStyle = fill;
    context.fill();
    context.lineWidth = width;
    context.strokeStyle = edge;
    context.setLineDash([]);
    context.stroke();
    context.restore();
  }

  /**
   * Keeps names away from a pixel.
   * @param {Place} pixel
   */
  keepFree([x, y]) {
    this.taken.push([x - 13, y - 9, 26]);
  }

  /**
   * Writes a name beside a pixel, below what is written there already.
   * @param {string} text
   * @param {Place} pixel
   */
  write(text, [x, y]) {
    const { context, view, taken } = this;
    context.font = `600 13px ${FONT}`;
    const width = context.measureText(text).width + 8;
    let top = y - 9;
    const left = x + 18 + width > view.width ? x - 18 - width : x + 18;
    while (taken.some((one) => Math.abs(one[1] - top) < 18 && left < one[0] + one[2] && one[0] < left + width)) top += 18;
    taken.push([left, top, width]);
    context.globalAlpha = 0.86;
    context.fillStyle = this.colours("map");
    context.fillRect(left, top, width, 18);
    context.globalAlpha = 1;
    context.fillStyle = this.colours("ink");
    context.fillText(text, left + 4, top + 13.5);
  }

  /**
   * Writes a name in the middle of places.
   * @param {string} text
   * @param {Place[]} places
   * @param {string} colour
   */
  writeAmid(text, places, colour) {
    const [west, south, east, north] = boundsOf(places);
    const [x, y] = this.view.pixels([(west + east) / 2, (south + north) / 2]);
    this.context.font = `600 12px ${FONT}`;
    this.context.textAlign = "center";
    this.context.lineWidth = 3;
    this.context.lineJoin = "round";
    this.context.strokeStyle = this.colours("map");
    this.context.strokeText(text, x, y);
    this.context.fillStyle = colour;
    this.context.fillText(text, x, y);
    this.context.textAlign = "left";
  }

  ruler() {
    const { context, view } = this;
    const wanted = 110 / view.scale;
    const power = 10 ** Math.floor(Math.log10(wanted));
    const metres = [5, 2, 1].map((step) => step * power).find((one) => one <= wanted) ?? power;
    const [x, y] = [14, 22];
    const wide = metres * view.scale;
    context.font = `600 12px ${FONT}`;
    if (this.isEdged) {
      context.globalAlpha = 0.8;
      context.fillStyle = this.colours("map");
      context.fillRect(x - 6, y - 17, wide + 48, 24);
      context.globalAlpha = 1;
    }
    const ink = this.colours("ink");
    this.sign([x, y], [[0, -6, 0, 1], [0, 0, wide, 0], [wide, 1, wide, -6]], ink, 2);
    context.fillStyle = ink;
    context.fillText(metres >= 1000 ? `${metres / 1000} km` : `${metres} m`, x + 5, y - 4);
    context.fillText("N ↑", x + wide + 12, y);
  }
}
