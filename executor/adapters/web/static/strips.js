// One strip for each vehicle.
import { label } from "./intents.js";
import { hueOf } from "./map.js";
import { LEAST_FIX, age, clock, element, flightTime, gps, known, number, place, since, stateWord, windFrom, write } from "./words.js";

const MAY = {
  flying: ["hold", "return", "land", "exclude"],
  holding: ["resume", "return", "land", "exclude"],
  starting: ["return", "exclude"],
  pilot: ["return", "land", "exclude"],
  returning: ["land"],
  landing: [],
  landed: ["swap", "include", "exclude"],
  ground: ["swap", "include", "exclude"],
  down: ["disarm"],
  lost: [],
};
const KEYS = { hold: "H", resume: "R", return: "B", land: "L", exclude: "X", include: "I", swap: "S", disarm: "D" };
const ALL = ["swap", "include", "hold", "resume", "return", "land", "exclude", "disarm"];
const OF_BASE = ["close", "open"];
// Nobody takes off from a closed base.
const STARTS = ["swap", "include"];
const INTENT_S = 90;
const OLD_S = 3;
const LOSSY = 0.01;
const CALM_M_S = 0.5;
// States in which somebody may have to walk there.
const FOUND = new Set(["lost", "down", "pilot"]);

const TEMPLATE = `
  <div class="top"><h3></h3><span class="state"></span><span class="offered">can take off</span><span class="eta"></span></div>
  <p class="where"></p>
  <p class="why"></p>
  <p class="hands"></p>
  <p class="turn"></p>
  <div class="row"><span>Battery</span><div class="gauge charge"><i class="level"></i><i class="band"></i><i class="tick"></i><i class="reserve"></i></div></div>
  <div class="row"><span class="volts"></span><span class="note figures"></span></div>
  <div class="row flown"><span>Route</span><div class="gauge steps"><i class="level"></i><i class="part"></i></div></div>
  <div class="row flown"><span></span><span class="note route"></span></div>
  <div class="row"><span>Link</span><span class="note"><span class="link"></span> · <span class="gps"></span><span class="if"> · <span class="quiet">lost now:</span> <span class="loss"></span></span></span></div>
  <div class="row at"><span class="when"></span><span class="note"><span class="place"></span> <button class="copy" title="Copy the coordinates">Copy</button> <span class="since"></span><span class="air">wind <span class="arrow" aria-hidden="true">↓</span> <span class="wind"></span></span></span></div>
  <p class="told"></p>
  <div class="actions"></div>`;

const spread = (value, band) => (value === null ? "?" : `${number(value)}±${number(band, 1)} %`);

export class Strips {
  constructor(place, choose, ask, askBase) {
    this.place = place;
    this.choose_ = choose;
    this.ask = ask;
    this.askBase = askBase;
    this.strips = new Map();
    this.names = [];
    this.behindS = 0;
  }

  choose(name) {
    for (const [other, strip] of this.strips) strip.classList.toggle("chosen", other === name);
    const strip = this.strips.get(name);
    if (strip) strip.scrollIntoView({ block: "nearest" });
  }

  // Shows a state that is `behindS` seconds of the flight old.
  show(state, behindS = 0) {
    this.behindS = behindS;
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
    const strip = element("article", "", "strip");
    strip.dataset.vehicle = vehicle.name;
    strip.style.setProperty("--hue", hueOf(index));
    strip.innerHTML = TEMPLATE;
    strip.querySelector("h3").textContent = vehicle.name;
    strip.addEventListener("click", () => this.choose_(vehicle.name));
    strip.addEventListener("focusin", () => this.choose_(vehicle.name));
    const copy = strip.querySelector(".copy");
    copy.addEventListener("click", () => copied(strip.querySelector(".place"), copy));
    const actions = strip.querySelector(".actions");
    for (const action of ALL) {
      const button = element("button");
      button.dataset.action = action;
      button.append(label(action), " ", element("kbd", KEYS[action]));
      button.classList.toggle("danger", ["exclude", "land", "disarm"].includes(action));
      button.addEventListener("click", () => this.ask(action, vehicle.name));
      actions.append(button);
    }
    for (const action of OF_BASE) {
      const button = element("button", label(action));
      button.dataset.base = action;
      button.hidden = true;
      button.addEventListener("click", () => this.askBase(action, strip.dataset.at));
      actions.append(button);
    }
    return strip;
  }

  fill(strip, vehicle, state) {
    const find = (selector) => strip.querySelector(selector);
    strip.classList.toggle("fault", vehicle.fault !== null || vehicle.state === "down");
    strip.classList.toggle("stale", vehicle.stale && vehicle.fault === null);
    strip.classList.toggle("taken", vehicle.state === "pilot");
    strip.classList.toggle("found", FOUND.has(vehicle.state));
    strip.dataset.state = vehicle.state;
    const word = find(".state");
    write(word, stateWord(vehicle.state));
    word.className = `state is-${vehicle.state}${vehicle.fault ? " is-fault" : ""}`;
    find(".offered").hidden = !vehicle.offered;
    write(find(".eta"), vehicle.lands_in_s === null ? "" : `lands in ${clock(vehicle.lands_in_s)}`);
    const position = vehicle.position;
    const height = position ? `${number(position.relative_alt_m)} m, ${number(position.ground_speed_m_s, 1)} m/s` : "no position";
    const armed = vehicle.armed && ["ground", "landed", "down"].includes(vehicle.state) ? " · ARMED" : "";
    write(find(".where"), `layer ${vehicle.layer + 1} · ${height}${vehicle.mode ? ` · ${vehicle.mode}` : ""}${armed}`);
    write(find(".why"), vehicle.fault ? why(vehicle) : vehicle.excluded ? "excluded by the operator" : "");
    write(find(".hands"), hands(vehicle, state));
    write(find(".turn"), turn(vehicle));
    this.battery(strip, vehicle);
    this.route(strip, vehicle);
    this.link(strip, vehicle);
    this.at(strip, vehicle);
    this.told(find(".told"), vehicle, state);
    const [base, over] = [vehicle.turn?.base ?? "", state.finished || state.flight_s === null];
    strip.dataset.at = base;
    for (const button of strip.querySelectorAll("[data-base]")) {
      button.hidden = !base || over || (button.dataset.base === "open") !== vehicle.turn.base_closed;
      write(button, `${label(button.dataset.base)} ${base}`);
    }
    const may = this.may(vehicle, state);
    for (const button of strip.querySelectorAll("[data-action]")) {
      // What does not fit is not shown, so that the few that do are large and near; the server decides all the same.
      button.hidden = !may.includes(button.dataset.action);
    }
  }

  may(vehicle, state) {
    if (state.finished || state.flight_s === null) return [];
    const may = MAY[vehicle.state] ?? [];
    if (vehicle.taken?.returned) return ["include", ...may];
    const not = [vehicle.excluded || vehicle.fault ? "exclude" : "", ...(vehicle.turn?.base_closed ? STARTS : [])];
    return may.filter((one) => !not.includes(one));
  }

  battery(strip, vehicle) {
    const battery = vehicle.battery;
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
    write(strip.querySelector(".volts"), vehicle.voltage_v === null ? "" : `${number(vehicle.voltage_v, 1)} V`);
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
    const { done, total, segment, segment_name: name, phase, segment_share: share } = vehicle.progress;
    for (const row of strip.querySelectorAll(".flown")) row.hidden = !total;
    const gauge = strip.querySelector(".steps");
    const one = 100 / Math.max(1, total);
    gauge.querySelector(".level").style.width = `${done * one}%`;
    gauge.querySelector(".part").style.left = `${done * one}%`;
    gauge.querySelector(".part").style.width = `${(share ?? 0) * one}%`;
    const words = { takeoff: "takes off", transit: "on the way to", inspect: "inspects", return: "on the way home", land: "lands" };
    const now = phase === null ? "" : ` · ${words[phase]}${segment === null ? "" : ` ${name ?? `segment ${segment}`}`}`;
    const done100 = share ? `, ${number(100 * share)} %` : "";
    write(strip.querySelector(".route"), `${done} of ${total} flown${now}${done100}`);
  }

  link(strip, vehicle) {
    const find = (selector) => strip.querySelector(selector);
    const heard = vehicle.link_age_s === null ? "never heard" : `${age(vehicle.link_age_s + this.behindS)} old`;
    // Of one that is silent the share says nothing.
    const lossy = vehicle.link_loss !== null && vehicle.link_loss >= LOSSY && !vehicle.stale && vehicle.state !== "lost";
    write(find(".link"), lossy ? `${heard} · ${number(100 * vehicle.link_loss)} % of frames lost` : heard);
    write(find(".gps"), gps(vehicle));
    find(".gps").classList.toggle("poor", vehicle.gps_fix !== null && vehicle.gps_fix < LEAST_FIX);
    find(".if").hidden = !["flying", "holding", "starting"].includes(vehicle.state) || vehicle.fault !== null || vehicle.loss === null;
    this.loss(find(".loss"), vehicle);
  }

  at(strip, vehicle) {
    const find = (selector) => strip.querySelector(selector);
    const [position, wind] = [vehicle.position, vehicle.wind];
    find(".at").hidden = position === null;
    if (position === null) return;
    const ageS = position.age_s + this.behindS;
    // Where somebody may have to walk, what matters is how old it is and how high it was.
    const last = FOUND.has(vehicle.state) || ageS > OLD_S;
    // Of one without GPS what counts is where it was with a fix: what it reckons since may be far off.
    const fix = position.last_fix;
    write(find(".when"), fix ? "Last GPS fix" : last ? "Last at" : "At");
    write(find(".place"), place(fix ?? position));
    const reckoned = fix ? `${age(fix.age_s + this.behindS)} ago, at ${number(fix.ground_speed_m_s)} m/s; now about ${place(position)}, ` : "";
    const since = last ? `, ${number(position.relative_alt_m)} m, ${age(ageS)} ago` : "";
    write(find(".since"), `${reckoned}${known(position)}${since}`);
    find(".air").hidden = wind === null || last;
    if (wind === null) return;
    find(".arrow").style.transform = `rotate(${wind.from_deg}deg)`;
    const calm = wind.speed_m_s < CALM_M_S;
    find(".arrow").hidden = calm;
    write(find(".wind"), calm ? "calm" : `${number(wind.speed_m_s, 1)} m/s from ${windFrom(wind.from_deg)}`);
    find(".air").title = `Wind from ${number(wind.from_deg)}°, as it measures it`;
  }

  loss(place, vehicle) {
    const loss = vehicle.loss;
    const left = loss?.left_over?.length ?? 0;
    place.className = `loss ${loss === null ? "" : loss.inside_window ? "in" : "out"}`;
    place.title = loss === null ? "" : loss.uncovered.map((segment) => this.names[segment] ?? `segment ${segment}`).join(", ");
    if (loss === null) write(place, "not known");
    else if (loss.inside_window) write(place, left ? `✓ others finish all but the ${left} left over` : "✓ others finish all");
    else write(place, `✗ ${loss.uncovered.length}${left ? ` more than the ${left}` : ""} left over`);
  }

  told(place, vehicle, state) {
    const mine = state.intents.filter((one) => one.vehicle === vehicle.name || (one.vehicle === null && one.action === "abort"));
    const last = mine.at(-1);
    const fresh = last && state.now_s - last.at_s < INTENT_S * Math.max(1, state.speedup ?? 1);
    place.className = `told ${fresh ? last.outcome : ""}`;
    write(place, fresh ? `${label(last.action)}: ${last.outcome === "accepted" ? "under way" : last.outcome}, ${last.text || last.question}` : "");
  }
}

function why(vehicle) {
  return vehicle.fault.startsWith(vehicle.fault_kind) ? vehicle.fault : `${vehicle.fault_kind}: ${vehicle.fault}`;
}

// What holds of a vehicle in other hands.
function hands(vehicle, state) {
  const taken = vehicle.taken;
  if (taken === null) return "";
  const began = since(flightTime(state, taken.since_s));
  const opening = began ? `Hands off since ${began}. ` : "Hands off. ";
  if (taken.returned) return "Its pilot has put it back on its mission: include it to go on.";
  if (taken.kept_s > 0) return `${opening}Its segments are kept for it for ${clock(taken.kept_s)}.`;
  return `${opening}Nothing is kept for it.`;
}

// Between two sorties: which pack is in it, and what it waits for.
function turn(vehicle) {
  if (!vehicle.turn) return "";
  const pack = vehicle.turn.pack ? `pack ${vehicle.turn.pack}` : "";
  return [`sortie ${vehicle.turn.sortie}`, pack, vehicle.turn.text].filter(Boolean).join(" · ");
}

async function copied(place, button) {
  getSelection().selectAllChildren(place);
  try {
    // Not there without TLS on another computer's page: what is marked can be copied by hand.
    await navigator.clipboard.writeText(place.textContent);
    write(button, "Copied");
  } catch {
    write(button, document.execCommand("copy") ? "Copied" : "Marked");
  }
  setTimeout(() => write(button, "Copy"), 2000);
}
