// The map: a canvas in local metres, north up.
import { style } from "./elements.js";
import { Ground } from "./ground.js";

/** @import { PageArea, PageChart, PageVehicle, Place, State, Vehicle } from "../documents.js" */

/**
 * Where a name was written, in pixels: left, top, width.
 * @typedef {[number, number, number]} Taken
 */
/** @typedef {{ colour: string, width: number, dash?: number[], alpha?: number }} Stroke */

const HUES = ["#0072b2", "#d55e00", "#7a3e9d", "#b8860b", "#c2569a", "#1b9aaa", "#8b4513", "#5a6b00"];
const PAD_PX = 46;
// A shorter line is not seen between others.
const LEAST_PX = 12;
/** @type {Record<string, string>} */
const STATES = { pilot: ": with its pilot", down: ": keep away", lost: ": lost" };
const OUT = new Set(["flying", "holding", "starting", "returning", "landing", "pilot"]);

/** @param {number} index */
export const hueOf = (index) => HUES[index % HUES.length];

export class Chart {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {(name: string) => void} choose
   * @param {(place: Place | null) => void} pointed
   * @param {(segment: number | null) => void} touched
   */
  constructor(canvas, choose, pointed, touched) {
    const context = canvas.getContext("2d");
    if (!context) throw new TypeError("expected a canvas that can be drawn on");
    this.canvas = canvas;
    this.pointed = pointed;
    this.touched = touched;
    this.ground = new Ground(() => this.later());
    this.context = context;
    this.width = 0;
    this.height = 0;
    this.choose_ = choose;
    /** @type {PageChart | null} */
    this.chart = null;
    /** @type {State | null} */
    this.state = null;
    /** @type {string | null} */
    this.chosen = null;
    /**
     * The segment whose name is shown, as somebody touched it.
     * @type {number | null}
     */
    this.named = null;
    /** @type {Map<string, Place[]>} */
    this.tracks = new Map();
    this.scale = 1;
    /** @type {Place} */
    this.middle = [0, 0];
    this.fitted = true;
    this.due = false;
    /** @type {Map<number, Place>} */
    this.pointers = new Map();
    /**
     * The pixel that a mouse rests on: the map moves under it.
     * @type {Place | null}
     */
    this.rests = null;
    /** @type {Place | null} */
    this.pressed = null;
    new ResizeObserver(() => this.resize()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.later());
    this.listen();
    this.resize();
  }

  /** @param {PageChart} chart */
  load(chart) {
    const first = this.chart === null;
    this.chart = chart;
    for (const vehicle of chart.vehicles) {
      const known = this.tracks.get(vehicle.name);
      if (!known || known.length < vehicle.track_m.length) this.tracks.set(vehicle.name, vehicle.track_m);
    }
    if (first) this.fit();
    this.later();
  }

  /** @param {State} state */
  show(state) {
    this.state = state;
    for (const vehicle of state.vehicles) {
      if (!vehicle.place_m || !vehicle.armed) continue;
      const track = this.tracks.get(vehicle.name) ?? [];
      const last = track.at(-1);
      if (!last || Math.hypot(last[0] - vehicle.place_m[0], last[1] - vehicle.place_m[1]) > 3) track.push(vehicle.place_m);
      this.tracks.set(vehicle.name, track);
    }
    this.later();
  }

  /** @param {string | null} name */
  choose(name) {
    this.chosen = name;
    this.later();
  }

  fit() {
    if (!this.chart) return;
    const places = [...this.chart.segments_m.flat(), ...this.chart.vehicles.map((one) => one.pad_m)];
    const [easts, norths] = [places.map((place) => place[0]), places.map((place) => place[1])];
    const [west, east, south, north] = [Math.min(...easts), Math.max(...easts), Math.min(...norths), Math.max(...norths)];
    this.middle = [(west + east) / 2, (south + north) / 2];
    const [width, height] = [this.width - 2 * PAD_PX, this.height - 2 * PAD_PX];
    this.scale = Math.min(width / Math.max(east - west, 20), height / Math.max(north - south, 20));
    this.fitted = true;
    this.later();
  }

  /**
   * @param {number} factor
   * @param {Place} at
   */
  zoom(factor, at = [this.width / 2, this.height / 2]) {
    const before = this.metres(at);
    this.scale = Math.min(20, Math.max(0.005, this.scale * factor));
    const after = this.metres(at);
    this.middle = [this.middle[0] + before[0] - after[0], this.middle[1] + before[1] - after[1]];
    this.fitted = false;
    this.later();
  }

  /**
   * @param {number} right
   * @param {number} down
   */
  move(right, down) {
    this.middle = [this.middle[0] - right / this.scale, this.middle[1] + down / this.scale];
    this.fitted = false;
    this.later();
  }

  /**
   * @param {Place} place
   * @returns {Place}
   */
  pixels([east, north]) {
    return [this.width / 2 + (east - this.middle[0]) * this.scale, this.height / 2 - (north - this.middle[1]) * this.scale];
  }

  /**
   * @param {Place} pixel
   * @returns {Place}
   */
  metres([x, y]) {
    return [this.middle[0] + (x - this.width / 2) / this.scale, this.middle[1] - (y - this.height / 2) / this.scale];
  }

  resize() {
    const ratio = devicePixelRatio || 1;
    this.width = this.canvas.clientWidth;
    this.height = this.canvas.clientHeight;
    this.canvas.width = this.width * ratio;
    this.canvas.height = this.height * ratio;
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    if (this.fitted) this.fit();
    this.later();
  }

  later() {
    if (this.due) return;
    this.due = true;
    requestAnimationFrame(() => {
      this.due = false;
      this.draw();
      if (this.rests) this.pointed(this.metres(this.rests));
    });
  }

  listen() {
    const at = (/** @type {MouseEvent} */ event) => /** @type {Place} */ ([event.offsetX, event.offsetY]);
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY / 400), at(event));
    }, { passive: false });
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      this.pointers.set(event.pointerId, at(event));
      this.pressed = at(event);
      this.rests = event.pointerType === "mouse" ? this.pressed : null;
      this.pointed(this.metres(this.pressed));
    });
    this.canvas.addEventListener("pointerleave", (event) => {
      // A finger that was lifted has still asked for a place.
      if (event.pointerType !== "mouse") return;
      this.rests = null;
      this.pointed(null);
    });
    this.canvas.addEventListener("pointermove", (event) => {
      this.rests = event.pointerType === "mouse" ? at(event) : null;
      this.pointed(this.metres(at(event)));
      const before = this.pointers.get(event.pointerId);
      if (!before) return;
      const now = at(event);
      const other = [...this.pointers].find(([id]) => id !== event.pointerId)?.[1];
      if (other) {
        const apart = (/** @type {Place} */ one) => Math.max(10, Math.hypot(one[0] - other[0], one[1] - other[1]));
        this.zoom(apart(now) / apart(before), [(now[0] + other[0]) / 2, (now[1] + other[1]) / 2]);
      } else {
        this.move(now[0] - before[0], now[1] - before[1]);
      }
      this.pointers.set(event.pointerId, now);
    });
    const end = (/** @type {PointerEvent} */ event) => {
      const now = at(event);
      if (this.pressed && Math.hypot(now[0] - this.pressed[0], now[1] - this.pressed[1]) < 6) this.pick(now);
      this.pointers.delete(event.pointerId);
      this.pressed = null;
    };
    this.canvas.addEventListener("pointerup", end);
    this.canvas.addEventListener("pointercancel", (event) => {
      this.pointers.delete(event.pointerId);
    });
  }

  /** @param {Place} pixel */
  pick([x, y]) {
    this.named = null;
    this.later();
    for (const vehicle of this.state?.vehicles ?? []) {
      if (!vehicle.place_m) continue;
      const [px, py] = this.pixels(vehicle.place_m);
      if (Math.hypot(px - x, py - y) < 24) {
        this.choose_(vehicle.name);
        return;
      }
    }
    this.name(this.segmentAt([x, y]));
    this.touched(this.named);
  }

  /** @param {number | null} segment */
  name(segment) {
    this.named = segment;
    this.canvas.title = segment === null ? "" : (this.chart?.names[segment] ?? "");
    this.later();
  }

  /**
   * Shows where a segment is, with its name; nothing moves where it is seen already.
   * @param {number | null} segment
   */
  pointTo(segment) {
    this.name(segment);
    const ends = segment === null ? null : this.chart?.segments_m[segment];
    if (!ends) return;
    const pixels = ends.map((end) => this.pixels(end));
    const inside = pixels.every(([x, y]) => x > PAD_PX && y > PAD_PX && x < this.width - PAD_PX && y < this.height - PAD_PX);
    const long = Math.hypot(pixels[0][0] - pixels[1][0], pixels[0][1] - pixels[1][1]);
    if (inside && long >= LEAST_PX) return;
    this.middle = [(ends[0][0] + ends[1][0]) / 2, (ends[0][1] + ends[1][1]) / 2];
    if (long < LEAST_PX) this.scale = Math.min(20, (this.scale * 4 * LEAST_PX) / Math.max(1, long));
    const most = Math.min(this.width, this.height) - 2 * PAD_PX;
    if (long > most) this.scale *= most / long;
    this.fitted = false;
  }

  /**
   * The segment nearest to a pixel; null where none is near.
   * @param {Place} pixel
   * @returns {number | null}
   */
  segmentAt([x, y]) {
    /** @type {number | null} */
    let found = null;
    let least = 14;
    (this.chart?.segments_m ?? []).forEach((ends, segment) => {
      const [[ax, ay], [bx, by]] = ends.map((end) => this.pixels(end));
      const length = Math.max(1, (bx - ax) ** 2 + (by - ay) ** 2);
      const share = Math.min(1, Math.max(0, ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length));
      const away = Math.hypot(x - ax - share * (bx - ax), y - ay - share * (by - ay));
      if (away < least) [found, least] = [segment, away];
    });
    return found;
  }

  /**
   * @param {Place[]} places
   * @param {Stroke} stroke
   */
  line(places, { colour, width, dash = [], alpha = 1 }) {
    if (places.length < 2) return;
    const context = this.context;
    context.save();
    context.globalAlpha = alpha;
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.lineJoin = context.lineCap = "round";
    if (dash.length) context.lineCap = "butt";
    context.setLineDash(dash);
    context.beginPath();
    this.trace(places);
    if (this.ground.layer !== "plain" && alpha > 0.4) this.edge(width, HUES.includes(colour));
    context.stroke();
    context.restore();
  }

  /**
   * Makes places the canvas's path.
   * @param {Place[]} places
   */
  trace(places) {
    places.forEach((place, index) => {
      this.context[index ? "lineTo" : "moveTo"](...this.pixels(place));
    });
  }

  /**
   * An edge about the line that is about to be drawn: over the colours of the ground it needs one.
   * @param {number} width
   * @param {boolean} bright
   */
  edge(width, bright) {
    const context = this.context;
    context.save();
    context.setLineDash([]);
    context.globalAlpha *= 0.65;
    context.strokeStyle = style(bright ? "--edge" : "--map");
    context.lineWidth = width + 2.5;
    context.stroke();
    context.restore();
  }

  draw() {
    this.context.clearRect(0, 0, this.width, this.height);
    const chart = this.chart;
    if (!chart) return;
    this.ground.draw(this);
    for (const area of chart.areas) this.drawArea(area);
    this.drawNetwork(chart);
    const vehicles = this.state?.vehicles ?? [];
    for (const [index, one] of chart.vehicles.entries()) this.drawWays(one, vehicles[index], index);
    for (const [index, one] of chart.vehicles.entries()) this.drawPad(one, index);
    // No name is written over a vehicle, nor over another name.
    const places = vehicles.flatMap((one) => (one.place_m ? [this.pixels(one.place_m)] : []));
    const taken = places.map(([x, y]) => /** @type {Taken} */ ([x - 13, y - 9, 26]));
    for (const [index, one] of vehicles.entries()) this.drawVehicle(one, index);
    for (const vehicle of vehicles) this.label(vehicle, taken);
    this.drawName(chart, taken);
    this.drawRuler();
  }

  /**
   * What flights keep out of; with a height limit, what they keep low in.
   * @param {PageArea} area
   */
  drawArea(area) {
    const context = this.context;
    for (const outline of area.outlines_m) {
      context.save();
      context.beginPath();
      this.trace(outline);
      context.closePath();
      context.globalAlpha = area.limit ? 0.06 : 0.16;
      context.fillStyle = style("--bad");
      context.fill();
      context.globalAlpha = 0.7;
      context.setLineDash(area.limit ? [6, 5] : []);
      context.lineWidth = 1.5;
      context.strokeStyle = style("--bad");
      context.stroke();
      context.restore();
    }
    const places = area.outlines_m.flat();
    const mean = (/** @type {0 | 1} */ axis) => places.reduce((sum, place) => sum + place[axis], 0) / places.length;
    const [x, y] = this.pixels([mean(0), mean(1)]);
    context.font = "600 12px system-ui, sans-serif";
    context.fillStyle = style("--bad");
    context.fillText(area.name, x - context.measureText(area.name).width / 2, y);
  }

  /** @param {PageChart} chart */
  drawNetwork(chart) {
    const inspected = new Set(this.state?.inspected ?? []);
    const left = new Set(this.state?.uncovered ?? []);
    const inferred = new Set(this.state?.inferred ?? []);
    const missed = new Set(this.state?.missed ?? []);
    /** @type {Map<number | null, number>} */
    const current = new Map((this.state?.vehicles ?? []).map((one, index) => [one.progress.segment, index]));
    chart.segments_m.forEach((ends, segment) => {
      const by = current.get(segment);
      if (by !== undefined) this.line(ends, { colour: hueOf(by), width: 15, alpha: 0.33 });
      if (missed.has(segment)) this.line(ends, { colour: style("--left"), width: 7 });
      else if (inspected.has(segment)) {
        this.line(ends, { colour: style("--done"), width: 7, dash: inferred.has(segment) ? [7, 5] : [] });
      } else if (left.has(segment)) this.line(ends, { colour: style("--left"), width: 5, dash: [4, 4] });
      this.line(ends, { colour: style("--open"), width: 1.8 });
      for (const place of ends) {
        const [x, y] = this.pixels(place);
        this.context.fillStyle = style("--open");
        this.context.fillRect(x - 3, y - 3, 6, 6);
      }
    });
  }

  /**
   * @param {PageVehicle} chart
   * @param {Vehicle | undefined} vehicle
   * @param {number} index
   */
  drawWays(chart, vehicle, index) {
    const chosen = this.chosen === null || this.chosen === chart.name;
    const colour = hueOf(index);
    this.line(this.tracks.get(chart.name) ?? [], { colour, width: chosen ? 3 : 2, alpha: chosen ? 0.9 : 0.45 });
    const flying = vehicle && ["flying", "holding", "starting", "pilot"].includes(vehicle.state);
    if (!chart.route || !vehicle) return;
    if (this.state?.flight_s === null) {
      this.line([chart.pad_m, ...chart.route.places_m], { colour, width: 2, dash: [7, 5], alpha: chosen ? 1 : 0.4 });
    }
    if (!flying || !vehicle.place_m) return;
    this.line([vehicle.place_m, ...chart.route.places_m.slice(vehicle.waypoint)], {
      colour, width: 2, dash: [7, 5], alpha: chosen ? 1 : 0.5,
    });
  }

  /**
   * @param {PageVehicle} chart
   * @param {number} index
   */
  drawPad(chart, index) {
    const [x, y] = this.pixels(chart.pad_m);
    this.context.strokeStyle = hueOf(index);
    this.context.lineWidth = 2;
    this.context.setLineDash([]);
    this.context.strokeRect(x - 5, y - 5, 10, 10);
  }

  /**
   * @param {Vehicle} vehicle
   * @param {number} index
   */
  drawVehicle(vehicle, index) {
    if (!vehicle.place_m) return;
    const context = this.context;
    const [x, y] = this.pixels(vehicle.place_m);
    const size = OUT.has(vehicle.state) ? 13 : 8;
    if (vehicle.loss && !vehicle.loss.inside_window) this.ring(x, y, 21, style("--bad"), [4, 3]);
    if (this.chosen === vehicle.name) this.ring(x, y, 17, style("--ink"), []);
    context.save();
    context.translate(x, y);
    context.rotate(((vehicle.position?.heading_deg ?? 0) * Math.PI) / 180);
    context.beginPath();
    context.moveTo(0, -size);
    context.lineTo(size * 0.72, size * 0.8);
    context.lineTo(0, size * 0.42);
    context.lineTo(-size * 0.72, size * 0.8);
    context.closePath();
    context.fillStyle = vehicle.stale || vehicle.state === "lost" ? style("--map") : hueOf(index);
    context.fill();
    context.lineWidth = 2.2;
    context.strokeStyle = vehicle.stale || vehicle.state === "lost" ? hueOf(index) : style("--map");
    context.stroke();
    context.restore();
    if (vehicle.fault || vehicle.state === "down") this.cross(x, y);
    if (vehicle.state === "down") this.ring(x, y, 30, style("--bad"), [8, 4]);
    if (vehicle.state === "pilot") this.ring(x, y, 24, style("--warn"), [3, 5]);
    if (vehicle.state === "holding") this.pause(x, y);
  }

  /**
   * @param {number} x
   * @param {number} y
   * @param {number} radius
   * @param {string} colour
   * @param {number[]} dash
   */
  ring(x, y, radius, colour, dash) {
    const context = this.context;
    context.setLineDash(dash);
    context.strokeStyle = colour;
    context.lineWidth = 2.5;
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.stroke();
    context.setLineDash([]);
  }

  /**
   * @param {number} x
   * @param {number} y
   */
  cross(x, y) {
    const context = this.context;
    context.strokeStyle = style("--bad");
    context.lineWidth = 3.5;
    context.beginPath();
    for (const [dx, dy] of [[-9, -9], [-9, 9]]) {
      context.moveTo(x + dx, y + dy);
      context.lineTo(x - dx, y - dy);
    }
    context.stroke();
  }

  /**
   * @param {number} x
   * @param {number} y
   */
  pause(x, y) {
    this.context.fillStyle = style("--ink");
    for (const dx of [-20, -13]) this.context.fillRect(x + dx - 3, y - 20, 4, 12);
  }

  /**
   * @param {Vehicle} vehicle
   * @param {Taken[]} taken
   */
  label(vehicle, taken) {
    const told = OUT.has(vehicle.state) || vehicle.fault || vehicle.state === "down" || vehicle.offered;
    if (!vehicle.place_m || !told) return;
    const [x, y] = this.pixels(vehicle.place_m);
    const height = vehicle.position ? ` ${vehicle.position.relative_alt_m.toFixed(0)} m` : "";
    this.write(`${vehicle.name}${STATES[vehicle.state] ?? ` L${vehicle.layer + 1}${height}`}`, x, y, taken);
  }

  /**
   * @param {PageChart} chart
   * @param {Taken[]} taken
   */
  drawName(chart, taken) {
    if (this.named === null || !chart.names[this.named]) return;
    const ends = chart.segments_m[this.named];
    this.line(ends, { colour: style("--focus"), width: 5 });
    const [[ax, ay], [bx, by]] = ends.map((end) => this.pixels(end));
    this.write(chart.names[this.named], (ax + bx) / 2, (ay + by) / 2, taken);
  }

  /**
   * @param {string} text
   * @param {number} x
   * @param {number} y
   * @param {Taken[]} taken
   */
  write(text, x, y, taken) {
    const context = this.context;
    context.font = "600 13px system-ui, sans-serif";
    const width = context.measureText(text).width + 8;
    let top = y - 9;
    const left = x + 18 + width > this.width ? x - 18 - width : x + 18;
    while (taken.some((one) => Math.abs(one[1] - top) < 18 && left < one[0] + one[2] && one[0] < left + width)) top += 18;
    taken.push([left, top, width]);
    context.globalAlpha = 0.86;
    context.fillStyle = style("--map");
    context.fillRect(left, top, width, 18);
    context.globalAlpha = 1;
    context.fillStyle = style("--ink");
    context.fillText(text, left + 4, top + 13.5);
  }

  drawRuler() {
    const wanted = 110 / this.scale;
    const power = 10 ** Math.floor(Math.log10(wanted));
    const metres = [5, 2, 1].map((step) => step * power).find((one) => one <= wanted) ?? power;
    const [x, y] = [14, 22];
    const context = this.context;
    const words = metres >= 1000 ? `${metres / 1000} km` : `${metres} m`;
    context.font = "600 12px system-ui, sans-serif";
    if (this.ground.layer !== "plain") {
      context.globalAlpha = 0.8;
      context.fillStyle = style("--map");
      context.fillRect(x - 6, y - 17, metres * this.scale + 48, 24);
      context.globalAlpha = 1;
    }
    context.strokeStyle = context.fillStyle = style("--ink");
    context.lineWidth = 2;
    context.beginPath();
    context.moveTo(x, y - 5);
    context.lineTo(x, y);
    context.lineTo(x + metres * this.scale, y);
    context.lineTo(x + metres * this.scale, y - 5);
    context.stroke();
    context.fillText(words, x + 5, y - 4);
    context.fillText("N ↑", x + metres * this.scale + 12, y);
  }
}
