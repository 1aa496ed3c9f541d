// Background of the map: a picture of the ground or its relief, contour lines, and what is known of a place.
import { say } from "./translation.js";

/** @import { Contour, GroundDocument, Place } from "../documents.js" */
/** @import { Painter } from "./map-painter.js" */

/** @type {Record<string, string>} */
const SHOWN = { photo: "Photo", relief: "Relief", plain: "Plain" };
const VEIL = 0.38;
const SHADE = 0.42;
// Pixels that a contour line needs, to be written on; and that lie between two heights.
const LABEL_PX = 170;
const APART_PX = 90;

export class Ground {
  /**
   * @param {() => void} changed
   * @param {(place: Place) => Place} metres of a place as the map has it
   */
  constructor(changed, metres) {
    this.changed = changed;
    this.metres = metres;
    /** @type {GroundDocument | null} */
    this.document = null;
    /** @type {Record<string, HTMLImageElement>} */
    this.images = {};
    this.layer = "plain";
    this.layers = ["plain"];
    /** @type {DrawnContour[]} */
    this.lines = [];
  }

  /** @param {string} path of the document; its pictures are beside it */
  async load(path = "/ground/ground.json") {
    const answer = await fetch(path);
    this.show(answer.ok ? await answer.json() : null, (name) => new URL(name, new URL(path, location.href)).href);
  }

  /**
   * @param {GroundDocument | null} content
   * @param {(name: string) => string} find where a picture that it names is
   */
  show(content, find) {
    const isFirst = this.document === null;
    this.document = content;
    const { photo, relief } = content ?? { photo: null, relief: null };
    this.layers = [...(photo ? ["photo"] : []), ...(relief ? ["relief"] : []), "plain"];
    if (isFirst || !this.layers.includes(this.layer)) this.layer = this.layers[0];
    this.images = {};
    this.lines = (relief?.contours ?? []).map((line) => contour(line));
    if (photo) this.fetch("photo", find(photo));
    if (relief) this.fetch("relief", find(relief.file));
    this.changed();
  }

  /**
   * @param {string} layer
   * @param {string} address
   */
  fetch(layer, address) {
    const image = new Image();
    const content = this.document;
    image.fetchPriority = "low";
    image.addEventListener("load", () => {
      if (this.document !== content) return;
      this.images[layer] = image;
      this.changed();
    });
    image.src = address;
  }

  // The next layer; returns its name.
  next() {
    this.layer = this.layers[(this.layers.indexOf(this.layer) + 1) % this.layers.length];
    this.changed();
    return this.word();
  }

  word() {
    return SHOWN[this.layer];
  }

  /** The layer whose picture is there. */
  get shown() {
    return this.images[this.layer] ? this.layer : "plain";
  }

  attribution() {
    if (this.document === null || this.layer === "plain") return "";
    const { relief } = this.document;
    const lines = relief && this.lines.length ? say("contours every {interval} m", { interval: relief.interval_m }) : "";
    return [lines, this.layer === "photo" ? this.document.attribution : ""].filter(Boolean).join(" · ");
  }

  /** @param {Painter} painter */
  draw(painter) {
    if (this.layer === "plain" || this.document === null) return;
    const { context, view } = painter;
    const image = this.images[this.layer];
    if (image) {
      const [west, south] = view.pixels(this.document.low_m);
      const [east, north] = view.pixels(this.document.high_m);
      context.save();
      context.globalAlpha = this.layer === "photo" ? 1 : SHADE;
      context.drawImage(image, west, north, east - west, south - north);
      if (this.layer === "photo") {
        context.globalAlpha = VEIL;
        context.fillStyle = painter.colours("map");
        context.fillRect(west, north, east - west, south - north);
      }
      context.restore();
    }
    this.drawLines(painter);
  }

  /** @param {Painter} painter */
  drawLines(painter) {
    const { context, view } = painter;
    context.save();
    context.strokeStyle = painter.colours("contour");
    context.globalAlpha = 0.7;
    // In metres: the lines were made once, and are only moved and scaled.
    context.translate(...view.pixels([0, 0]));
    context.scale(view.scale, -view.scale);
    for (const line of this.lines) {
      context.lineWidth = (line.bold ? 1.3 : 0.6) / view.scale;
      context.stroke(line.path);
    }
    context.restore();
    this.writeHeights(painter);
  }

  /** @param {Painter} painter */
  writeHeights(painter) {
    const { context, view } = painter;
    /** @type {Place[]} */
    const taken = [];
    context.save();
    context.font = "600 11px system-ui, sans-serif";
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.strokeStyle = painter.colours("map");
    context.fillStyle = painter.colours("contour");
    context.lineWidth = 3;
    for (const line of this.lines) {
      if (!line.bold || line.length * view.scale < LABEL_PX) continue;
      const [x, y] = view.pixels(line.middle);
      if (x < 30 || y < 30 || x > view.width - 30 || y > view.height - 30) continue;
      if (taken.some(([ox, oy]) => Math.hypot(ox - x, oy - y) < APART_PX)) continue;
      taken.push([x, y]);
      context.strokeText(`${line.height}`, x, y);
      context.fillText(`${line.height}`, x, y);
    }
    context.restore();
  }

  /**
   * Where a place is, and how high the ground there, in words; nothing where that is not known.
   * @param {Place} shown as the map has it
   */
  describe(shown) {
    if (this.document === null) return "";
    const place = this.metres(shown);
    const { degrees, relief } = this.document;
    const lat = between(this.document, place, degrees, degrees.lat_deg, true);
    const lon = between(this.document, place, degrees, degrees.lon_deg, true);
    if (lat === null || lon === null) return "";
    const metres = relief ? between(this.document, place, relief.heights, relief.heights.metres, false) : null;
    return `${lat.toFixed(6)}, ${lon.toFixed(6)}${metres === null ? "" : say(" · ground {height} m", { height: metres.toFixed(0) })}`;
  }
}

/**
 * A value between those of a grid over the whole area: at its corners, or in the middles of its cells.
 * @param {GroundDocument} ground
 * @param {Place} place
 * @param {{ rows: number, columns: number }} grid
 * @param {(number | null)[]} values
 * @param {boolean} corners
 */
function between({ low_m: low, high_m: high }, [east, north], { rows, columns }, values, corners) {
  const [right, down] = [(east - low[0]) / (high[0] - low[0]), (high[1] - north) / (high[1] - low[1])];
  if (!corners && (right < 0 || right > 1 || down < 0 || down > 1)) return null;
  // Beyond the area latitudes and longitudes go on as they do at its edge.
  const at = (/** @type {number} */ share, /** @type {number} */ count) => (corners ? share * (count - 1) : Math.min(count - 1, Math.max(0, share * count - 0.5)));
  const [i, j] = [at(down, rows), at(right, columns)];
  const [top, left] = [within(Math.floor(i), rows - 2), within(Math.floor(j), columns - 2)];
  const value = (/** @type {number} */ row, /** @type {number} */ column) => values[row * columns + column];
  const [a, b, c, d] = [value(top, left), value(top, left + 1), value(top + 1, left), value(top + 1, left + 1)];
  if (a === null || b === null || c === null || d === null) return null;
  const [y, x] = [i - top, j - left];
  return (a * (1 - x) + b * x) * (1 - y) + (c * (1 - x) + d * x) * y;
}

/**
 * @param {number} value
 * @param {number} most
 */
const within = (value, most) => Math.min(most, Math.max(0, value));

/**
 * A contour line, ready to be drawn.
 * @typedef {ReturnType<typeof contour>} DrawnContour
 * @param {Contour} line
 */
function contour({ height_m: height, places_m: places, bold }) {
  const path = new Path2D();
  let length = 0;
  places.forEach(([east, north], index) => {
    path[index ? "lineTo" : "moveTo"](east, north);
    if (index) length += Math.hypot(east - places[index - 1][0], north - places[index - 1][1]);
  });
  return { height, bold, path, length, middle: places[Math.floor(places.length / 2)] };
}
