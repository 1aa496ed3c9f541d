// Where vehicles are at a time of a plan, what they do there, and what is left in their batteries.

/** @import { Corner, LatLon, PlannedRoute, PlannedVehicle, PlannedVisit } from "../plan.js" */

/** @typedef {{ route: PlannedRoute, isFlying: boolean, place: LatLon | null, upM: number, batteryPct: number | null, headingDeg: number | null, visit: PlannedVisit | null }} Moment */

/**
 * The number of the last corner that is not later than a time.
 * @param {Corner[]} track
 * @param {number} timeS
 */
function lastBefore(track, timeS) {
  let [low, high] = [0, track.length - 1];
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (track[middle][0] <= timeS) low = middle;
    else high = middle - 1;
  }
  return low;
}

/**
 * The direction from one place to another, clockwise from north.
 * @param {LatLon} from
 * @param {LatLon} to
 */
export function headingDeg([lat0, lon0], [lat1, lon1]) {
  const east = (lon1 - lon0) * Math.cos((lat0 * Math.PI) / 180);
  return ((Math.atan2(east, lat1 - lat0) * 180) / Math.PI + 360) % 360;
}

/**
 * A vehicle at a time: on the route that it flies then, else on the last one before, else on its first.
 * @param {PlannedVehicle} vehicle
 * @param {number} timeS
 * @returns {Moment | null}
 */
export function momentOf(vehicle, timeS) {
  const routes = vehicle.routes;
  if (!routes.length) return null;
  const route = routes.filter((one) => one.start_s <= timeS).at(-1) ?? routes[0];
  const isFlying = timeS > route.start_s && timeS < route.start_s + route.duration_s;
  const { track } = route;
  const visit = route.visits.find((one) => one.from_s <= timeS && timeS <= one.to_s) ?? null;
  if (!track.length) return { route, isFlying, place: null, upM: 0, batteryPct: null, headingDeg: null, visit };
  const index = lastBefore(track, timeS);
  const before = track[index];
  const after = track[Math.min(index + 1, track.length - 1)];
  const share = after[0] > before[0] ? Math.min(1, Math.max(0, (timeS - before[0]) / (after[0] - before[0]))) : 0;
  const between = (/** @type {1 | 2 | 3 | 4} */ axis) => before[axis] + share * (after[axis] - before[axis]);
  const isMoving = before[1] !== after[1] || before[2] !== after[2];
  return {
    route, isFlying, place: [between(1), between(2)], upM: between(3), batteryPct: between(4), visit,
    headingDeg: isMoving ? headingDeg([before[1], before[2]], [after[1], after[2]]) : null,
  };
}

/**
 * A route as a line, from a time on or up to it.
 * @param {PlannedRoute} route
 * @param {number} timeS
 * @returns {[LatLon[], LatLon[]]} what is flown by then, and what is ahead
 */
export function splitAt(route, timeS) {
  const places = route.track.map(([, lat, lon]) => /** @type {LatLon} */ ([lat, lon]));
  if (!places.length || timeS <= route.start_s) return [[], places];
  if (timeS >= route.start_s + route.duration_s) return [places, []];
  const index = lastBefore(route.track, timeS);
  const [before, after] = [route.track[index], route.track[Math.min(index + 1, places.length - 1)]];
  const share = after[0] > before[0] ? (timeS - before[0]) / (after[0] - before[0]) : 0;
  /** @type {LatLon} */
  const here = [before[1] + share * (after[1] - before[1]), before[2] + share * (after[2] - before[2])];
  return [[...places.slice(0, index + 1), here], [here, ...places.slice(index + 1)]];
}

const EARTH_M = 6371008.8;

/**
 * @param {LatLon} one
 * @param {LatLon} other
 */
export function apartM([lat0, lon0], [lat1, lon1]) {
  const rad = Math.PI / 180;
  const east = (lon1 - lon0) * rad * Math.cos(((lat0 + lat1) / 2) * rad);
  return EARTH_M * Math.hypot(east, (lat1 - lat0) * rad);
}
