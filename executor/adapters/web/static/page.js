// The page to fly by: takes the newest state from the server, shows it, and hands the operator's wishes back.
import { Assets } from "./assets.js";
import { Briefing } from "./briefing.js";
import { Chart } from "./chart.js";
import { all, byId, element, write } from "./elements.js";
import { Freshness } from "./freshness.js";
import { Intents } from "./intents.js";
import { MOVES } from "./map-gestures.js";
import { Offers } from "./offers.js";
import { Strips } from "./strips.js";
import { offerLanguages, say, translate, translateDocument, useLanguage, wanted } from "./translation.js";
import { flightTime, since } from "./words.js";

/** @import { PageChart, Place, State } from "../documents.js" */

/** @type {Record<string, string>} */
const MARKS = { info: "·", warning: "▲", fault: "■" };

try {
  await useLanguage(wanted(), ["page", "lines"]);
} catch {
  // A crew needs the page more than its language.
}
translateDocument(document.body);
offerLanguages(byId("language", HTMLSelectElement));
const chart = new Chart(choose, pointed, (segment) => assets.choose(segment));
const { map } = chart;
const intents = new Intents(() => state);
const ask = (/** @type {string} */ action, /** @type {string | null} */ vehicle) => intents.ask(action, vehicle);
const strips = new Strips(byId("vehicles"), choose, ask, (action, base) => intents.askBase(action, base));
const briefing = new Briefing(intents);
const offers = new Offers(ask);
const assets = new Assets((segment) => map.showSegment(segment), intents);
const freshness = new Freshness();
const openedAt = performance.now();
/** @type {State | null} */
let state = null;
/** @type {string | null} */
let chosen = null;
let charted = "";
let charting = false;
let shownLines = "";
/** @type {PageChart["window"]} */
let planned = null;

/** @param {string} name */
function choose(name) {
  chosen = name;
  strips.choose(name);
  chart.choose(name);
}

/** @param {State} next */
function show(next) {
  state = next;
  freshness.shows(next);
  write(byId("clock"), next.flight_s === null ? say("before take-off") : since(next.flight_s));
  write(byId("count"), say("{part} of {total}", { part: next.inspected.length, total: next.segments_total }));
  byId("bar").style.width = `${(100 * next.inspected.length) / Math.max(1, next.segments_total)}%`;
  write(byId("revision"), next.replan
    ? say(next.replan.solving ? "{revision} is solved …" : "{revision} goes on board …", { revision: next.replan.revision })
    : say("revision {revision}", { revision: next.revision }));
  showWindow(next);
  showPlanned(next);
  briefing.show(next);
  offers.show(next);
  showRadios(next);
  strips.show(next);
  chart.show(next);
  assets.show(next);
  showLines(next);
  intents.show(next);
  const idle = next.finished || next.recalled || next.flight_s === null;
  for (const button of all(byId("fleet"), "[data-action]", HTMLButtonElement)) {
    button.disabled = idle || (button.dataset.action === "prove" && !next.inferred.length);
  }
  byId("legend-inferred").hidden = !next.inferred.length;
  byId("legend-missed").hidden = !next.missed.length;
  document.title = `${next.inspected.length}/${next.segments_total} faultline`;
  const stamp = JSON.stringify(next.chart);
  if (stamp !== charted && !charting) loadChart(stamp);
  watch();
}

/** @param {State} next */
function showWindow(next) {
  const judged = next.vehicles.filter((one) => one.loss);
  const outside = judged.filter((one) => !one.loss?.inside_window).map((one) => one.name);
  const place = byId("window");
  // What is left over now stays so in any case.
  const left = next.uncovered.length;
  const also = left ? say("; {left} left over in any case", { left }) : "";
  const good = left ? say("✓ the others finish all but the {left} left over", { left }) : say("✓ the others finish all");
  const bad = say("✗ not {vehicles}", { vehicles: outside.join(", ") }) + also;
  write(place, !judged.length ? say("not known") + also : outside.length ? bad : good);
  place.className = !judged.length ? "" : outside.length || left ? "loss out" : "loss in";
  place.title = outside.length ? say("The others could not absorb the loss of these vehicles") : "";
}

/**
 * From when on the plan itself can do without any one vehicle, and whose loss it cannot make good before.
 * @param {State} next
 */
function showPlanned(next) {
  const place = byId("planned");
  place.hidden = planned === null || next.revision !== 0 || next.finished;
  if (planned === null || place.hidden) return;
  const { earliest_s: earliest, longest_route_s: longest, window_pct: share, then } = planned;
  // A pair that breaks the window says nothing about one loss.
  const breaking = then ? null : planned.breaking;
  const inside = next.flight_s !== null && next.flight_s >= earliest;
  const whom = breaking && !inside ? say(", until then not {vehicle}", { vehicle: breaking.vehicle }) : "";
  const from = { time: since(earliest) };
  write(place, (earliest <= 0 ? say("plan: any one at any time") : inside ? say("plan: any one since {time}", from) : say("plan: any one from {time} on", from)) + whom);
  place.title = say("Re-plan window of the plan: {share} % of its longest route, which ends at {end}", { share: share.toFixed(0), end: since(longest) })
    + (breaking ? say("; {vehicle} lost between {from} and {to} breaks it", { vehicle: breaking.vehicle, from: since(breaking.from_s), to: since(breaking.to_s) }) : "");
}

/**
 * What each telemetry radio carries, and whether it is congested or weak.
 * @param {State} next
 */
function showRadios(next) {
  const place = byId("radios");
  place.hidden = !next.radios.length;
  const shown = next.radios.map((one) => [say("radio of {vehicles}: {state}, {text}; positions at {rate} Hz", {
    vehicles: one.vehicles.join(", "), state: translate(one.state), text: translate(one.text), rate: one.positions_hz,
  }), one.state]);
  const key = JSON.stringify(shown);
  if (place.dataset.shown === key) return;
  place.dataset.shown = key;
  place.replaceChildren(...shown.map(([text, state]) => element("p", text, state)));
}

/** @param {Place | null} place */
function pointed(place) {
  write(byId("pointed"), place === null ? "" : map.ground.describe(place));
}

function showLayer() {
  const button = byId("layer");
  button.hidden = map.ground.layers.length < 2;
  write(button, say(map.ground.word()));
  write(byId("attribution"), map.ground.attribution());
}

async function loadGround() {
  try {
    await map.ground.load();
  } catch {
    setTimeout(loadGround, 3000);
  }
  showLayer();
}

/** @param {State} next */
function showLines(next) {
  const last = next.said.at(-1);
  const key = last ? `${next.said.length} ${last.at_s} ${last.text} ${next.flight_s === null}` : "";
  if (key === shownLines) return;
  shownLines = key;
  const rows = [...next.said].reverse().map((line) => {
    const row = element("li", "", line.level);
    const mark = element("span", MARKS[line.level]);
    mark.title = say(line.level);
    row.append(element("time", since(flightTime(next, line.at_s))), mark, element("span", translate(line.text)));
    return row;
  });
  byId("lines").replaceChildren(...rows);
}

/** @param {string} stamp */
async function loadChart(stamp) {
  charting = true;
  try {
    const answer = await fetch("/chart");
    if (answer.ok) {
      /** @type {PageChart} */
      const content = await answer.json();
      strips.names = content.names;
      planned = content.window;
      if (state !== null) showPlanned(state);
      chart.load(content);
      byId("legend-out").hidden = !content.left_out.length;
      byId("legend-barred").hidden = !content.unreachable.length;
      assets.load(content);
      charted = stamp;
    }
  } catch {
    // The next state asks again.
  } finally {
    charting = false;
  }
}

function listen() {
  const source = new EventSource("/events");
  source.onmessage = (event) => show(JSON.parse(event.data));
  source.onerror = () => {
    // A server that refuses ends the stream for good; one that is away is asked again by the browser itself.
    if (source.readyState === EventSource.CLOSED) setTimeout(listen, 2000);
  };
}

function watch() {
  const found = freshness.findTrouble(state, openedAt);
  const banner = byId("banner");
  banner.hidden = found === null;
  const old = found?.old ?? false;
  document.body.classList.toggle("old", old);
  if (old && state !== null) strips.show(state, freshness.ageS());
  banner.classList.toggle("over", found?.over ?? false);
  if (found !== null) write(banner, found.text);
}

/** @type {Record<string, string>} */
const KEYS = { h: "hold", r: "resume", b: "return", l: "land", x: "exclude", i: "include", s: "swap", d: "disarm" };
const STEP_PX = 60;

document.addEventListener("keydown", (event) => {
  if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]") || !state) return;
  if (event.target instanceof Element && event.target.closest("input")) return;
  const key = event.key;
  const vehicle = state.vehicles[Number(key) - 1];
  if (/^[1-9]$/.test(key) && vehicle) choose(vehicle.name);
  else if (key === "A") ask("abort", null);
  else if (key === "p") ask("replan", null);
  else if (key === "f" && state.inferred.length) ask("prove", null);
  else if (key === "y") briefing.answer();
  else if (key === "?") byId("help", HTMLDialogElement).showModal();
  else if (KEYS[key] && chosen) ask(KEYS[key], chosen);
  else if (KEYS[key]) intents.tell(say("Choose a vehicle first, with its number"), "refused");
  else if (key === "/" && !byId("assets").hidden) assets.find();
  else if (MOVES[key] && !document.activeElement?.closest("#vehicles, #assets")) map.move(STEP_PX * MOVES[key][0], STEP_PX * MOVES[key][1]);
  else if (key === "+" || key === "=") map.zoom(1.4);
  else if (key === "-") map.zoom(1 / 1.4);
  else if (key === "0") map.fit();
  else if (key === "m") nextLayer();
  else return;
  event.preventDefault();
});
byId("fleet").addEventListener("click", (event) => {
  const button = event.target instanceof Element ? event.target.closest("button") : null;
  if (button?.dataset.action) ask(button.dataset.action, null);
});
byId("keys").addEventListener("click", () => byId("help", HTMLDialogElement).showModal());
byId("zoom").addEventListener("click", (event) => {
  const way = event.target instanceof HTMLElement ? event.target.dataset.zoom : "";
  if (way === "fit") map.fit();
  else if (way) map.zoom(way === "in" ? 1.5 : 1 / 1.5);
});

byId("layer").addEventListener("click", nextLayer);

function nextLayer() {
  map.ground.next();
  showLayer();
}

setInterval(watch, 500);
loadGround();
listen();
