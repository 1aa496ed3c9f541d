// The vehicles, each with a connection that can be tried; how they inspect; their days; and every other table.
import { element, write } from "./elements.js";
import { server } from "./plan-api.js";
import { button, TableForm, TableList } from "./plan-forms.js";
import { hueOf } from "./map.js";
import { freeName } from "./plan-places.js";
import { labelOf, meaningOf, resolve, schemaAt } from "./plan-schema.js";
import { count, say } from "./plan-texts.js";

/** @import { Json, LatLon } from "../plan.js" */
/** @import { PlanMap } from "./plan-map.js" */
/** @import { Step } from "./plan-steps.js" */
/** @import { Store } from "./plan-store.js" */

const MOST_SYSID = 254;
const OTHERS = ["terrain", "map", "energy", "fence", "faults", "flight", "link", "forward", "signing", "mqtt", "web"];

/**
 * A vehicle like the last one, with a name, a system id and a port of its own.
 * @param {Json[]} vehicles
 */
export function nextVehicle(vehicles) {
  const last = vehicles.at(-1) ?? { connection: "udpin://0.0.0.0:14540", autopilot: "ardupilot" };
  const { pad, pack, ...alike } = last;
  const taken = new Set(vehicles.map((one) => one?.sysid));
  let sysid = 1;
  while (taken.has(sysid) && sysid < MOST_SYSID) sysid += 1;
  const connection = typeof last.connection === "string"
    ? last.connection.replace(/:(\d+)$/, (/** @type {string} */ _, /** @type {string} */ port) => `:${Number(port) + (last.connection.startsWith("serial") ? 0 : 1)}`)
    : last.connection;
  return { ...alike, name: freeName("uav", vehicles.map((one) => one?.name)), connection, sysid };
}

/**
 * @param {Store} store
 * @returns {Step}
 */
export function vehiclesStep(store) {
  /** @type {HTMLElement[]} */
  const answers = [];
  const energy = new TableForm(store, ["energy"], schemaAt(store.schema, ["energy"]), { first: ["drone", "capacity_ah", "mass_kg"] });
  const pads = () => /** @type {Json[]} */ (store.values.place ?? []).filter((one) => one?.kind === "pad")
    .map((one) => /** @type {[string, string]} */ ([String(one.name), String(one.name)]));
  const list = new TableList(store, ["vehicle"], schemaAt(store.schema, []).properties?.vehicle ?? {}, {
    first: ["name", "connection", "sysid", "autopilot", "budget_pct", "reserve_pct", "pad"],
    choices: { pad: pads }, word: say("vehicle"), note: (one) => [one?.connection].flat().join(", ") + (one?.budget_pct === undefined ? "" : ` · ${one.budget_pct} %`), add: () => nextVehicle(store.values.vehicle ?? []),
    extras: (index) => {
      const answer = element("output", "", "tried");
      answers[index] = answer;
      return [button(say("try"), () => attempt(index), "try"), answer];
    },
  });

  /** @param {number} index */
  async function attempt(index) {
    const vehicle = store.values.vehicle?.[index];
    const answer = answers[index];
    if (!vehicle || !answer) return;
    answer.className = "tried";
    write(answer, say("try.listening"));
    // Each of several ways to it is listened on; the answer names the way.
    const ways = /** @type {string[]} */ ([vehicle.connection].flat());
    const words = [];
    let isHeard = true;
    for (const way of ways) {
      const heard = await store.ask(() => server.tryConnection(way, vehicle.sysid, vehicle.autopilot));
      isHeard = isHeard && (heard?.answers ?? false);
      const said = heard?.words ?? store.refusal;
      words.push(ways.length > 1 ? `${way}: ${said}` : said);
    }
    write(answer, words.join("; "));
    answer.classList.add(isHeard ? "is-good" : "is-bad");
  }

  return {
    name: "vehicles",
    paths: [["vehicle"], ["energy"]],
    status: () => count("vehicles", store.names.length),
    build: (place) => {
      const drone = element("details", "", "more");
      drone.append(element("summary", say("vehicles.energy")), energy.element);
      const all = button(say("try.all"), () => store.names.forEach((_, index) => {
        list.forms[index].box.open = true;
        attempt(index);
      }));
      place.append(list.element, all, drone);
    },
    show: () => {
      list.show();
      list.forms.forEach(({ box }, index) => {
        box.style.setProperty("--hue", hueOf(index));
        box.classList.add("of-vehicle");
      });
      energy.show();
    },
  };
}

/**
 * @param {Store} store
 * @returns {Step}
 */
export function inspectionStep(store) {
  const form = new TableForm(store, ["inspection"], schemaAt(store.schema, ["inspection"]), {
    first: ["height_m", "standoff_m", "speed_m_s", "transit_speed_m_s", "layer_m", "wind_m_s"],
  });
  const root = schemaAt(store.schema, []).properties ?? {};
  const cameras = () => /** @type {Json[]} */ (store.values.camera ?? []).map((one) => /** @type {[string, string]} */ ([String(one?.name), String(one?.name)]));
  const camera = new TableList(store, ["camera"], root.camera ?? {}, {
    first: ["name", "vehicles", "focal_mm", "sensor_mm", "image_px", "gimbal"], word: say("camera"),
    add: () => ({ name: freeName("camera", (store.values.camera ?? []).map((/** @type {Json} */ one) => one?.name)) }),
  });
  const look = new TableList(store, ["look"], root.look ?? {}, {
    first: ["camera", "of", "segments", "pylons", "take", "every_m", "overlap_pct", "bearings_deg"], choices: { camera: cameras }, word: say("look"),
    add: () => ({ camera: store.values.camera?.[0]?.name ?? "", every_m: 10 }),
    title: (one) => `${one?.camera ?? ""}: ${one?.of === "pylons" ? say("look.pylons") : say("look.spans")}`,
  });
  return {
    name: "inspection",
    paths: [["inspection"], ["camera"], ["look"]],
    status: () => `${store.values.inspection?.height_m ?? resolve(root.inspection ?? {}, store.schema).schema.properties?.height_m?.default ?? ""} m`,
    build: (place) => {
      place.append(form.element, element("h3", say("cameras")), camera.element, element("h3", say("looks")), look.element);
    },
    show: () => {
      form.show();
      camera.show();
      look.show();
    },
  };
}

/**
 * @param {Store} store
 * @param {PlanMap} map
 * @returns {Step}
 */
export function dayStep(store, map) {
  const form = new TableForm(store, ["day"], schemaAt(store.schema, ["day"]), { first: ["begin", "end", "days", "lands", "stagger_s", "quiet"] });
  const bases = new TableList(store, ["base"], schemaAt(store.schema, []).properties?.base ?? {}, {
    first: ["name", "packs", "turnaround_s", "recharge_s", "vehicles"], word: say("place.base"), isAdded: false,
    extras: (index) => [button(say("place.move"), () => map.askPlace(say("guide.place", { what: store.values.base?.[index]?.name ?? "" }), ([lat, lon]) => {
      store.edit([
        { op: "set", path: ["base", index, "lat_deg"], value: Number(lat.toFixed(7)) },
        { op: "set", path: ["base", index, "lon_deg"], value: Number(lon.toFixed(7)) },
      ], say("edit.move", { what: store.values.base?.[index]?.name ?? "" }));
    }))],
  });
  const begins = button(say("day.begin"), () => store.edit([{ op: "set", path: ["day"], value: { begin: "08:00", end: "16:00" } }], say("edit.day")));
  const ends = button(say("day.end"), () => store.edit([{ op: "unset", path: ["day"] }], say("edit.no-day")), "remove");
  const puts = button(say("put.base"), () => {
    map.askPlace(say("guide.place", { what: say("place.base") }), (/** @type {LatLon} */ [lat, lon]) => {
      const name = freeName("base", (store.values.base ?? []).map((/** @type {Json} */ one) => one?.name));
      store.edit([{ op: "add", path: ["base"], value: { name, lat_deg: Number(lat.toFixed(7)), lon_deg: Number(lon.toFixed(7)) }, at: null }],
        say("edit.place", { what: say("place.base") }));
    });
  });
  return {
    name: "day",
    paths: [["day"], ["base"]],
    status: () => (store.values.day ? `${store.values.day.begin ?? "08:00"}–${store.values.day.end ?? "16:00"}` : say("status.one-flight")),
    build: (place) => {
      const buttons = element("div", "", "actions");
      buttons.append(begins, puts);
      place.append(element("p", say("day.how"), "soft"), buttons, form.element, element("h3", say("bases")), bases.element, ends);
    },
    show: () => {
      const isDay = store.values.day !== undefined;
      begins.hidden = isDay;
      ends.hidden = form.element.hidden = !isDay;
      if (isDay) form.show();
      bases.show();
    },
  };
}

/**
 * Every other table of the site file.
 * @param {Store} store
 * @returns {Step}
 */
export function otherStep(store) {
  const known = schemaAt(store.schema, []).properties ?? {};
  const names = OTHERS.filter((one) => known[one] && one !== "energy");
  /** @type {{ name: string, form: TableForm, box: HTMLDetailsElement, state: HTMLElement }[]} */
  const tables = names.map((name) => {
    const { schema } = resolve(known[name], store.schema);
    const form = new TableForm(store, [name], schema);
    const box = element("details", "", "item");
    const head = element("summary");
    const state = element("span", "", "status");
    head.append(element("b", labelOf([name])), state);
    box.append(head, element("p", meaningOf([name], schema), "soft"), form.element);
    box.addEventListener("toggle", () => {
      if (box.open) form.show();
    });
    return { name, form, box, state };
  });
  return {
    name: "other",
    paths: names.map((one) => [one]),
    status: () => "",
    build: (place) => place.append(...tables.map((one) => one.box)),
    show: () => {
      for (const { name, form, box, state } of tables) {
        const given = Object.keys(store.values[name] ?? {}).length;
        write(state, given ? count("keys.given", given) : "");
        box.classList.toggle("is-wrong", store.problems.some((one) => one.path[0] === name));
        if (box.open) form.show();
      }
    },
  };
}
