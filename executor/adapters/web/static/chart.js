// The map of a flight: what the state says of the line, the routes and the vehicles, as the map takes it.
import { byId } from "./elements.js";
import { FleetMap, hueOf } from "./map.js";
import { areasOf } from "./map-content.js";
import { say } from "./translation.js";

/** @import { PageChart, PageVehicle, Place, State, Vehicle } from "../documents.js" */
/** @import { MapRoute, MapVehicle, SegmentState } from "./map-content.js" */

/** @type {Record<string, string>} */
const STATES = { pilot: "with its pilot", down: "keep away", lost: "lost" };
const TOLD = new Set(["flying", "holding", "starting", "returning", "landing", "pilot", "down"]);
const AHEAD = new Set(["flying", "holding", "starting", "pilot"]);
const STEP_M = 3;

export class Chart {
  /**
   * @param {(name: string) => void} choose
   * @param {(place: Place | null) => void} pointed
   * @param {(segment: number | null) => void} touched
   */
  constructor(choose, pointed, touched) {
    this.map = new FleetMap(byId("map"), {
      name: say("Map of the line, the routes and the vehicles"),
      isMetres: true,
      isOfFlight: true,
      onPoint: pointed,
      onChoose: (choice) => (choice?.kind === "vehicle" ? choose(choice.id) : touched(choice?.kind === "segment" ? choice.id : null)),
    });
    /** @type {PageChart | null} */
    this.chart = null;
    /** @type {State | null} */
    this.state = null;
    /** @type {string | null} */
    this.chosen = null;
    /** @type {Map<string, Place[]>} */
    this.tracks = new Map();
  }

  /** @param {PageChart} chart */
  load(chart) {
    this.chart = chart;
    for (const vehicle of chart.vehicles) {
      const known = this.tracks.get(vehicle.name);
      if (!known || known.length < vehicle.track_m.length) this.tracks.set(vehicle.name, vehicle.track_m);
    }
    this.map.setAreas(areasOf(chart.areas));
    this.map.setPlaces(chart.vehicles.map(({ name, pad_m }, index) => ({ kind: "pad", name, place: pad_m, colour: hueOf(index) })));
    this.draw();
  }

  /** @param {State} state */
  show(state) {
    this.state = state;
    for (const vehicle of state.vehicles) {
      if (!vehicle.place_m || !vehicle.armed) continue;
      const track = this.tracks.get(vehicle.name) ?? [];
      const last = track.at(-1);
      if (!last || Math.hypot(last[0] - vehicle.place_m[0], last[1] - vehicle.place_m[1]) > STEP_M) track.push(vehicle.place_m);
      this.tracks.set(vehicle.name, track);
    }
    this.draw();
  }

  /** @param {string | null} name */
  choose(name) {
    this.chosen = name;
    this.draw();
  }

  draw() {
    const vehicles = this.state?.vehicles ?? [];
    this.map.setVehicles(vehicles.flatMap((one, index) => (one.place_m ? [this.mark(one, one.place_m, index)] : [])));
    if (!this.chart) return;
    this.drawNetwork(this.chart);
    this.map.setRoutes(this.chart.vehicles.map((one, index) => this.route(one, vehicles[index], index)));
  }

  /** @param {PageChart} chart */
  drawNetwork(chart) {
    /** @type {Map<number, SegmentState>} */
    const states = new Map();
    const { uncovered = [], inspected = [], inferred = [], missed = [], vehicles = [] } = this.state ?? {};
    const found = /** @type {[number[], SegmentState][]} */ ([[chart.left_out, "left-out"], [chart.unreachable, "unreachable"], [uncovered, "left-over"], [inspected, "done"], [inferred, "inferred"], [missed, "missed"]]);
    for (const [segments, state] of found) for (const one of segments) states.set(one, state);
    const current = new Map(vehicles.map((one, index) => [one.progress.segment, hueOf(index)]));
    this.map.setNetwork(chart.segments_m.map(([a, b], id) => ({ id, name: chart.names[id] ?? "", a, b, state: states.get(id) ?? "open", colour: current.get(id) })));
  }

  /**
   * @param {PageVehicle} chart
   * @param {Vehicle | undefined} vehicle
   * @param {number} index
   * @returns {MapRoute}
   */
  route(chart, vehicle, index) {
    const isFaint = this.chosen !== null && this.chosen !== chart.name;
    const ahead = [];
    if (chart.route && vehicle) {
      if (this.state?.flight_s === null) ahead.push([chart.pad_m, ...chart.route.places_m]);
      if (vehicle.place_m && AHEAD.has(vehicle.state)) ahead.push([vehicle.place_m, ...chart.route.places_m.slice(vehicle.waypoint)]);
    }
    return { vehicle: chart.name, colour: hueOf(index), isFaint, flown: [this.tracks.get(chart.name) ?? []], ahead };
  }

  /**
   * @param {Vehicle} vehicle
   * @param {Place} place
   * @param {number} index
   * @returns {MapVehicle}
   */
  mark(vehicle, place, index) {
    const { name, state, position } = vehicle;
    const height = position ? ` ${position.relative_alt_m.toFixed(0)} m` : "";
    const isTold = TOLD.has(state) || vehicle.fault || vehicle.offered;
    return {
      name, place, heading_deg: position?.heading_deg ?? null, colour: hueOf(index), state, isChosen: this.chosen === name, isStale: vehicle.stale,
      isFaulty: vehicle.fault !== null, isOutside: vehicle.loss?.inside_window === false,
      label: isTold ? `${name}${STATES[state] ? `: ${say(STATES[state])}` : ` L${vehicle.layer + 1}${height}`}` : "",
    };
  }
}
