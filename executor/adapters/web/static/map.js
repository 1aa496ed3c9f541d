// The map of planning, flying and reports: a canvas, north up, that shows what it is given and tells what is pointed at.
import { element, write } from "./elements.js";
import { Ground } from "./ground.js";
import { Gestures } from "./map-gestures.js";
import { Painter } from "./map-painter.js";
import { drawStandingStill, drawVehicles } from "./map-content.js";
import { makeTool, nearestLine, snapTo } from "./map-tools.js";
import { isInside, METRES, projectionOf, View } from "./map-view.js";

/** @import { Place } from "../documents.js" */
/** @import { MapArea, MapFootprint, MapPlace, MapRoute, MapSegment, MapVehicle } from "./map-content.js" */
/** @import { ToolName } from "./map-tools.js" */
/** @import { Frame } from "./map-view.js" */

/** @typedef {{ kind: "segment" | "vehicle" | "area" | "place", id: any }} Choice */
/**
 * @typedef {object} Options
 * @property {string} name what screen readers call the map
 * @property {boolean} [isMetres] whether places are east and north of the depot, instead of latitude and longitude
 * @property {boolean} [isOfFlight] whether segments that the flight leaves out may lie beyond the edge
 * @property {boolean} [isOfPast] whether the flight is over: all of it is shown, in a text that the wheel moves until the map is clicked on
 * @property {(choice: Choice | null) => void} [onChoose]
 * @property {(place: Place | null) => void} [onPoint]
 * @property {() => void} [onCancel]
 */

// By Okabe and Ito, and others that keep 3:1 to the white paper and to the dark one.
export const HUES = ["#0072b2", "#d55e00", "#8f55b5", "#b8860b", "#c2569a", "#1b9aaa", "#a3562b", "#5a6b00"];
// How far the picture of what stands still reaches over each edge, in sizes of the map; and how long one is zoomed.
const OVER = 0.25;
const ZOOMED_MS = 150;

/** @param {number} index */
export const hueOf = (index) => HUES[((index % HUES.length) + HUES.length) % HUES.length];

export class FleetMap {
  /**
   * @param {HTMLElement} place
   * @param {Options} options
   */
  constructor(place, options) {
    this.place = place;
    this.options = options;
    this.canvas = element("canvas");
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("role", "application");
    this.canvas.setAttribute("aria-roledescription", "map");
    this.canvas.setAttribute("aria-label", options.name);
    Object.assign(this.canvas.style, { position: "absolute", inset: "0", width: "100%", height: "100%", touchAction: "none", outlineOffset: "-3px" });
    // What is under the crosshair, for screen readers.
    this.told = element("output");
    Object.assign(this.told.style, { position: "absolute", width: "1px", height: "1px", overflow: "hidden", clipPath: "inset(50%)", whiteSpace: "nowrap" });
    place.append(this.canvas, this.told);
    const context = this.canvas.getContext("2d");
    const still = element("canvas").getContext("2d");
    if (!context || !still) throw new TypeError("expected a canvas that can be drawn on");
    this.context = context;
    this.view = new View();
    // What stands still is drawn once, and moved as a picture while the map moves.
    this.still = { context: still, middle: this.view.middle, scale: 0, atMs: 0, isOld: true };
    this.ground = new Ground(() => this.renew(), (one) => this.metres(one));
    this.projection = METRES;
    /** @type {Frame | null} */
    this.frame = null;
    /**
     * What was given last to each setter: it lies elsewhere in another frame.
     * @type {Map<(content: any) => void, any>}
     */
    this.given = new Map();
    this.content = {
      /** @type {(MapSegment & { ends: [Place, Place] })[]} */
      segments: [],
      /** @type {MapArea[]} */
      areas: [],
      /** @type {MapPlace[]} */
      places: [],
      /** @type {{ ring: Place[], colour?: string }[]} */
      footprints: [],
      /** @type {MapRoute[]} */
      routes: [],
      /** @type {MapVehicle[]} */
      vehicles: [],
    };
    /**
     * The segment whose name is shown.
     * @type {number | null}
     */
    this.named = null;
    /** @type {ReturnType<typeof makeTool> | null} */
    this.tool = null;
    this.isDue = false;
    this.sharpening = 0;
    this.gestures = new Gestures(this.canvas, this.makeHearer());
    new ResizeObserver(() => this.resize()).observe(this.canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.renew());
    // Paper is white, and does not wait for the next frame.
    matchMedia("print").addEventListener("change", () => {
      this.renew();
      this.draw();
    });
    this.resize();
  }

  /** @returns {import("./map-gestures.js").Hearer} */
  makeHearer() {
    return {
      metres: (pixel) => this.view.metres(pixel),
      takesWheel: () => !this.options.isOfPast || document.activeElement === this.canvas,
      point: (place, free) => this.point(place, free),
      click: (place, free) => (this.tool ? this.tool.click(place, free) : this.choose(this.hit(place))),
      press: (place) => this.tool?.press(place) ?? false,
      drag: (place, free) => this.tool?.drag(place, free),
      release: (place) => this.tool?.release(place),
      drop: () => this.tool?.drop(),
      removeCorner: () => this.removeCorner(),
      cancel: () => this.options.onCancel?.(),
      move: (right, down) => this.move(right, down),
      zoom: (factor, at) => this.zoom(factor, at),
      fit: () => this.fit(),
      later: () => this.later(),
    };
  }

  /**
   * Says where degrees are counted from; without it that is the first place that is given.
   * @param {Frame} frame
   */
  setFrame(frame) {
    const { frame: known, projection: before } = this;
    if (known?.lat_deg === frame.lat_deg && known.lon_deg === frame.lon_deg) return;
    [this.frame, this.projection] = [frame, projectionOf(frame)];
    if (known === null) return;
    this.view.middle = this.projection.toMetres(before.toDegrees(this.view.middle));
    for (const [set, content] of this.given) set.call(this, content);
  }

  /** @param {Place} place */
  metres(place) {
    if (!this.frame && !this.options.isMetres) this.setFrame({ lat_deg: place[0], lon_deg: place[1] });
    return this.projection.toMetres(place);
  }

  /** @param {Place[]} places */
  allMetres(places) {
    return places.map((place) => this.metres(place));
  }

  /** @param {MapSegment[]} segments */
  setNetwork(segments) {
    this.given.set(this.setNetwork, segments);
    this.content.segments = segments.map((one) => ({ ...one, ends: [this.metres(one.a), this.metres(one.b)] }));
    this.renew(this.view.isFitted);
  }

  /** @param {MapArea[]} areas */
  setAreas(areas) {
    this.given.set(this.setAreas, areas);
    this.content.areas = areas.map((one) => ({ ...one, rings: one.rings.map((ring) => this.allMetres(ring)) }));
    this.renew();
  }

  /** @param {MapPlace[]} places */
  setPlaces(places) {
    this.given.set(this.setPlaces, places);
    this.content.places = places.map((one) => ({ ...one, place: this.metres(one.place) }));
    this.renew(this.view.isFitted);
  }

  /** @param {MapFootprint[]} footprints */
  setFootprints(footprints) {
    this.given.set(this.setFootprints, footprints);
    this.content.footprints = footprints.map((one) => {
      const { ring, colour } = Array.isArray(one) ? { ring: one } : one;
      return { ring: this.allMetres(ring), colour };
    });
    this.renew();
  }

  /** @param {MapRoute[]} routes */
  setRoutes(routes) {
    this.given.set(this.setRoutes, routes);
    const metres = (/** @type {Place[][]} */ lines) => lines.map((line) => this.allMetres(line));
    this.content.routes = routes.map((one) => ({ ...one, flown: metres(one.flown), ahead: metres(one.ahead) }));
    this.renew();
  }

  /** @param {MapVehicle[]} vehicles */
  setVehicles(vehicles) {
    this.given.set(this.setVehicles, vehicles);
    this.content.vehicles = vehicles.map((one) => ({ ...one, place: this.metres(one.place) }));
    this.later();
  }

  fit() {
    const { segments, places, vehicles, routes } = this.content;
    const { isOfFlight, isOfPast } = this.options;
    const asked = isOfFlight ? segments.filter((one) => one.state !== "left-out") : segments;
    const flown = isOfPast ? [...vehicles.map((one) => one.place), ...routes.flatMap((one) => one.flown.flat())] : [];
    this.view.fit([...asked.flatMap((one) => one.ends), ...places.map((one) => one.place), ...flown]);
    this.later();
  }

  /**
   * @param {number} factor
   * @param {Place} [at]
   */
  zoom(factor, at) {
    this.view.zoom(factor, at);
    this.later();
  }

  /**
   * @param {number} right
   * @param {number} down
   */
  move(right, down) {
    this.view.move(right, down);
    this.later();
  }

  /** @param {number | null} id */
  find(id) {
    return id === null ? undefined : this.content.segments.find((one) => one.id === id);
  }

  /**
   * Shows where a segment is, with its name; nothing moves where it is seen already.
   * @param {number | null} id
   */
  showSegment(id) {
    this.name(id);
    const found = this.find(id);
    if (found) this.view.show(found.ends);
  }

  /** @param {number | null} id */
  name(id) {
    this.named = id;
    this.place.title = this.find(id)?.name ?? "";
    this.later();
  }

  /**
   * Begins to draw or to edit; whatever was begun before is dropped.
   * @param {ToolName} name
   * @param {(found: any) => void} done
   * @param {any} [given] of edit-area: the ring; of place: `{snap: true}` where it snaps
   */
  startTool(name, done, given) {
    const degrees = (/** @type {any} */ found) => (typeof found[0] === "number" ? this.projection.toDegrees(found) : found.map(degrees));
    const { view, content } = this;
    this.tool = makeTool(name, {
      scale: () => view.scale,
      snap: (place, except) => snapTo(place, this.listCorners(), view.scale, except),
      chooseSegments: (isMeant) => content.segments.filter(({ ends: [a, b] }) => isMeant([(a[0] + b[0]) / 2, (a[1] + b[1]) / 2])).map((one) => one.id),
    }, (found) => done(name.startsWith("select") ? found : degrees(found)), name === "edit-area" ? this.allMetres(given) : given);
    this.canvas.style.cursor = "crosshair";
    this.later();
  }

  /** Ends what is drawn or edited, and hands it over. */
  finishTool() {
    this.tool?.finish();
    this.later();
  }

  /** Takes back the last corner. */
  removeCorner() {
    this.tool?.removeCorner();
    this.later();
  }

  stopTool() {
    this.tool = null;
    this.canvas.style.cursor = "";
    this.later();
  }

  /** Where corners snap to. */
  *listCorners() {
    for (const one of this.content.segments) yield* one.ends;
    for (const one of this.content.areas) for (const ring of one.rings) yield* ring;
  }

  /**
   * What is at a place.
   * @param {Place} place in metres
   * @returns {Choice | null}
   */
  hit(place) {
    const { vehicles, segments, places, areas } = this.content;
    const away = (/** @type {Place} */ one) => Math.hypot(one[0] - place[0], one[1] - place[1]) * this.view.scale;
    const vehicle = vehicles.find((one) => away(one.place) < 24);
    if (vehicle) return { kind: "vehicle", id: vehicle.name };
    const segment = nearestLine(place, segments, 14 / this.view.scale);
    if (segment) return { kind: "segment", id: segment.id };
    const found = places.find((one) => away(one.place) < 14);
    if (found) return { kind: "place", id: `${found.kind} ${found.name}` };
    const area = areas.find((one) => one.rings.some((ring) => isInside(place, ring)));
    return area ? { kind: "area", id: area.index } : null;
  }

  /** @param {Choice | null} choice */
  choose(choice) {
    this.name(choice?.kind === "segment" ? choice.id : null);
    this.options.onChoose?.(choice);
  }

  /**
   * @param {Place | null} place in metres
   * @param {boolean} [free]
   */
  point(place, free) {
    this.options.onPoint?.(place && this.projection.toDegrees(place));
    if (!this.tool) return;
    this.tool.point(place, free);
    this.later();
  }

  /** Tells screen readers what is under the crosshair. */
  tell() {
    const found = this.hit(this.view.metres(this.gestures.crosshair));
    const area = found?.kind === "area" ? this.content.areas.find((one) => one.index === found.id) : undefined;
    const segment = found?.kind === "segment" ? this.find(found.id) : undefined;
    write(this.told, found ? ((segment ?? area)?.name ?? String(found.id)) : "");
  }

  resize() {
    const { canvas, view } = this;
    const ratio = devicePixelRatio || 1;
    view.width = canvas.clientWidth;
    view.height = canvas.clientHeight;
    canvas.width = Math.round(view.width * ratio);
    canvas.height = Math.round(view.height * ratio);
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.renew(view.isFitted);
  }

  /** Draws again what stands still. */
  renew(isFitting = false) {
    this.still.isOld = true;
    if (isFitting) this.fit();
    this.later();
  }

  later() {
    if (this.isDue) return;
    this.isDue = true;
    requestAnimationFrame(() => {
      this.isDue = false;
      this.draw();
      const { rests, isKeyed } = this.gestures;
      if (rests) this.options.onPoint?.(this.projection.toDegrees(this.view.metres(rests)));
      if (isKeyed) this.tell();
    });
  }

  draw() {
    const { context, view } = this;
    if (!view.width || !view.height) return;
    context.clearRect(0, 0, view.width, view.height);
    this.showStill();
    const painter = new Painter(context, view, this.ground.layer !== "plain");
    drawVehicles(painter, this.content.vehicles);
    const named = this.find(this.named);
    if (named) {
      painter.lines([named.ends], { colour: painter.colours("focus"), width: 5 });
      const [[ax, ay], [bx, by]] = named.ends.map((end) => view.pixels(end));
      painter.write(named.name, [(ax + bx) / 2, (ay + by) / 2]);
    }
    this.tool?.draw(painter);
    if (this.gestures.isKeyed) {
      painter.sign(this.gestures.crosshair, [[-14, 0, -4, 0], [4, 0, 14, 0], [0, -14, 0, -4], [0, 4, 0, 14]], painter.colours("ink"), 2);
    }
    painter.ruler();
    this.place.dataset.ground = this.ground.shown;
  }

  /** Puts the picture of what stands still where it belongs now; makes a new one where that would not do. */
  showStill() {
    const { view, still, context } = this;
    const ratio = devicePixelRatio || 1;
    if (still.isOld || !this.isCovered()) this.drawStill(ratio);
    const zoomed = view.scale / still.scale;
    const { canvas } = still.context;
    const [wide, high] = [(canvas.width / ratio) * zoomed, (canvas.height / ratio) * zoomed];
    let [left, top] = view.pixels(still.middle);
    [left, top] = [left - wide / 2, top - high / 2];
    // Between two pixels it would be blurred.
    if (zoomed === 1) [left, top] = [Math.round(left * ratio) / ratio, Math.round(top * ratio) / ratio];
    context.drawImage(canvas, left, top, wide, high);
    clearTimeout(this.sharpening);
    if (zoomed !== 1) this.sharpening = setTimeout(() => this.later(), ZOOMED_MS);
  }

  /** Whether the picture reaches over the whole map, and is sharp enough. */
  isCovered() {
    const { view, still } = this;
    const zoomed = view.scale / still.scale;
    if (zoomed !== 1 && (zoomed < 0.7 || zoomed > 1.6 || performance.now() - still.atMs > ZOOMED_MS)) return false;
    const over = (/** @type {number} */ size) => (size * ((1 + 2 * OVER) * zoomed - 1)) / 2;
    const [x, y] = view.pixels(still.middle);
    return Math.abs(x - view.width / 2) <= over(view.width) && Math.abs(y - view.height / 2) <= over(view.height);
  }

  /** @param {number} ratio */
  drawStill(ratio) {
    const { still } = this;
    const view = Object.assign(new View(), this.view);
    const { canvas } = still.context;
    [canvas.width, canvas.height] = [view.width, view.height].map((one) => 2 * Math.ceil(((1 + 2 * OVER) * one * ratio) / 2));
    [view.width, view.height] = [canvas.width / ratio, canvas.height / ratio];
    still.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    Object.assign(still, { middle: view.middle, scale: view.scale, atMs: performance.now(), isOld: false });
    const painter = new Painter(still.context, view, this.ground.layer !== "plain");
    this.ground.draw(painter);
    drawStandingStill(painter, this.content);
  }
}
