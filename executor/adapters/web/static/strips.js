// One strip for each vehicle.
import { all, element, find, write } from "./elements.js";
import { label } from "./intents.js";
import { hueOf } from "./map.js";
import { say, translate, translateDocument } from "./translation.js";
import { LEAST_FIX, age, clock, flightTime, gps, known, number, place, since, stateWord, windFrom } from "./words.js";

/** @import { State, Vehicle } from "../documents.js" */

/** @type {Record<string, string[]>} */
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
/** @type {Record<string, string>} */
const KEYS = { hold: "H", resume: "R", return: "B", land: "L", exclude: "X", include: "I", swap: "S", disarm: "D" };
const ALL = ["swap", "include", "hold", "resume", "return", "land", "exclude", "disarm"];
const OF_BASE = ["close", "open", "count"];
// Nobody takes off from a closed base.
const STARTS = ["swap", "include"];
const INTENT_S = 90;
const OLD_S = 3;
const LOSSY = 0.01;
const CALM_M_S = 0.5;
// States in which somebody may have to walk there.
const FOUND = new Set(["lost", "down", "pilot"]);

/** @type {Record<string, string>} */
const PHASES = { takeoff: "takes off", transit: "on the way to {segment}", inspect: "inspects {segment}", return: "on the way home", land: "lands" };

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
  <div class="row links"><span>Links</span><span class="note"></span></div>
  <div class="row at"><span class="when"></span><span class="note"><span class="place"></span> <button class="copy" title="Copy the coordinates">Copy</button> <span class="since"></span> <span class="air">· wind <span class="arrow" aria-hidden="true">↓</span> <span class="wind"></span></span></span></div>
  <p class="told"></p>
  <div class="actions"></div>`;

/**
 * @param {number | null} value
 * @param {number | null} band
 */
const spread = (value, band) => (value === null ? "?" : `${number(value)}±${number(band, 1)} %`);

export class Strips {
  /**
   * @param {HTMLElement} place
   * @param {(vehicle: string) => void} choose
   * @param {(action: string, vehicle: string) => void} ask
   * @param {(action: string, base: string) => void} askBase
   */
  constructor(place, choose, ask, askBase) {
    this.place = place;
    this.choose_ = choose;
    this.ask = ask;
    this.askBase = askBase;
    /** @type {Map<string, HTMLElement>} */
    this.strips = new Map();
    /** @type {string[]} */
    this.names = [];
    this.behindS = 0;
  }

  /** @param {string} name */
  choose(name) {
    for (const [other, strip] of this.strips) strip.classList.toggle("chosen", other === name);
    const strip = this.strips.get(name);
    if (strip) strip.scrollIntoView({ block: "nearest" });
  }

  /**
   * Shows a state that is `behindS` seconds of the flight old.
   * @param {State} state
   */
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

  /**
   * @param {Vehicle} vehicle
   * @param {number} index
   */
  make(vehicle, index) {
    const strip = element("article", "", "strip");
    strip.dataset.vehicle = vehicle.name;
    strip.style.setProperty("--hue", hueOf(index));
    strip.innerHTML = TEMPLATE;
    translateDocument(strip);
    find(strip, "h3").textContent = vehicle.name;
    strip.addEventListener("click", () => this.choose_(vehicle.name));
    strip.addEventListener("focusin", () => this.choose_(vehicle.name));
    const copy = find(strip, ".copy");
    copy.addEventListener("click", () => copied(find(strip, ".place"), copy));
    const actions = find(strip, ".actions");
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
      button.addEventListener("click", () => this.askBase(action, strip.dataset.at ?? ""));
      actions.append(button);
    }
    return strip;
  }

  /**
   * @param {HTMLElement} strip
   * @param {Vehicle} vehicle
   * @param {State} state
   */
  fill(strip, vehicle, state) {
    const part = (/** @type {string} */ selector) => find(strip, selector);
    strip.classList.toggle("fault", vehicle.fault !== null || vehicle.state === "down");
    strip.classList.toggle("stale", vehicle.stale && vehicle.fault === null);
    strip.classList.toggle("taken", vehicle.state === "pilot");
    strip.classList.toggle("found", FOUND.has(vehicle.state));
    strip.dataset.state = vehicle.state;
    const word = part(".state");
    write(word, stateWord(vehicle.state));
    word.className = `state is-${vehicle.state}${vehicle.fault ? " is-fault" : ""}`;
    part(".offered").hidden = !vehicle.offered;
    write(part(".eta"), vehicle.lands_in_s === null ? "" : say("lands in {time}", { time: clock(vehicle.lands_in_s) }));
    const position = vehicle.position;
    const height = position ? `${number(position.relative_alt_m)} m, ${number(position.ground_speed_m_s, 1)} m/s` : say("no position");
    const armed = vehicle.armed && ["ground", "landed", "down"].includes(vehicle.state) ? ` · ${say("ARMED")}` : "";
    write(part(".where"), `${say("layer {number}", { number: vehicle.layer + 1 })} · ${height}${vehicle.mode ? ` · ${vehicle.mode}` : ""}${armed}`);
    write(part(".why"), vehicle.fault ? why(vehicle.fault, vehicle.fault_kind) : vehicle.excluded ? say("excluded by the operator") : "");
    write(part(".hands"), hands(vehicle, state));
    write(part(".turn"), turn(vehicle));
    this.battery(strip, vehicle);
    this.route(strip, vehicle);
    this.link(strip, vehicle);
    this.at(strip, vehicle);
    this.told(part(".told"), vehicle, state);
    const [base, over] = [vehicle.turn?.base ?? "", state.finished || state.flight_s === null];
    strip.dataset.at = base;
    for (const button of all(strip, "[data-base]")) {
      const action = button.dataset.base ?? "";
      const fits = action === "count" ? vehicle.turn?.packs !== null : (action === "open") === vehicle.turn?.base_closed;
      button.hidden = !base || over || !fits;
      write(button, `${label(action)} ${base}`);
    }
    const may = this.may(vehicle, state);
    for (const button of all(strip, "[data-action]")) {
      // What does not fit is not shown, so that the few that do are large and near; the server decides all the same.
      button.hidden = !may.includes(button.dataset.action ?? "");
    }
  }

  /**
   * @param {Vehicle} vehicle
   * @param {State} state
   */
  may(vehicle, state) {
    if (state.finished || state.flight_s === null) return [];
    const may = MAY[vehicle.state] ?? [];
    if (vehicle.taken?.returned) return ["include", ...may];
    const not = [vehicle.excluded || vehicle.fault ? "exclude" : "", ...(vehicle.turn?.base_closed ? STARTS : [])];
    return may.filter((one) => !not.includes(one));
  }

  /**
   * @param {HTMLElement} strip
   * @param {Vehicle} vehicle
   */
  battery(strip, vehicle) {
    const battery = vehicle.battery;
    const gauge = find(strip, ".charge");
    const part = (/** @type {string} */ selector) => find(gauge, selector);
    part(".level").style.width = `${battery.measured_pct ?? 0}%`;
    part(".reserve").style.left = `${battery.reserve_pct}%`;
    const predicted = battery.predicted_pct;
    const known = predicted !== null;
    for (const one of [part(".band"), part(".tick")]) one.hidden = !known;
    if (known) {
      const band = 2 * (battery.predicted_band_pct ?? 0);
      part(".tick").style.left = `calc(${predicted}% - 1px)`;
      part(".band").style.left = `${predicted - band}%`;
      part(".band").style.width = `${2 * band}%`;
    }
    write(find(strip, ".volts"), vehicle.voltage_v === null ? "" : `${number(vehicle.voltage_v, 1)} V`);
    const parts = [`<b>${number(battery.measured_pct)} %</b>`];
    if (known) parts.push(say("plan {spread}", { spread: spread(predicted, battery.predicted_band_pct) }));
    if (battery.landing_pct !== null) {
      parts.push(say("needs {share} %", { share: number(battery.to_finish_pct) }), say("lands with {spread}", { spread: spread(battery.landing_pct, battery.landing_band_pct) }));
    }
    const text = parts.map((one) => `<span>${one}</span>`).join(" · ");
    const place = find(strip, ".figures");
    if (place.innerHTML !== text) place.innerHTML = text;
  }

  /**
   * @param {HTMLElement} strip
   * @param {Vehicle} vehicle
   */
  route(strip, vehicle) {
    const { done, total, segment, segment_name: name, phase, segment_share: share } = vehicle.progress;
    for (const row of all(strip, ".flown")) row.hidden = !total;
    const gauge = find(strip, ".steps");
    const one = 100 / Math.max(1, total);
    find(gauge, ".level").style.width = `${done * one}%`;
    find(gauge, ".part").style.left = `${done * one}%`;
    find(gauge, ".part").style.width = `${(share ?? 0) * one}%`;
    const where = segment === null ? "" : (name ?? say("segment {segment}", { segment }));
    const now = phase === null ? "" : ` · ${say(PHASES[phase], { segment: where })}`;
    const done100 = share ? `, ${number(100 * share)} %` : "";
    write(find(strip, ".route"), say("{done} of {total} flown", { done, total }) + now + done100);
  }

  /**
   * @param {HTMLElement} strip
   * @param {Vehicle} vehicle
   */
  link(strip, vehicle) {
    const part = (/** @type {string} */ selector) => find(strip, selector);
    const heard = ageWord(vehicle.link_age_s, this.behindS);
    // Of one that is silent the share says nothing.
    const lost = vehicle.stale || vehicle.state === "lost" ? 0 : (vehicle.link_loss ?? 0);
    write(part(".link"), lost >= LOSSY ? `${heard} · ${say("{lost} % of frames lost", { lost: number(100 * lost) })}` : heard);
    const links = part(".links");
    links.hidden = vehicle.links.length === 0;
    write(find(links, ".note"), vehicle.links.map((one) => this.one(one)).join(" · "));
    write(part(".gps"), gps(vehicle));
    part(".gps").classList.toggle("poor", vehicle.gps_fix !== null && vehicle.gps_fix < LEAST_FIX);
    part(".if").hidden = !["flying", "holding", "starting"].includes(vehicle.state) || vehicle.fault !== null || vehicle.loss === null;
    this.loss(part(".loss"), vehicle);
  }

  /**
   * One of several links of a vehicle, in words.
   * @param {Vehicle["links"][number]} link
   */
  one(link) {
    const heard = ageWord(link.heard_age_s, this.behindS);
    const lost = link.loss !== null && link.loss >= LOSSY ? say(", {lost} % lost", { lost: number(100 * link.loss) }) : "";
    return `${link.connection} ${heard}${lost}${link.used ? say(", in use") : ""}`;
  }

  /**
   * @param {HTMLElement} strip
   * @param {Vehicle} vehicle
   */
  at(strip, vehicle) {
    const part = (/** @type {string} */ selector) => find(strip, selector);
    const [position, wind] = [vehicle.position, vehicle.wind];
    part(".at").hidden = position === null;
    if (position === null) return;
    const ageS = position.age_s + this.behindS;
    // Where somebody may have to walk, what matters is how old it is and how high it was.
    const last = FOUND.has(vehicle.state) || ageS > OLD_S;
    // Of one without GPS what counts is where it was with a fix: what it reckons since may be far off.
    const fix = position.last_fix;
    write(part(".when"), say(fix ? "Last GPS fix" : last ? "Last at" : "At"));
    write(part(".place"), place(fix ?? position));
    const reckoned = fix ? say("{age} ago, at {speed} m/s; now about {place}, ", { age: age(fix.age_s + this.behindS), speed: number(fix.ground_speed_m_s), place: place(position) }) : "";
    const since = last ? say(", {height} m, {age} ago", { height: number(position.relative_alt_m), age: age(ageS) }) : "";
    write(part(".since"), `${reckoned}${known(position)}${since}`);
    part(".air").hidden = wind === null || last;
    if (wind === null) return;
    part(".arrow").style.transform = `rotate(${wind.from_deg}deg)`;
    const calm = wind.speed_m_s < CALM_M_S;
    part(".arrow").hidden = calm;
    write(part(".wind"), calm ? say("calm") : say("{speed} m/s from {from}", { speed: number(wind.speed_m_s, 1), from: windFrom(wind.from_deg) }));
    part(".air").title = say("Wind from {from}°, as measured by the vehicle", { from: number(wind.from_deg) });
  }

  /**
   * @param {HTMLElement} place
   * @param {Vehicle} vehicle
   */
  loss(place, vehicle) {
    const loss = vehicle.loss;
    const left = loss?.left_over.length ?? 0;
    place.className = `loss ${loss === null ? "" : loss.inside_window ? "in" : "out"}`;
    place.title = loss === null ? "" : loss.uncovered.map((segment) => this.names[segment] ?? say("segment {segment}", { segment })).join(", ");
    if (loss === null) write(place, say("not known"));
    else if (loss.inside_window) write(place, left ? say("✓ others finish all but the {left} left over", { left }) : say("✓ others finish all"));
    else write(place, say(left ? "✗ {count} more than the {left} left over" : "✗ {count} left over", { count: loss.uncovered.length, left }));
  }

  /**
   * @param {HTMLElement} place
   * @param {Vehicle} vehicle
   * @param {State} state
   */
  told(place, vehicle, state) {
    const mine = state.intents.filter((one) => one.vehicle === vehicle.name || (one.vehicle === null && one.action === "abort"));
    const last = mine.at(-1);
    const fresh = last && state.now_s - last.at_s < INTENT_S * Math.max(1, state.speedup ?? 1);
    place.className = `told ${fresh ? last.outcome : ""}`;
    write(place, fresh ? `${label(last.action)}: ${last.outcome === "accepted" ? say("under way") : translate(last.outcome)}, ${translate(last.text || last.question)}` : "");
  }
}

/**
 * @param {string} fault
 * @param {string | null} kind
 */
function why(fault, kind) {
  return kind === null || fault.startsWith(kind) ? translate(fault) : `${translate(kind)}: ${translate(fault)}`;
}

/**
 * @param {number | null} ageS
 * @param {number} behindS
 */
const ageWord = (ageS, behindS) => (ageS === null ? say("never heard") : say("{age} old", { age: age(ageS + behindS) }));

/**
 * What holds of a vehicle in other hands.
 * @param {Vehicle} vehicle
 * @param {State} state
 */
function hands(vehicle, state) {
  const taken = vehicle.taken;
  if (taken === null) return "";
  const began = since(flightTime(state, taken.since_s));
  const opening = began ? say("Hands off since {time}.", { time: began }) : say("Hands off.");
  if (taken.returned) return say("Its pilot has put it back on its mission: include it to continue.");
  if (taken.kept_s > 0) return `${opening} ${say("Its segments are kept for it for {time}.", { time: clock(taken.kept_s) })}`;
  return `${opening} ${say("No segments are kept for it.")}`;
}

/**
 * Between two sorties: which pack is in it, and what it waits for.
 * @param {Vehicle} vehicle
 */
function turn(vehicle) {
  if (!vehicle.turn) return "";
  const pack = vehicle.turn.pack ? say("pack {pack}", { pack: vehicle.turn.pack }) : "";
  return [say("sortie {number}", { number: vehicle.turn.sortie }), pack, translate(vehicle.turn.text)].filter(Boolean).join(" · ");
}

/**
 * @param {HTMLElement} place
 * @param {HTMLElement} button
 */
async function copied(place, button) {
  getSelection()?.selectAllChildren(place);
  try {
    // Not there without TLS on another computer's page: what is marked can be copied by hand.
    await navigator.clipboard.writeText(place.textContent ?? "");
    write(button, say("Copied"));
  } catch {
    const isCopied = document.execCommand("copy");
    write(button, say(isCopied ? "Copied" : "Marked"));
  }
  setTimeout(() => write(button, say("Copy")), 2000);
}
