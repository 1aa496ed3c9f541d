// The flight or the day over time: a row for each vehicle, a slider over all of them, the window below it, and who is
// where at the time that it shows.
import { all, element, write } from "./elements.js";
import { button } from "./plan-forms.js";
import { drawBatteries, drawProfile } from "./plan-charts.js";
import { hueOf } from "./map.js";
import { figure, say } from "./plan-texts.js";

/** @import { DayWindow, PlannedVehicle } from "../plan.js" */
/** @import { Store } from "./plan-store.js" */

const STEPS = 2000;
const LINES = 7;

export class Timeline {
  /**
   * @param {Store} store
   * @param {HTMLElement} place
   * @param {{ lose: () => void }} asked
   */
  constructor(store, place, asked) {
    this.store = store;
    this.place = place;
    this.view = "routes";
    this.narrow = matchMedia("(max-width: 900px)");
    this.narrow.addEventListener("change", () => this.drawScale());
    const head = element("div", "", "head");
    this.time = element("output", "", "clock");
    this.tabs = element("div", "", "actions tabs");
    for (const view of ["routes", "heights", "battery"]) {
      const tab = button(say(`times.${view}`), () => this.turn(view));
      tab.dataset.view = view;
      this.tabs.append(tab);
    }
    this.lost = button("", asked.lose, "danger");
    this.lost.id = "lose";
    // Of a day its plan says beforehand from when on one may be lost.
    this.safe = element("span", "", "safe-from");
    head.append(this.time, this.tabs, this.safe, this.lost);
    this.slider = element("input");
    this.slider.type = "range";
    this.slider.id = "slider";
    this.slider.min = "0";
    this.slider.max = String(STEPS);
    this.slider.setAttribute("aria-label", say("times.slider"));
    this.slider.addEventListener("input", () => {
      const { beginS, endS } = store;
      store.goTo(beginS + (Number(this.slider.value) / STEPS) * (endS - beginS));
    });
    this.grid = element("div", "", "grid");
    this.scale = element("div", "", "scale");
    this.rows = element("div", "", "rows");
    this.band = element("div", "", "band");
    this.charts = element("div", "", "charts");
    const sliding = element("div", "", "sliding");
    sliding.append(element("span"), this.slider, element("span"));
    this.grid.append(this.scale, sliding, this.band, this.rows);
    place.append(head, this.grid, this.charts);
    store.on(["plan", "draft", "loss"], () => this.draw());
    store.on(["vehicle"], () => {
      this.showChosen();
      this.drawCharts();
    });
    store.on(["time"], () => this.showTime());
  }

  /** @param {string} view */
  turn(view) {
    this.view = view;
    this.drawCharts();
  }

  /** @param {number} timeS */
  share(timeS) {
    const { beginS, endS } = this.store;
    return Math.min(1, Math.max(0, (timeS - beginS) / Math.max(1e-9, endS - beginS)));
  }

  /**
   * A piece of a row from one time to another.
   * @param {number} fromS
   * @param {number} toS
   * @param {string} name
   */
  piece(fromS, toS, name) {
    const made = element("i", "", name);
    made.style.left = `${100 * this.share(fromS)}%`;
    made.style.width = `${100 * Math.max(0, this.share(toS) - this.share(fromS))}%`;
    return made;
  }

  draw() {
    const shown = this.store.shown;
    this.place.hidden = !shown;
    if (!shown) return;
    this.drawScale();
    this.drawBand();
    this.rows.replaceChildren(...this.store.vehicles.map((one, index) => this.row(one, index)));
    this.drawCharts();
    this.showChosen();
    this.showTime();
  }

  drawScale() {
    const { beginS, endS } = this.store;
    const steps = [10, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 14400, 28800, 86400];
    // A narrow screen has room for fewer.
    const lines = this.narrow.matches ? LINES / 2 : LINES;
    const step = steps.find((one) => (endS - beginS) / one <= lines) ?? 86400;
    const marks = [];
    for (let at = Math.ceil(beginS / step) * step; at <= endS; at += step) {
      // The last one would stand beyond the edge.
      if (this.share(at) > 1 - 0.6 / lines) break;
      const mark = element("span", this.store.wordOf(at));
      mark.style.left = `${100 * this.share(at)}%`;
      marks.push(mark);
    }
    const track = element("div", "", "track");
    track.append(...marks);
    this.scale.replaceChildren(element("span"), track, element("span"));
  }

  drawBand() {
    const summary = this.store.shown?.summary;
    const fromS = summary?.window_from_s ?? null;
    this.band.hidden = fromS === null;
    if (!summary || fromS === null) return;
    const track = element("div", "", "track");
    const { beginS } = this.store;
    track.append(this.piece(beginS + fromS, beginS + summary.longest_s, "inside"));
    const { breaking } = summary;
    let words = fromS <= 0 ? say("window.always") : say("window.from", { time: this.store.wordOf(beginS + fromS) });
    if (breaking) {
      track.append(this.piece(beginS + breaking.from_s, beginS + breaking.to_s, "breaking"));
      words += ` · ${say("window.breaks", { vehicle: breaking.vehicle, from: this.store.wordOf(beginS + breaking.from_s), to: this.store.wordOf(beginS + breaking.to_s) })}`;
    }
    const label = element("span", words, "said");
    const before = element("span", say("window"), "who");
    this.band.replaceChildren(before, track, element("span"), label);
    this.band.title = words;
  }

  /**
   * @param {PlannedVehicle} vehicle
   * @param {number} index
   */
  row(vehicle, index) {
    const row = element("div", "", "row");
    row.dataset.vehicle = vehicle.name;
    row.style.setProperty("--hue", hueOf(index));
    const who = button(vehicle.name, () => this.store.chooseVehicle(this.store.vehicle === vehicle.name ? null : vehicle.name), "who");
    const track = element("div", "", "track");
    const planned = this.store.shown?.vehicles[index]?.routes.flatMap((route) => route.visits.map((visit) => visit.segment)) ?? [];
    for (const route of vehicle.routes) {
      track.append(this.piece(route.start_s, route.start_s + route.duration_s, "route"));
      for (const visit of route.visits) {
        const piece = this.piece(visit.from_s, visit.to_s, planned.includes(visit.segment) ? "visit" : "visit again");
        piece.title = `${this.store.nameOf(visit.segment)} ${visit.reversed ? "←" : "→"} ${this.store.wordOf(visit.from_s)}`;
        track.append(piece);
      }
    }
    const loss = this.store.loss;
    const safe = this.store.shown?.windows?.find((one) => one.vehicle === vehicle.name);
    if (safe) {
      const piece = this.piece(safe.from_s, this.store.endS, "safe");
      piece.title = this.describeSafe(safe);
      track.append(piece);
    }
    if (loss?.vehicle === vehicle.name) track.append(this.piece(loss.at_s, this.store.endS, "lost"));
    track.append(element("i", "", "now"));
    track.addEventListener("pointerdown", (event) => this.jump(event, track, vehicle.name));
    row.append(who, track, element("span", "", "where"));
    return row;
  }

  /** @param {DayWindow} safe */
  describeSafe({ vehicle, from_s: fromS }) {
    return fromS <= this.store.beginS ? say("window.day-always", { vehicle }) : say("window.day", { vehicle, time: this.store.wordOf(fromS) });
  }

  /**
   * @param {PointerEvent} event
   * @param {HTMLElement} track
   * @param {string} name
   */
  jump(event, track, name) {
    const box = track.getBoundingClientRect();
    const { beginS, endS } = this.store;
    this.store.chooseVehicle(name);
    this.store.goTo(beginS + ((event.clientX - box.left) / Math.max(1, box.width)) * (endS - beginS));
  }

  showChosen() {
    const { vehicle } = this.store;
    for (const row of all(this.rows, ".row")) {
      const isChosen = row.dataset.vehicle === vehicle;
      row.classList.toggle("chosen", isChosen);
      row.querySelector(".who")?.setAttribute("aria-pressed", String(isChosen));
    }
    const safe = this.store.shown?.windows?.find((one) => one.vehicle === vehicle);
    write(this.safe, safe ? this.describeSafe(safe) : "");
    this.lost.disabled = vehicle === null;
    const words = vehicle === null ? say("lose.who") : say("lose.here", { vehicle });
    if (this.lost.dataset.shown !== words) {
      this.lost.dataset.shown = words;
      this.lost.replaceChildren(element("span", words), " ", element("kbd", "X"));
    }
  }

  showTime() {
    const { shown, timeS } = this.store;
    if (!shown) return;
    write(this.time, this.store.wordOf(timeS));
    this.slider.value = String(Math.round(STEPS * this.share(timeS)));
    this.slider.setAttribute("aria-valuetext", this.store.wordOf(timeS));
    const at = `${100 * this.share(timeS)}%`;
    for (const now of all(this.place, ".now")) now.style.left = at;
    const rows = all(this.rows, ".row");
    this.store.vehicles.forEach((one, index) => {
      const place = rows[index]?.querySelector(".where");
      if (place) write(place, this.describe(one));
    });
  }

  /** @param {PlannedVehicle} vehicle */
  describe(vehicle) {
    const { timeS, loss } = this.store;
    const moment = this.store.momentOf(vehicle);
    if (!moment) return say("at.stays");
    if (loss?.vehicle === vehicle.name && timeS >= loss.at_s) return say("at.lost", { time: this.store.wordOf(loss.at_s) });
    const battery = moment.batteryPct === null ? "" : ` · ${figure(moment.batteryPct)} %`;
    const over = timeS >= moment.route.start_s + moment.route.duration_s;
    const what = moment.visit ? say("at.inspects", { name: this.store.nameOf(moment.visit.segment) })
      : moment.isFlying ? say("at.transit", { height: figure(moment.upM) }) : say(over ? "at.landed" : "at.pad");
    return what + battery;
  }

  drawCharts() {
    const { shown, vehicle } = this.store;
    for (const tab of all(this.tabs, "button")) tab.setAttribute("aria-pressed", String(tab.dataset.view === this.view));
    this.charts.hidden = this.view === "routes";
    this.rows.hidden = this.view !== "routes";
    this.place.dataset.view = this.view;
    if (!shown || this.view === "routes") return;
    if (this.view === "battery") {
      this.charts.replaceChildren(this.frame("", drawBatteries(this.store.vehicles, hueOf, [this.store.beginS, this.store.endS], vehicle, say("times.battery"))));
    } else {
      const { vehicles, beginS, endS } = this.store;
      const wanted = vehicles.filter((one) => (vehicle === null || one.name === vehicle) && one.routes.length);
      this.charts.replaceChildren(...wanted.map((one) => {
        const drawn = drawProfile(one, hueOf(vehicles.indexOf(one)), [beginS, endS], say("profile.of", { vehicle: one.name }));
        return this.frame(one.name, drawn);
      }));
    }
    this.showTime();
  }

  /**
   * @param {string} who
   * @param {{ svg: Element, labels: { share: number, text: string }[] }} drawn
   */
  frame(who, { svg, labels }) {
    const frame = element("figure", "", "frame");
    const scale = element("div", "", "heights");
    scale.append(...labels.map(({ share, text }) => {
      const label = element("span", text);
      label.style.top = `${100 * share}%`;
      return label;
    }));
    const track = element("div", "", "track");
    track.append(svg, element("i", "", "now"));
    frame.append(scale, track);
    if (who) frame.append(element("figcaption", who));
    return frame;
  }
}
