// The map of the plan page: what the store knows, drawn by the map component, and what is pointed at, told to the store.
import { byId, write } from "./elements.js";
import { FleetMap, hueOf } from "./map.js";
import { count, figure, say } from "./plan-texts.js";
import { splitAt } from "./plan-track.js";

/** @import { LatLon, Path } from "../plan.js" */
/** @import { SegmentState } from "./map-content.js" */
/** @import { Choice } from "./map.js" */
/** @import { ToolName } from "./map-tools.js" */
/** @import { Store } from "./plan-store.js" */

/** @typedef {"pick" | "box" | "lasso" | "area" | "line" | "place" | "edit"} Tool */

export class PlanMap {
  /**
   * @param {Store} store
   * @param {{ area: (ring: LatLon[]) => void, chosen: (path: Path) => void, cancel: () => void, locks: () => Map<number, string> }} made
   */
  constructor(store, made) {
    this.store = store;
    this.made = made;
    /** @type {Tool} */
    this.tool = "pick";
    /** The network that the map was fitted to. */
    this.fitted = "";
    this.grounded = "";
    this.wasLost = false;
    this.map = new FleetMap(byId("plan-map"), {
      name: say("map.name"),
      onChoose: (choice) => this.choose(choice),
      onCancel: () => made.cancel(),
      onPoint: (place) => this.point(place),
    });
    store.on(["network", "selection", "draft", "plan", "workspace"], () => this.showNetwork());
    store.on(["ground", "plan", "draft"], () => this.showGround());
    store.on(["plan", "time", "loss", "vehicle", "draft"], () => this.showRoutes());
    byId("tools").addEventListener("click", (event) => {
      const pressed = event.target instanceof Element ? event.target.closest("button") : null;
      if (pressed) this.use(/** @type {Tool} */ (pressed.dataset.tool));
    });
    byId("layer").addEventListener("click", () => {
      this.map.ground.next();
      this.showLayer();
    });
    byId("tool-done").addEventListener("click", () => this.map.finishTool());
    byId("tool-back").addEventListener("click", () => this.map.removeCorner());
    byId("tool-cancel").addEventListener("click", () => this.stop());
    byId("zoom").addEventListener("click", (event) => {
      const way = event.target instanceof Element ? event.target.closest("button")?.dataset.zoom : "";
      if (way === "fit") this.map.fit();
      else if (way) this.map.zoom(way === "in" ? 1.5 : 1 / 1.5);
    });
  }

  /** @param {LatLon | null} place */
  point(place) {
    write(byId("pointed"), place === null ? "" : this.map.ground.document ? this.map.ground.describe(place) : place.map((one) => one.toFixed(5)).join(", "));
  }

  /** @param {Choice | null} choice */
  choose(choice) {
    const { store } = this;
    if (choice?.kind === "segment") store.select([choice.id], "toggle");
    else if (choice?.kind === "vehicle") store.chooseVehicle(choice.id);
    else if (choice?.kind === "place" && choice.id.startsWith("pad ")) store.chooseVehicle(choice.id.slice(4));
    else if (choice?.kind === "place") this.made.chosen(["place"]);
    else if (choice?.kind === "area") this.made.chosen(["area", choice.id]);
    else store.chooseVehicle(null);
  }

  /** Shows what lies below the line, where something is known of it. */
  async loadGround() {
    const { terrain, map, network, depot } = this.store.values;
    const key = JSON.stringify([terrain, map, network, depot, this.store.network?.digest]);
    if (key === this.grounded) return;
    this.grounded = key;
    await this.map.ground.load("/api/background/ground.json").catch(() => {});
    this.showLayer();
  }

  showLayer() {
    const { ground } = this.map;
    byId("layer").hidden = ground.layers.length < 2;
    write(byId("layer"), say(`layer.${ground.layer}`));
    write(byId("attribution"), ground.attribution());
  }

  /** @param {Tool} tool */
  use(tool) {
    this.stop();
    if (tool === "box" || tool === "lasso") {
      this.start(tool, say(`guide.${tool === "box" ? "box" : "lasso"}`), `select-${tool}`, (found) => {
        this.store.select(/** @type {number[]} */ (found), "add");
        this.stop();
      });
    } else if (tool === "area") {
      this.start(tool, say("guide.area"), "polygon", (ring) => {
        this.stop();
        if (ring.length >= 3) this.made.area(/** @type {LatLon[]} */ (ring));
      });
    }
  }

  /**
   * Asks for a place on the map.
   * @param {string} guide
   * @param {(place: LatLon) => void} done
   */
  askPlace(guide, done) {
    this.stop();
    this.start("place", guide, "place", (place) => {
      this.stop();
      done(/** @type {LatLon} */ (place));
    });
    byId("plan-map").scrollIntoView({ block: "nearest" });
  }

  /**
   * Asks for a way on the map.
   * @param {(way: LatLon[]) => void} done
   */
  askLine(done) {
    this.stop();
    this.start("line", say("guide.line"), "line", (way) => {
      this.stop();
      if (way.length > 1) done(way);
    });
  }

  /**
   * Lets somebody move the corners of an area.
   * @param {LatLon[]} ring
   * @param {(ring: LatLon[]) => void} done
   */
  editArea(ring, done) {
    this.stop();
    this.start("edit", say("guide.edit"), "edit-area", (next) => {
      this.stop();
      done(/** @type {LatLon[]} */ (next));
    }, ring);
  }

  /**
   * @param {Tool} tool
   * @param {string} guide
   * @param {ToolName} name
   * @param {(found: any) => void} done
   * @param {any} [given]
   */
  start(tool, guide, name, done, given) {
    this.tool = tool;
    this.showTool(guide);
    this.map.startTool(name, done, given);
    this.map.canvas.focus({ preventScroll: true });
  }

  stop() {
    this.map.stopTool();
    this.tool = "pick";
    this.showTool("");
  }

  /** @param {string} guide */
  showTool(guide) {
    for (const one of byId("tools").querySelectorAll("button")) {
      one.setAttribute("aria-pressed", String(one.dataset.tool === this.tool));
    }
    byId("guide").hidden = !guide;
    write(byId("guided"), guide);
    const hasCorners = ["area", "line", "edit"].includes(this.tool);
    byId("tool-done").hidden = byId("tool-back").hidden = !hasCorners;
  }

  fit() {
    this.map.fit();
  }

  get over() {
    return new Set([...(this.store.loss?.uncovered ?? this.store.shown?.uncovered ?? [])].map((one) => one.segment));
  }

  showNetwork() {
    const { network, selection } = this.store;
    const over = this.over;
    const locks = this.made.locks();
    if (network) this.map.setFrame(network.frame);
    this.map.setNetwork((network?.segments ?? []).map((one) => ({
      id: one.id, name: one.name, a: one.a, b: one.b, isChosen: selection.has(one.id), colour: locks.get(one.id),
      state: /** @type {SegmentState} */ (one.left_out ? "left-out" : one.unreachable ? "unreachable" : over.has(one.id) ? "left-over" : "open"),
    })));
    byId("legend-locked").hidden = !locks.size;
    byId("legend-out").hidden = !network?.segments.some((one) => one.left_out);
    byId("legend-barred").hidden = !network?.segments.some((one) => one.unreachable && !one.left_out);
    byId("legend-left").hidden = !over.size;
    byId("chart").classList.toggle("planned", this.store.shown !== null);
    if (network) this.loadGround();
    if (network && this.fitted !== network.source) this.map.fit();
    this.fitted = network?.source ?? "";
  }

  showGround() {
    const ground = this.store.ground;
    this.map.setAreas((ground?.areas ?? []).map((one) => ({
      index: one.index, name: one.name ?? "", isLimit: one.kind === "height-limit", rings: one.rings,
    })));
    this.map.setPlaces([
      ...(ground?.depot ? [{ kind: /** @type {const} */ ("depot"), name: this.store.shown ? "" : say("place.depot"), place: ground.depot }] : []),
      ...(ground?.pads ?? []).map((one) => ({ kind: /** @type {const} */ ("pad"), name: one.vehicle, place: one.place, colour: hueOf(this.store.names.indexOf(one.vehicle)) })),
      ...(ground?.bases ?? []).map((one) => ({ kind: /** @type {const} */ ("base"), ...one })),
      ...(ground?.alternates ?? []).map((one) => ({ ...one, kind: /** @type {const} */ ("alternate") })),
    ]);
    this.map.setFootprints(ground?.footprints ?? []);
  }

  showRoutes() {
    const { store } = this;
    const { loss, timeS, vehicle, vehicles } = store;
    this.map.setRoutes(vehicles.map((one, index) => {
      const isLost = loss?.vehicle === one.name;
      const parts = one.routes.map((route) => splitAt(route, isLost ? Math.min(timeS, loss.at_s) : timeS));
      return {
        vehicle: one.name, colour: hueOf(index), isFaint: !loss && vehicle !== null && vehicle !== one.name,
        flown: parts.map(([before]) => before).filter((line) => line.length > 1),
        ahead: isLost ? [] : parts.map(([, ahead]) => ahead).filter((line) => line.length > 1),
      };
    }));
    this.map.setVehicles(vehicles.flatMap((one, index) => {
      const moment = store.momentOf(one);
      if (!moment?.place) return [];
      const isLost = loss?.vehicle === one.name && timeS >= loss.at_s;
      return [{
        name: one.name, place: moment.place, heading_deg: moment.headingDeg, colour: hueOf(index), isFaulty: isLost,
        state: isLost ? "lost" : moment.isFlying ? "flying" : "ground", isChosen: one.name === vehicle,
      }];
    }));
    if (loss || this.wasLost) this.showNetwork();
    this.wasLost = loss !== null;
  }

  /** What is chosen, in a line. */
  describeSelection() {
    const { network, selection } = this.store;
    const chosen = (network?.segments ?? []).filter((one) => selection.has(one.id));
    const lengthM = chosen.reduce((sum, one) => sum + one.length_m, 0);
    const first = chosen.slice(0, 3).map((one) => one.name).join(", ");
    const rest = chosen.length > 3 ? " …" : "";
    return `${count("selected", chosen.length, { length: lengthM >= 1000 ? `${figure(lengthM / 1000, 1)} km` : `${figure(lengthM)} m` })}: ${first}${rest}`;
  }
}
