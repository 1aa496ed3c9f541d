// The page to fly by: takes the newest state from the server, shows it, and hands the operator's wishes back.
import { Chart } from "./map.js";
import { Intents } from "./intents.js";
import { Strips } from "./strips.js";

const STALE_MS = 3000;
const MARKS = { info: "·", warning: "▲", fault: "■" };
const byId = (id) => document.getElementById(id);

const chart = new Chart(byId("map"), choose);
const intents = new Intents(() => state);
const strips = new Strips(byId("vehicles"), choose, (action, vehicle) => intents.ask(action, vehicle));
let state = null;
let heardAt = performance.now();
let chosen = null;
let charted = "";
let charting = false;
let shownLines = "";

function choose(name) {
  chosen = name;
  strips.choose(name);
  chart.choose(name);
}

export function clock(seconds) {
  if (seconds === null || seconds === undefined) return "–";
  const whole = Math.max(0, Math.floor(seconds));
  const pad = (value) => String(value).padStart(2, "0");
  const hours = Math.floor(whole / 3600);
  return (hours ? `${hours}:${pad(Math.floor(whole / 60) % 60)}` : `${Math.floor(whole / 60)}`) + `:${pad(whole % 60)}`;
}

function show(next) {
  state = next;
  heardAt = performance.now();
  byId("clock").textContent = clock(next.flight_s);
  byId("count").textContent = `${next.inspected.length} of ${next.segments_total}`;
  byId("bar").style.width = `${(100 * next.inspected.length) / Math.max(1, next.segments_total)}%`;
  byId("revision").textContent = next.replan
    ? `${next.replan.revision} ${next.replan.solving ? "is solved …" : "goes on board …"}`
    : `revision ${next.revision}`;
  showWindow(next);
  strips.show(next);
  chart.show(next);
  showLines(next);
  intents.show(next);
  for (const button of byId("fleet").querySelectorAll("[data-action]")) button.disabled = next.finished || next.recalled;
  document.title = `${next.inspected.length}/${next.segments_total} faultline`;
  const stamp = JSON.stringify(next.chart);
  if (stamp !== charted && !charting) loadChart(stamp);
}

function showWindow(next) {
  const judged = next.vehicles.filter((one) => one.loss);
  const outside = judged.filter((one) => !one.loss.inside_window).map((one) => one.name);
  const place = byId("window");
  place.textContent = !judged.length ? "not known" : outside.length ? `✗ not ${outside.join(", ")}` : "✓ all finished";
  place.className = !judged.length ? "" : outside.length ? "loss out" : "loss in";
  place.title = outside.length ? "The loss of these could not be made good by the others" : "";
}

function showLines(next) {
  const key = next.said.length ? `${next.said.length} ${next.said.at(-1).at_s} ${next.said.at(-1).text}` : "";
  if (key === shownLines) return;
  shownLines = key;
  const began = next.flight_s === null ? 0 : next.now_s - next.flight_s;
  const rows = [...next.said].reverse().map((line) => {
    const row = document.createElement("li");
    row.className = line.level;
    const when = document.createElement("time");
    when.textContent = clock(line.at_s - began);
    const mark = document.createElement("span");
    mark.textContent = MARKS[line.level];
    mark.title = line.level;
    const text = document.createElement("span");
    text.textContent = line.text;
    row.append(when, mark, text);
    return row;
  });
  byId("lines").replaceChildren(...rows);
}

async function loadChart(stamp) {
  charting = true;
  try {
    const answer = await fetch("/chart");
    if (answer.ok) {
      chart.load(await answer.json());
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
  const silent = performance.now() - heardAt;
  const banner = byId("banner");
  const over = state !== null && state.finished;
  banner.hidden = silent < STALE_MS && !(state && state.all_silent);
  if (silent >= STALE_MS) {
    banner.textContent = over
      ? "The flight is over; this page shows its end"
      : `No contact with the ground station for ${Math.floor(silent / 1000)} s: what is shown is old`;
  } else if (!banner.hidden) {
    banner.textContent = "All vehicles are silent at once: look at the radio first";
  }
}

const KEYS = { h: "hold", r: "resume", b: "return", l: "land", x: "exclude", i: "include" };
const MOVES = { ArrowLeft: [60, 0], ArrowRight: [-60, 0], ArrowUp: [0, 60], ArrowDown: [0, -60] };

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]") || !state) return;
  const key = event.key;
  const vehicle = state.vehicles[Number(key) - 1];
  if (/^[1-9]$/.test(key) && vehicle) choose(vehicle.name);
  else if (key === "A") intents.ask("abort", null);
  else if (key === "p") intents.ask("replan", null);
  else if (key === "?") byId("help").showModal();
  else if (KEYS[key] && chosen) intents.ask(KEYS[key], chosen);
  else if (KEYS[key]) intents.tell("Choose a vehicle first, with its number", "refused");
  else if (MOVES[key] && document.activeElement !== byId("vehicles")) chart.move(...MOVES[key]);
  else if (key === "+" || key === "=") chart.zoom(1.4);
  else if (key === "-") chart.zoom(1 / 1.4);
  else if (key === "0") chart.fit();
  else return;
  event.preventDefault();
});
byId("fleet").addEventListener("click", (event) => {
  const button = event.target.closest("[data-action]");
  if (button) intents.ask(button.dataset.action, null);
});
byId("keys").addEventListener("click", () => byId("help").showModal());
byId("zoom").addEventListener("click", (event) => {
  const way = event.target.dataset.zoom;
  if (way === "fit") chart.fit();
  else if (way) chart.zoom(way === "in" ? 1.5 : 1 / 1.5);
});

setInterval(watch, 500);
listen();
