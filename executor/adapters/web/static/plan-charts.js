// Pictures of a plan that are lines: the height and the battery of each vehicle over the time, and the plans
// to choose from by longest route and window.

import { apartM } from "./plan-track.js";

/** @import { PlanSummary, PlannedRoute, PlannedVehicle } from "../plan.js" */

const SPACE = "http://www.w3.org/2000/svg";
export const WIDE = 1000;
export const HIGH = 200;

/**
 * @param {string} tag
 * @param {Record<string, string | number>} [attributes]
 * @param {string} [text]
 */
export function shape(tag, attributes = {}, text = "") {
  const made = document.createElementNS(SPACE, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, String(value));
  if (text) made.textContent = text;
  return made;
}

/**
 * A step between lines of a scale: 1, 2 or 5 times a power of ten, with about so many of them.
 * @param {number} range
 * @param {number} lines
 */
export function stepOf(range, lines) {
  const rough = Math.max(range, 1e-6) / lines;
  const power = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].map((one) => one * power).find((one) => one >= rough) ?? 10 * power;
}

/**
 * @param {[number, number][]} points
 * @param {(point: [number, number]) => [number, number]} place
 */
const asPoints = (points, place) => points.map((one) => place(one).map((value) => value.toFixed(1)).join(",")).join(" ");

/**
 * Lines in an even frame, with a scale at the left side; the labels are texts beside the picture, which is stretched.
 * @param {{ low: number, high: number, from: number, to: number, unit: string }} scale
 * @param {{ points: [number, number][], colour?: string, name: string, isFilled?: boolean, isFaint?: boolean }[]} lines
 * @param {string} title
 */
export function drawLines({ low, high, from, to, unit }, lines, title) {
  const svg = shape("svg", { viewBox: `0 0 ${WIDE} ${HIGH}`, preserveAspectRatio: "none", role: "img", "aria-label": title });
  const place = (/** @type {[number, number]} */ [x, y]) => /** @type {[number, number]} */ ([
    (WIDE * (x - from)) / Math.max(1e-9, to - from), HIGH - (HIGH * (y - low)) / Math.max(1e-9, high - low),
  ]);
  /** @type {{ share: number, text: string }[]} */
  const labels = [];
  const step = stepOf(high - low, 4);
  for (let value = Math.ceil(low / step) * step; value <= high + 1e-9; value += step) {
    const y = place([from, value])[1];
    svg.append(shape("line", { x1: 0, x2: WIDE, y1: y, y2: y, class: "grid" }));
    labels.push({ share: y / HIGH, text: `${Number(value.toFixed(2))} ${unit}` });
  }
  for (const { points, colour, name, isFilled, isFaint } of lines) {
    if (points.length < 2) continue;
    const shaped = isFilled
      ? shape("polygon", { points: asPoints([[points[0][0], low], ...points, [points[points.length - 1][0], low]], place), class: name })
      : shape("polyline", { points: asPoints(points, place), class: `${name}${isFaint ? " faint" : ""}` });
    if (colour) shaped.setAttribute("stroke", colour);
    svg.append(shaped);
  }
  return { svg, labels };
}

/**
 * The time at which a route has come a share of its way.
 * @param {PlannedRoute} route
 * @returns {(share: number) => number}
 */
function timeOfWay({ track }) {
  const ways = [0];
  for (let index = 1; index < track.length; index += 1) {
    const [before, after] = [track[index - 1], track[index]];
    ways.push(ways[index - 1] + apartM([before[1], before[2]], [after[1], after[2]]));
  }
  const whole = ways[ways.length - 1];
  return (share) => {
    const way = share * whole;
    const next = Math.max(1, ways.findIndex((one) => one >= way));
    const length = ways[next] - ways[next - 1];
    const part = length > 0 ? Math.min(1, (way - ways[next - 1]) / length) : 0;
    return track[next - 1][0] + part * (track[next][0] - track[next - 1][0]);
  };
}

/**
 * The ground below the first route of a vehicle, over the time.
 * @param {PlannedVehicle} vehicle
 * @returns {[number, number][]}
 */
function groundOf({ routes, profile }) {
  const whole = profile.at(-1)?.[0] ?? 0;
  if (!routes.length || routes[0].track.length < 2 || whole <= 0) return [];
  const timeOf = timeOfWay(routes[0]);
  return profile.flatMap(([distance, , below]) => (below === null ? [] : [[timeOf(distance / whole), below]]));
}

/**
 * Heights of one vehicle over the time of the plan, with the ground where it is known.
 * @param {PlannedVehicle} vehicle
 * @param {string} colour
 * @param {[number, number]} times
 * @param {string} title
 */
export function drawProfile(vehicle, colour, [from, to], title) {
  const paths = vehicle.routes.map((route) => route.track.map(([at, , , up]) => /** @type {[number, number]} */ ([at, up])));
  const ground = groundOf(vehicle);
  const heights = [...paths.flat(), ...ground].map((one) => one[1]);
  const low = Math.min(0, ...heights);
  const high = Math.max(10, ...heights) * 1.05;
  return drawLines({ low, high, from, to, unit: "m" },
    [{ points: ground, name: "ground", isFilled: true }, ...paths.map((points) => ({ points, colour, name: "path" }))], title);
}

/**
 * Batteries over the time of the plan.
 * @param {PlannedVehicle[]} vehicles
 * @param {(index: number) => string} colour
 * @param {[number, number]} times
 * @param {string | null} chosen
 * @param {string} title
 */
export function drawBatteries(vehicles, colour, [from, to], chosen, title) {
  const lines = vehicles.flatMap((one, index) => one.routes.map((route) => ({
    points: route.track.map(([at, , , , pct]) => /** @type {[number, number]} */ ([at, pct])),
    colour: colour(index), name: "path", isFaint: chosen !== null && chosen !== one.name,
  })));
  return drawLines({ low: 0, high: 100, from, to, unit: "%" }, lines, title);
}

/**
 * Plans as points: the shorter their longest route the farther left, the larger their window the higher.
 * @param {PlanSummary[]} plans
 * @param {string | null} chosen
 * @param {(id: string) => void} choose
 * @param {(plan: PlanSummary) => string} describe
 */
export function drawFront(plans, chosen, choose, describe) {
  const known = plans.filter((one) => one.window_pct !== null);
  const longest = known.map((one) => one.longest_s);
  const [low, high] = [Math.min(...longest), Math.max(...longest)];
  const svg = shape("svg", { viewBox: "0 0 360 130", class: "front" });
  svg.append(shape("path", { d: "M30 6V108H354", class: "axis" }));
  for (const one of known) {
    const x = 46 + (290 * (one.longest_s - low)) / Math.max(1, high - low);
    const y = 100 - (86 * (one.window_pct ?? 0)) / 100;
    const point = shape("circle", { cx: x, cy: y, r: one.id === chosen ? 9 : 7, class: one.id === chosen ? "chosen" : "", tabindex: 0, role: "button", "aria-label": describe(one) });
    point.append(shape("title", {}, describe(one)));
    point.addEventListener("click", () => choose(one.id));
    point.addEventListener("keydown", (event) => {
      if (event instanceof KeyboardEvent && (event.key === "Enter" || event.key === " ")) choose(one.id);
    });
    svg.append(point);
  }
  return svg;
}
