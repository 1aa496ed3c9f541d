// One strip for each vehicle.
import { label } from "./intents.js";
import { hueOf } from "./map.js";

const MAY = {
  flying: ["hold", "return", "land", "exclude"],
  holding: ["resume", "return", "land", "exclude"],
  starting: ["return", "exclude"],
  returning: ["land"],
  landing: [],
  landed: ["include", "exclude"],
  ground: ["include", "exclude"],
  lost: [],
};
const KEYS = { hold: "H", resume: "R", return: "B", land: "L", exclude: "X", include: "I" };
const ALL = ["hold", "resume", "return", "land", "exclude", "include"];
const INTENT_S = 90;

const TEMPLATE = `
  <div class="top"><h3></h3><span class="state"></span><span class="where"></span></div>
  <p class="why"></p>
  <div class="row"><span>Battery</span><div class="gauge charge"><i class="level"></i><i class="band"></i><i class="tick"></i><i class="reserve"></i></div></div>
  <div class="row"><span></span><span class="note figures"></span></div>
  <div class="row"><span>Route</span><div class="gauge steps"><i class="level"></i><i class="part"></i></div></div>
  <div class="row"><span></span><span class="note route"></span></div>
  <div class="row"><span>Link</span><span class="note"><span class="link"></span><span class="if"> · <span class="quiet">lost now:</span> <span class="loss"></span></span></span></div>
  <p class="told"></p>
  <div class="actions"></div>`;

const number = (value, digits = 0) => (value === null || value === undefined ? "?" : value.toFixed(digits));
const spread = (value, band) => (value === null ? "?" : `${number(value)}±${number(band, 1)} %`);

export class Strips {
  constructor(place, choose, ask) {
    this.place = place;
    this.choose_ = choose;
    this.ask = ask;
    this.strips = new Map();
  }

  choose(name) {
    for (const [other, strip] of this.strips) strip.classList.toggle("chosen", other === name);
    const strip = this.strips.get(name);
    if (strip) strip.scrollIntoView({ block: "nearest" });
  }

  show(state) {
    state.vehicles.forEach((vehicle, index) => {
      let strip = this.strips.get(vehicle.name);
      if (!strip) {
        strip = this.make(vehicle, index);
        this.strips.set(vehicle.name, strip);
        this.place.append(strip);
      }
      this.fill(strip, vehicle, state);
    });
  }

  make(vehicle, index) {
    const strip = document.createElement("article");
    strip.className = "strip";
    strip.dataset.vehicle = vehicle.name;
    strip.style.setProperty("--hue", hueOf(index));
    strip.innerHTML = TEMPLATE;
    strip.querySelector("h3").textContent = vehicle.name;
    strip.addEventListener("click", () => this.choose_(vehicle.name));
    strip.addEventListener("focusin", () => this.choose_(vehicle.name));
    const actions = strip.querySelector(".actions");
    for (const action of ALL) {
      const button = document.createElement("button");
      button.dataset.action = action;
      button.append(label(action), " ", Object.assign(document.createElement("kbd"), { textContent: KEYS[action] }));
      button.classList.toggle("danger", action === "exclude" || action === "land");
      button.addEventListener("click", () => this.ask(action, vehicle.name));
      actions.append(button);
    }
    return strip;
  }

  fill(strip, vehicle, state) {
    const find = (selector) => strip.querySelector(selector);
    strip.classList.toggle("fault", vehicle.fault !== null);
    strip.classList.toggle("stale", vehicle.stale && vehicle.fault === null);
    strip.dataset.state = vehicle.state;
    const word = find(".state");
    word.textContent = vehicle.state;
    word.className = `state is-${vehicle.state}${vehicle.fault ? " is-fault" : ""}`;
    const position = vehicle.position;
    const height = position ? `${number(position.relative_alt_m)} m, ${number(position.ground_speed_m_s, 1)} m/s` : "no position";
    find(".where").textContent = `layer ${vehicle.layer + 1} · ${height}${vehicle.mode ? ` · ${vehicle.mode}` : ""}`;
    const out = vehicle.fault ? `${vehicle.fault_kind}: ${vehicle.fault}` : vehicle.excluded ? "out of the plan by the operator's word" : "";
    find(".why").textContent = out;
    this.battery(strip, vehicle.battery);
    this.route(strip, vehicle);
    const age = vehicle.link_age_s === null ? "never heard" : `${number(vehicle.link_age_s, 1)} s old`;
    find(".link").textContent = vehicle.link_loss === null ? age : `${age} · ${number(100 * vehicle.link_loss)} % lost`;
    find(".if").hidden = !["flying", "holding", "starting"].includes(vehicle.state) || vehicle.fault !== null;
    this.loss(find(".loss"), vehicle);
    this.told(find(".told"), vehicle, state);
    const may = vehicle.excluded || vehicle.fault ? MAY[vehicle.state].filter((one) => one !== "exclude") : MAY[vehicle.state];
    for (const button of strip.querySelectorAll("button")) {
      const offered = may.includes(button.dataset.action) && !state.finished;
      // What does not fit is not shown, so that the few that do are large and near; the server decides all the same.
      button.hidden = !offered;
    }
  }

  battery(strip, battery) {
    const gauge = strip.querySelector(".charge");
    const find = (selector) => gauge.querySelector(selector);
    find(".level").style.width = `${battery.measured_pct ?? 0}%`;
    find(".reserve").style.left = `${battery.reserve_pct}%`;
    const known = battery.predicted_pct !== null;
    for (const part of [find(".band"), find(".tick")]) part.hidden = !known;
    if (known) {
      const band = 2 * battery.predicted_band_pct;
      find(".tick").style.left = `calc(${battery.predicted_pct}% - 1px)`;
      find(".band").style.left = `${battery.predicted_pct - band}%`;
      find(".band").style.width = `${2 * band}%`;
    }
    const parts = [`<b>${number(battery.measured_pct)} %</b>`];
    if (known) parts.push(`plan ${spread(battery.predicted_pct, battery.predicted_band_pct)}`);
    if (battery.landing_pct !== null) {
      parts.push(`needs ${number(battery.to_finish_pct)} %`, `lands with ${spread(battery.landing_pct, battery.landing_band_pct)}`);
    }
    const text = parts.map((part) => `<span>${part}</span>`).join(" · ");
    const place = strip.querySelector(".figures");
    if (place.innerHTML !== text) place.innerHTML = text;
  }

  route(strip, vehicle) {
    const { done, total, segment, phase, segment_share: share } = vehicle.progress;
    const gauge = strip.querySelector(".steps");
    const one = 100 / Math.max(1, total);
    gauge.querySelector(".level").style.width = `${done * one}%`;
    gauge.querySelector(".part").style.left = `${done * one}%`;
    gauge.querySelector(".part").style.width = `${(share ?? 0) * one}%`;
    const words = { takeoff: "takes off", transit: "on the way to", inspect: "inspects", return: "on the way home", land: "lands" };
    const now = phase === null ? "" : ` · ${words[phase]}${segment === null ? "" : ` segment ${segment}`}`;
    const done100 = share ? `, ${number(100 * share)} %` : "";
    strip.querySelector(".route").textContent = total ? `${done} of ${total} segments${now}${done100}` : "no route";
  }

  loss(place, vehicle) {
    const loss = vehicle.loss;
    place.className = `loss ${loss === null ? "" : loss.inside_window ? "in" : "out"}`;
    if (loss === null) place.textContent = "not known";
    else if (loss.inside_window) place.textContent = "✓ others finish all";
    else place.textContent = `✗ ${loss.uncovered.length} left over`;
  }

  told(place, vehicle, state) {
    const mine = state.intents.filter((one) => one.vehicle === vehicle.name || (one.vehicle === null && one.action === "abort"));
    const last = mine.at(-1);
    const fresh = last && state.now_s - last.at_s < INTENT_S * Math.max(1, state.speedup ?? 1);
    place.className = `told ${fresh ? last.outcome : ""}`;
    place.textContent = fresh ? `${label(last.action)}: ${last.outcome === "accepted" ? "under way" : last.outcome}, ${last.text}` : "";
  }
}
