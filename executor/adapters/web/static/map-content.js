// What the map shows, and how each of it looks.

/** @import { PageArea, Place } from "../documents.js" */
/** @import { Look, Painter } from "./map-painter.js" */

/** @typedef {"open" | "done" | "inferred" | "missed" | "left-over" | "left-out" | "unreachable"} SegmentState */
/**
 * colour: a halo, of the vehicle that is at it.
 * @typedef {{ id: number, name: string, a: Place, b: Place, state: SegmentState, isChosen?: boolean, colour?: string }} MapSegment
 */
/** @typedef {{ index: number, name: string, isLimit: boolean, rings: Place[][] }} MapArea */
/** @typedef {{ kind: "depot" | "pad" | "base" | "alternate", name: string, place: Place, colour?: string }} MapPlace */
/** @typedef {Place[] | { ring: Place[], colour?: string }} MapFootprint */
/** @typedef {{ vehicle: string, colour: string, isFaint?: boolean, flown: Place[][], ahead: Place[][] }} MapRoute */
/**
 * label: its name, unless something else or nothing is written. isStale: not heard lately. isFaulty: with a cross.
 * isOutside: its loss could not be made good.
 * @typedef {{ name: string, place: Place, heading_deg: number | null, colour: string, state: string, label?: string,
 *   isChosen?: boolean, isStale?: boolean, isFaulty?: boolean, isOutside?: boolean }} MapVehicle
 */
/** @typedef {MapSegment & { ends: [Place, Place] }} DrawnSegment */

/**
 * @param {PageArea[]} areas as documents have them
 * @returns {MapArea[]}
 */
export const areasOf = (areas) => areas.map(({ name, limit, outlines_m }, index) => ({ index, name, isLimit: limit, rings: outlines_m }));

const OUT = new Set(["flying", "holding", "starting", "returning", "landing", "pilot"]);
// Pylons are drawn where spans are at least this long, or where there are few.
const DOTS_FROM_PX = 24;
const FEW = 120;
// A vehicle that far beyond the edge is not seen.
const EDGE_PX = 30;
/** @type {Record<MapPlace["kind"], [number, number][]>} */
const SHAPES = {
  depot: [[0, -9], [9, -1], [6, -1], [6, 8], [-6, 8], [-6, -1], [-9, -1]],
  base: [[0, -8], [8, 0], [0, 8], [-8, 0]],
  alternate: [[-8, 7], [0, -8], [8, 7]],
  pad: [[-5, -5], [5, -5], [5, 5], [-5, 5]],
};

/**
 * @param {Painter} painter
 * @param {{ segments: DrawnSegment[], areas: MapArea[], places: MapPlace[], footprints: { ring: Place[], colour?: string }[], routes: MapRoute[] }} content
 */
export function drawStandingStill(painter, content) {
  const soft = painter.colours("soft");
  for (const { ring, colour } of content.footprints) painter.area([ring], { colour: colour ?? soft, fill: 0.1, alpha: 0.6, width: 1 });
  for (const one of content.areas) drawArea(painter, one);
  drawNetwork(painter, content.segments);
  for (const one of content.routes) drawRoute(painter, one);
  for (const one of content.places) drawPlace(painter, one);
}

/**
 * What flights keep out of; with a height limit, what they keep low in.
 * @param {Painter} painter
 * @param {MapArea} area
 */
function drawArea(painter, { rings, isLimit, name }) {
  const colour = painter.colours("bad");
  for (const ring of rings) painter.area([ring], { colour, fill: isLimit ? 0.06 : 0.16, width: 1.5, dash: isLimit ? [6, 5] : [] });
  if (rings.length) painter.writeAmid(name, rings.flat(), colour);
}

/**
 * @param {Painter} painter
 * @param {DrawnSegment[]} segments
 */
function drawNetwork(painter, segments) {
  const colour = (/** @type {string} */ name) => painter.colours(name);
  /** @param {(one: DrawnSegment) => unknown} isMeant @param {Look} look */
  const draw = (isMeant, look) => painter.lines(segments.filter(isMeant).map((one) => one.ends), look);
  for (const halo of new Set(segments.map((one) => one.colour))) {
    if (halo) draw((one) => one.colour === halo, { colour: halo, width: 15, alpha: 0.33 });
  }
  draw((one) => one.isChosen, { colour: colour("focus"), width: 11 });
  draw((one) => one.isChosen, { colour: colour("map"), width: 6 });
  draw((one) => one.state === "missed", { colour: colour("left"), width: 7 });
  draw((one) => one.state === "done", { colour: colour("done"), width: 7 });
  draw((one) => one.state === "inferred", { colour: colour("done"), width: 7, dash: [7, 5] });
  draw((one) => one.state === "left-over", { colour: colour("left"), width: 5, dash: [4, 4] });
  draw((one) => one.state === "unreachable", { colour: colour("bad"), width: 3, dash: [2, 4] });
  draw((one) => one.state === "left-out", { colour: colour("soft"), width: 1.8, dash: [2, 6] });
  draw((one) => one.state !== "left-out" && one.state !== "unreachable", { colour: colour("open"), width: 1.8 });
  const longM = segments.reduce((sum, { ends: [a, b] }) => sum + Math.hypot(a[0] - b[0], a[1] - b[1]), 0) / segments.length;
  if (segments.length < FEW || longM * painter.view.scale > DOTS_FROM_PX) painter.dots(segments.flatMap((one) => one.ends), colour("open"));
}

/**
 * @param {Painter} painter
 * @param {MapRoute} route
 */
function drawRoute(painter, { colour, isFaint, flown, ahead }) {
  // Thin instead of pale: a pale line is not seen in the sun.
  painter.lines(flown, { colour, width: isFaint ? 1.5 : 3, isBright: true });
  painter.lines(ahead, { colour, width: isFaint ? 1 : 2, dash: [7, 5], isBright: true });
}

/**
 * @param {Painter} painter
 * @param {MapPlace} shown
 */
function drawPlace(painter, { kind, name, place, colour }) {
  const pixel = painter.view.pixels(place);
  const isPad = kind === "pad";
  painter.shape(pixel, SHAPES[kind], { fill: isPad ? "transparent" : painter.colours("map"), edge: colour ?? painter.colours("ink"), width: 2 });
  if (!isPad && name) painter.write(name, pixel);
}

/**
 * @param {Painter} painter
 * @param {MapVehicle[]} all
 */
export function drawVehicles(painter, all) {
  const { width, height } = painter.view;
  const vehicles = all.filter((one) => {
    const [x, y] = painter.view.pixels(one.place);
    return x > -EDGE_PX && y > -EDGE_PX && x < width + EDGE_PX && y < height + EDGE_PX;
  });
  for (const one of vehicles) painter.keepFree(painter.view.pixels(one.place));
  for (const one of vehicles) drawVehicle(painter, one);
  for (const { place, label, name } of vehicles) {
    if (label !== "") painter.write(label ?? name, painter.view.pixels(place));
  }
}

/**
 * @param {Painter} painter
 * @param {MapVehicle} one
 */
function drawVehicle(painter, one) {
  const [ink, map, bad, warn] = ["ink", "map", "bad", "warn"].map((name) => painter.colours(name));
  const pixel = painter.view.pixels(one.place);
  const size = OUT.has(one.state) ? 13 : 8;
  const isHollow = one.isStale || one.state === "lost";
  if (one.isOutside) painter.ring(pixel, 21, bad, [4, 3]);
  if (one.isChosen) painter.ring(pixel, 17, ink);
  painter.shape(pixel, [[0, -size], [size * 0.72, size * 0.8], [0, size * 0.42], [-size * 0.72, size * 0.8]], {
    fill: isHollow ? map : one.colour, edge: isHollow ? one.colour : map, turnDeg: one.heading_deg ?? 0,
  });
  if (one.isFaulty || one.state === "down") painter.sign(pixel, [[-9, -9, 9, 9], [-9, 9, 9, -9]], bad, 3.5);
  if (one.state === "down") painter.ring(pixel, 30, bad, [8, 4]);
  if (one.state === "pilot") painter.ring(pixel, 24, warn, [3, 5]);
  if (one.state === "holding") painter.sign(pixel, [[-21, -20, -21, -8], [-14, -20, -14, -8]], ink, 4);
}
