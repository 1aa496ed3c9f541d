// How times, places and states are shown: as in the terminal and in the report.
import { say, translate, writeFigure } from "./translation.js";

/** @import { PositionView, State, Vehicle } from "../documents.js" */

/** @type {Record<string, string>} */
const STATES = { ground: "on the ground", pilot: "with its pilot", down: "down: keep away" };
const FIXES = ["no GPS", "no fix", "2D", "3D", "DGPS", "RTK float", "RTK"];
const WINDS = ["N", "NNE", "NE", "ENE", "E", "ESE", "SE", "SSE", "S", "SSW", "SW", "WSW", "W", "WNW", "NW", "NNW"];
export const LEAST_FIX = 3;

/** @param {number | null | undefined} value */
export const number = (value, digits = 0) => (value === null || value === undefined ? "?" : writeFigure(value.toFixed(digits)));

/**
 * m:ss, with hours where there are some.
 * @param {number | null | undefined} seconds
 */
export function clock(seconds) {
  if (seconds === null || seconds === undefined) return "–";
  const whole = Math.max(0, Math.floor(seconds));
  const pad = (/** @type {number} */ value) => String(value).padStart(2, "0");
  const hours = Math.floor(whole / 3600);
  const minutes = hours ? `${hours}:${pad(Math.floor(whole / 60) % 60)}` : Math.floor(whole / 60);
  return `${minutes}:${pad(whole % 60)}`;
}

/**
 * Since the order to take off; nothing before it.
 * @param {number | null | undefined} flightS
 */
export const since = (flightS) => (flightS === null || flightS === undefined || flightS < 0 ? "" : `T+${clock(flightS)}`);

/**
 * A time on the flight's clock, as one since the order to take off.
 * @param {State} state
 * @param {number} atS
 */
export const flightTime = (state, atS) => (state.flight_s === null ? null : atS - (state.now_s - state.flight_s));

/** @param {string} state */
export const stateWord = (state) => translate(STATES[state] ?? state);

/** @param {Vehicle} vehicle */
export function gps(vehicle) {
  if (vehicle.gps_fix === null) return "GPS ?";
  const kind = translate(FIXES[vehicle.gps_fix] ?? `fix ${vehicle.gps_fix}`);
  const shown = vehicle.gps_fix === 0 ? kind : `GPS ${kind}`;
  return vehicle.satellites === null ? shown : say("{kind}, {satellites} sat", { kind: shown, satellites: vehicle.satellites });
}

/**
 * Coordinates with as many decimals as their accuracy carries: the fifth is a metre.
 * @param {number | null | undefined} accuracyM
 */
const decimals = (accuracyM) => (accuracyM === null || accuracyM === undefined ? 5 : accuracyM < 1 ? 6 : accuracyM < 11 ? 5 : accuracyM < 110 ? 4 : 3);

/** @param {Pick<PositionView, "lat_deg" | "lon_deg" | "accuracy_m">} at */
export const place = (at) => [at.lat_deg, at.lon_deg].map((deg) => deg.toFixed(decimals(at.accuracy_m))).join(", ");

/**
 * How a position is known, in words.
 * @param {PositionView} position
 */
export const known = (position) =>
  position.known === "reckoned" ? say("dead reckoning without GPS, error {off} m or more", { off: number(position.accuracy_m) })
    : position.known === "fix" ? `GPS, ${number(position.accuracy_m, 1)} m` : say("GPS not reported");

/** @param {number} fromDeg */
export const windFrom = (fromDeg) => say(WINDS[Math.round((((fromDeg % 360) + 360) % 360) / 22.5) % 16]);

/**
 * What is shown of an age: tenths of a second mean nothing when it is long.
 * @param {number} seconds
 */
export const age = (seconds) => (seconds < 60 ? `${number(seconds, seconds < 10 ? 1 : 0)} s` : clock(seconds));
