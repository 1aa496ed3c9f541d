// The map of a report: what became of each segment, where everybody flew, where one was lost, and what was planned.
import { all, byId, element, write } from "./elements.js";
import { FleetMap, hueOf } from "./map.js";
import { areasOf } from "./map-content.js";
import { projectionOf } from "./map-view.js";

/** @import { GroundDocument, Place, ReportMap, ReportSegment } from "../documents.js" */
/** @import { MapVehicle, SegmentState } from "./map-content.js" */
/** @import { Choice } from "./map.js" */

/** @type {Record<string, string>} */
const STATES = {
  missed: "flown, but not seen", "left-over": "not inspected", "left-out": "left out", unreachable: "out of reach",
};

/** @param {string} id */
const read = (id) => JSON.parse(byId(id, HTMLScriptElement).text);
/** @type {ReportMap} */
const flight = read("flight");
/** @type {GroundDocument | null} */
const ground = read("ground");
/** @type {Record<string, string>} */
const images = read("images");
const degrees = flight.frame ? projectionOf(flight.frame).toDegrees : null;
/** @type {string | null} */
let chosen = null;
/** @type {Choice | null} */
let touched = null;
let shown = "";

byId("unmapped").hidden = true;
byId("mapped").hidden = false;
const map = new FleetMap(byId("map"), {
  name: "Map of the line, of what was flown and of what was planned",
  isMetres: true,
  isOfFlight: true,
  isOfPast: true,
  onPoint: (place) => {
    write(byId("pointed"), place && degrees ? degrees(place).map((one) => one.toFixed(5)).join(", ") : "");
    show((place && map.hit(place)) ?? touched);
  },
  onChoose: (choice) => {
    touched = choice;
    shown = "";
    show(choice);
    if (choice?.kind === "vehicle") choose(choice.id);
  },
});

/**
 * Says in a line what is pointed at.
 * @param {Choice | null} found
 */
function show(found) {
  const key = found ? `${found.kind} ${found.id}` : "";
  if (key === shown) return;
  shown = key;
  map.name(found?.kind === "segment" ? found.id : null);
  write(byId("detail"), found ? describe(found) : "");
}

/** @param {Choice} found */
function describe({ kind, id }) {
  if (kind === "segment") return describeSegment(flight.segments[id]);
  if (kind === "area") return flight.areas[id].name;
  if (kind === "place") return id;
  const vehicle = flight.vehicles.find((one) => one.name === id);
  const lost = vehicle?.lost ? `lost at ${vehicle.lost.at}: ${vehicle.lost.why}` : "";
  return `${id}: ${[lost, vehicle?.end ? `at the end ${vehicle.end.state}` : ""].filter(Boolean).join("; ")}`;
}

/** @param {ReportSegment} one */
function describeSegment(one) {
  const what = one.by ? `${one.state === "inferred" ? "counts by evidence alone, flown" : "inspected"} by ${one.by}` : STATES[one.state];
  const whose = one.planned && one.planned !== one.by ? `planned for ${one.planned}` : "";
  return `${one.name}: ${[`${what}${one.at ? ` at ${one.at}` : ""}`, whose].filter(Boolean).join("; ")}`;
}

/** @param {string} name */
function choose(name) {
  chosen = chosen === name ? null : name;
  for (const button of all(byId("fleet"), "button")) button.setAttribute("aria-pressed", String(button.textContent === chosen));
  drawRoutes();
}

function drawRoutes() {
  const plan = flight.plans[Number(byId("planned", HTMLSelectElement).value || NaN)];
  map.setRoutes(flight.vehicles.map(({ name, flown_m: flown }, index) => ({
    vehicle: name, colour: hueOf(index), isFaint: chosen !== null && chosen !== name, flown,
    ahead: (plan?.routes ?? []).filter((one) => one.vehicle === name).map((one) => one.way_m),
  })));
}

/** @returns {MapVehicle[]} */
function listMarks() {
  return flight.vehicles.flatMap(({ name, lost, end }, index) => {
    const look = { name, colour: hueOf(index), heading_deg: null };
    return [
      ...(end ? [{ ...look, place: end.place_m, state: end.state, label: `${name}: ${end.state}` }] : []),
      ...(lost ? [{ ...look, place: lost.place_m, state: "lost", isFaulty: true, label: `${name}: lost ${lost.at}` }] : []),
    ];
  });
}

function showLayer() {
  byId("layer").hidden = map.ground.layers.length < 2;
  write(byId("layer"), map.ground.word());
  write(byId("attribution"), map.ground.attribution());
}

map.setNetwork(flight.segments.map(({ name, ends_m: [a, b], state, taken_over: isChosen }, id) => ({
  id, name, a, b, state: /** @type {SegmentState} */ (state), isChosen,
})));
map.setAreas(areasOf(flight.areas));
map.setPlaces([
  { kind: "depot", name: "", place: /** @type {Place} */ ([0, 0]) },
  ...flight.places.map(({ kind, name, place_m: place }) => ({ kind: /** @type {"base" | "alternate"} */ (kind), name, place })),
  ...flight.vehicles.map(({ name, pad_m: place }, index) => ({ kind: /** @type {const} */ ("pad"), name, place, colour: hueOf(index) })),
]);
map.setVehicles(listMarks());
if (ground) map.ground.show(ground, (name) => images[name]);
byId("fleet").append(...flight.vehicles.map(({ name }, index) => {
  const button = element("button", name);
  button.style.setProperty("--hue", hueOf(index));
  button.setAttribute("aria-pressed", "false");
  button.addEventListener("click", () => choose(name));
  return button;
}));
byId("planned").addEventListener("change", drawRoutes);
byId("layer").addEventListener("click", () => {
  map.ground.next();
  showLayer();
});
byId("zoom").addEventListener("click", (event) => {
  const way = event.target instanceof Element ? event.target.closest("button")?.dataset.zoom : "";
  if (way === "fit") map.fit();
  else if (way) map.zoom(way === "in" ? 1.5 : 1 / 1.5);
});
drawRoutes();
showLayer();
map.fit();
