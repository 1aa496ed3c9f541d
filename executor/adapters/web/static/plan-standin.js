// A plain map.
import { style } from "./elements.js";

/** @import { LatLon } from "../plan.js" */
/** @typedef {[number, number]} Pixel */

export class FleetMap {
  /** @param {HTMLElement} place @param {any} options */
  constructor(place, options) {
    this.options = options;
    this.canvas = document.createElement("canvas");
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", options.name);
    place.append(this.canvas);
    this.context = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d"));
    /** @type {any} */
    this.content = { network: [], areas: [], places: [], routes: [], vehicles: [] };
    /** @type {any} */
    this.tool = null;
    /** @type {Pixel[]} */
    this.corners = [];
    this.scale = 1;
    /** @type {LatLon} */
    this.middle = [0, 0];
    new ResizeObserver(() => { this.resize(); this.fit(); }).observe(place);
    this.canvas.addEventListener("pointerdown", (event) => this.down([event.offsetX, event.offsetY]));
    this.canvas.addEventListener("pointerup", (event) => this.up([event.offsetX, event.offsetY]));
    this.canvas.addEventListener("dblclick", () => this.end());
    this.canvas.addEventListener("keydown", (event) => { if (event.key === "Enter") this.end(); });
  }
  resize() {
    this.canvas.width = this.canvas.clientWidth;
    this.canvas.height = this.canvas.clientHeight;
  }
  /** @param {string} name @param {any} value */
  set(name, value) { this.content[name] = value; this.draw(); }
  /** @param {any} value */ setNetwork(value) { this.set("network", value); }
  /** @param {any} value */ setAreas(value) { this.set("areas", value); }
  /** @param {any} value */ setPlaces(value) { this.set("places", value); }
  /** @param {any} value */ setRoutes(value) { this.set("routes", value); }
  /** @param {any} value */ setVehicles(value) { this.set("vehicles", value); }
  /** @param {any} value */ setFootprints(value) { this.set("footprints", value); }
  fit() {
    const places = [...this.content.network.flatMap((/** @type {any} */ one) => [one.a, one.b]), ...this.content.places.map((/** @type {any} */ one) => one.place)];
    if (!places.length) return;
    const [lats, lons] = [places.map((one) => one[0]), places.map((one) => one[1])];
    const k = Math.cos((lats[0] * Math.PI) / 180);
    this.middle = [(Math.min(...lats) + Math.max(...lats)) / 2, (Math.min(...lons) + Math.max(...lons)) / 2];
    this.k = k;
    const high = Math.max(1e-4, Math.max(...lats) - Math.min(...lats));
    const wide = Math.max(1e-4, (Math.max(...lons) - Math.min(...lons)) * k);
    this.scale = 0.8 * Math.min(this.canvas.width / wide, this.canvas.height / high);
    this.draw();
  }
  /** @param {LatLon} place @returns {Pixel} */
  pixels([lat, lon]) {
    return [this.canvas.width / 2 + (lon - this.middle[1]) * (this.k ?? 1) * this.scale, this.canvas.height / 2 - (lat - this.middle[0]) * this.scale];
  }
  /** @param {Pixel} pixel @returns {LatLon} */
  place([x, y]) {
    return [this.middle[0] - (y - this.canvas.height / 2) / this.scale, this.middle[1] + (x - this.canvas.width / 2) / this.scale / (this.k ?? 1)];
  }
  /** @param {LatLon[]} line @param {string} colour @param {number} width @param {number[]} dash */
  line(line, colour, width, dash = []) {
    const c = this.context;
    c.strokeStyle = colour; c.lineWidth = width; c.setLineDash(dash); c.beginPath();
    line.forEach((one, index) => { c[index ? "lineTo" : "moveTo"](...this.pixels(one)); });
    c.stroke(); c.setLineDash([]);
  }
  draw() {
    const c = this.context;
    c.clearRect(0, 0, this.canvas.width, this.canvas.height);
    for (const area of this.content.areas) for (const ring of area.rings) this.line([...ring, ring[0]], style("--bad"), 2);
    for (const one of this.content.network) {
      if (one.isChosen) this.line([one.a, one.b], style("--focus"), 12);
      const colour = one.state === "left-out" ? style("--rule") : one.state === "open" ? style("--open") : style("--bad");
      this.line([one.a, one.b], colour, one.state === "open" ? 2.5 : 2, one.state === "left-out" ? [3, 4] : []);
    }
    for (const route of this.content.routes) {
      c.globalAlpha = route.isFaint ? 0.3 : 1;
      for (const line of route.flown) this.line(line, route.colour, 3);
      for (const line of route.ahead) this.line(line, route.colour, 2, [7, 5]);
      c.globalAlpha = 1;
    }
    c.font = "600 13px system-ui";
    for (const one of [...this.content.places, ...this.content.vehicles]) {
      const [x, y] = this.pixels(one.place);
      c.fillStyle = one.colour ?? style("--ink");
      c.fillRect(x - 5, y - 5, 10, 10);
      c.fillText(one.name, x + 8, y + 4);
    }
    if (this.corners.length) this.line(this.corners.map((one) => this.place(one)), style("--focus"), 2);
  }
  /** @param {string} name @param {any} done @param {any} given */
  startTool(name, done, given) { this.tool = { name, done, given }; this.corners = []; }
  stopTool() { this.tool = null; this.corners = []; this.draw(); }
  /** @param {Pixel} at */
  down(at) { if (this.tool?.name.startsWith("select")) this.corners = [at]; }
  /** @param {Pixel} at */
  up(at) {
    const tool = this.tool;
    if (!tool) {
      const found = this.nearest(at);
      this.options.onChoose(found === null ? null : { kind: "segment", id: found });
    } else if (tool.name === "place") tool.done(this.place(at));
    else if (tool.name === "polygon") { this.corners.push(at); this.draw(); }
    else if (this.corners.length) {
      const [[x0, y0], [x1, y1]] = [this.corners[0], at];
      const inside = (/** @type {LatLon} */ one) => { const [x, y] = this.pixels(one); return (x - x0) * (x - x1) <= 0 && (y - y0) * (y - y1) <= 0; };
      tool.done(this.content.network.filter((/** @type {any} */ one) => inside(one.a) && inside(one.b)).map((/** @type {any} */ one) => one.id));
    }
  }
  finishTool() { this.end(); }
  removeCorner() { this.corners.pop(); this.draw(); }
  /** @param {number} factor */
  zoom(factor) { this.scale *= factor; this.draw(); }
  end() { if (this.tool?.name === "polygon") this.tool.done(this.corners.map((one) => this.place(one))); }
  /** @param {Pixel} at @returns {number | null} */
  nearest([x, y]) {
    let [found, least] = [/** @type {number | null} */ (null), 12];
    for (const one of this.content.network) {
      const [[ax, ay], [bx, by]] = [this.pixels(one.a), this.pixels(one.b)];
      const share = Math.min(1, Math.max(0, ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / Math.max(1, (bx - ax) ** 2 + (by - ay) ** 2)));
      const away = Math.hypot(x - ax - share * (bx - ax), y - ay - share * (by - ay));
      if (away < least) [found, least] = [one.id, away];
    }
    return found;
  }
}
