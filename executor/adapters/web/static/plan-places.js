// Places and areas, put on the map by click: depot, pads, alternates, bases; areas to keep out of or to stay low in.
import { element } from "./elements.js";
import { button, fileButton, TableForm, TableList } from "./plan-forms.js";
import { schemaAt } from "./plan-schema.js";
import { count, say } from "./plan-texts.js";

/** @import { Edit, Json, LatLon } from "../plan.js" */
/** @import { PlanMap } from "./plan-map.js" */
/** @import { Step } from "./plan-steps.js" */
/** @import { Store } from "./plan-store.js" */

const DIGITS = 7;
const WIDTH_M = 50;

/** @param {number} value */
const rounded = (value) => Number(value.toFixed(DIGITS));

/** @param {LatLon} place */
const asKeys = ([lat, lon]) => ({ lat_deg: rounded(lat), lon_deg: rounded(lon) });

/**
 * The first of NAME1, NAME2 and so on that is free.
 * @param {string} stem
 * @param {string[]} taken
 */
export function freeName(stem, taken) {
  let number = 1;
  while (taken.includes(`${stem}${number}`)) number += 1;
  return `${stem}${number}`;
}

/** @param {Json} list */
const namesOf = (list) => /** @type {Json[]} */ (list ?? []).map((one) => one?.name);

/**
 * @param {Store} store
 * @param {PlanMap} map
 * @returns {Step}
 */
export function placesStep(store, map) {
  const depot = new TableForm(store, ["depot"], schemaAt(store.schema, ["depot"]));
  const places = new TableList(store, ["place"], schemaAt(store.schema, []).properties?.place ?? {}, {
    first: ["name", "kind", "lat_deg", "lon_deg", "alt_m"], isAdded: false, title: (one) => `${one?.name ?? ""} (${one?.kind === "pad" ? say("place.pad") : say("place.alternate")})`,
    extras: (index) => [button(say("place.move"), () => map.askPlace(say("guide.place", { what: namesOf(store.values.place)[index] ?? "" }), (place) => {
      const { lat_deg, lon_deg } = asKeys(place);
      store.edit([
        { op: "set", path: ["place", index, "lat_deg"], value: lat_deg }, { op: "set", path: ["place", index, "lon_deg"], value: lon_deg },
      ], say("edit.move", { what: namesOf(store.values.place)[index] ?? "" }));
    }))],
  });

  const puts = button(say("put.depot"), putDepot);

  function putDepot() {
    map.askPlace(say("guide.place", { what: say("place.depot") }), (place) => {
      const { lat_deg, lon_deg } = asKeys(place);
      store.edit([
        { op: "set", path: ["depot", "lat_deg"], value: lat_deg }, { op: "set", path: ["depot", "lon_deg"], value: lon_deg },
      ], say("edit.place", { what: say("place.depot") }));
    });
  }

  function putPad() {
    const free = /** @type {Json[]} */ (store.values.vehicle ?? []).findIndex((one) => !one?.pad);
    const vehicle = store.values.vehicle?.[free];
    const name = freeName("pad", namesOf(store.values.place));
    const what = vehicle ? say("place.pad-of", { vehicle: vehicle.name }) : say("place.pad");
    map.askPlace(say("guide.place", { what }), (place) => {
      /** @type {Edit[]} */
      const edits = [{ op: "add", path: ["place"], value: { name, kind: "pad", ...asKeys(place) }, at: null }];
      if (vehicle) edits.push({ op: "set", path: ["vehicle", free, "pad"], value: name });
      store.edit(edits, say("edit.place", { what }));
    });
  }

  function putAlternate() {
    const name = freeName("alternate", namesOf(store.values.place));
    map.askPlace(say("guide.place", { what: say("place.alternate") }), (place) => {
      store.edit([{ op: "add", path: ["place"], value: { name, kind: "alternate", ...asKeys(place) }, at: null }],
        say("edit.place", { what: say("place.alternate") }));
    });
  }

  return {
    name: "places",
    paths: [["depot"], ["place"]],
    status: () => {
      const number = namesOf(store.values.place).length;
      if (!store.ground?.depot) return store.network ? say("status.no-depot") : "";
      return number ? count("places", number) : say("place.depot");
    },
    build: (place) => {
      const buttons = element("div", "", "actions");
      buttons.append(puts, button(say("put.pad"), putPad), button(say("put.alternate"), putAlternate));
      const more = element("details", "", "more");
      more.append(element("summary", say("depot.figures")), depot.element);
      place.append(element("p", say("places.how"), "soft"), buttons, places.element, more);
    },
    show: () => {
      puts.classList.toggle("primary", store.problems.some((one) => one.path[0] === "depot"));
      depot.show();
      places.show();
    },
  };
}

/**
 * An area that was drawn.
 * @param {Store} store
 * @param {LatLon[]} ring
 */
export function addArea(store, ring) {
  const name = freeName(say("area.name"), namesOf(store.values.area));
  const polygon = ring.map(([lat, lon]) => [rounded(lat), rounded(lon)]);
  return store.edit([{ op: "add", path: ["area"], value: { name, polygon }, at: null }], say("edit.area", { name }));
}

/**
 * A corridor that was drawn; its width is changed at its field.
 * @param {Store} store
 * @param {LatLon[]} way
 */
function addCorridor(store, way) {
  const name = freeName(say("area.corridor"), namesOf(store.values.area));
  const line = way.map(([lat, lon]) => [rounded(lat), rounded(lon)]);
  return store.edit([{ op: "add", path: ["area"], value: { name, line, width_m: WIDTH_M }, at: null }], say("edit.area", { name }));
}

/**
 * @param {Store} store
 * @param {PlanMap} map
 * @param {() => void} draw
 * @returns {Step}
 */
export function areasStep(store, map, draw) {
  const areas = new TableList(store, ["area"], schemaAt(store.schema, []).properties?.area ?? {}, {
    first: ["name", "margin_m", "max_agl_m", "max_amsl_m", "width_m", "file"], without: ["polygon", "line"], isAdded: false,
    title: (one) => `${one?.name ?? one?.file ?? ""}${one?.max_agl_m !== undefined || one?.max_amsl_m !== undefined ? ` (${say("area.limit")})` : ""}`,
    extras: (index) => [button(say("area.edit"), () => {
      const area = store.values.area?.[index];
      if (!area?.polygon) {
        store.tell(say("area.from-file"));
        return;
      }
      map.editArea(area.polygon, (ring) => {
        store.edit([{ op: "set", path: ["area", index, "polygon"], value: ring.map(([lat, lon]) => [rounded(lat), rounded(lon)]) }],
          say("edit.area-moved", { name: area.name ?? "" }));
      });
    })],
  });
  return {
    name: "areas",
    paths: [["area"]],
    status: () => ((store.values.area ?? []).length ? count("areas", store.values.area.length) : say("status.none")),
    build: (place) => {
      const buttons = element("div", "", "actions");
      buttons.append(button(say("area.draw"), draw), button(say("area.draw-corridor"), () => map.askLine((way) => addCorridor(store, way))));
      buttons.append(fileButton(store, (file) => store.edit([{ op: "add", path: ["area"], value: { file }, at: null }], say("edit.area", { name: file })), say("area.import")));
      place.append(element("p", say("areas.how"), "soft"), buttons, areas.element);
    },
    show: () => areas.show(),
  };
}
