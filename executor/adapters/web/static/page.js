// The page to fly by: takes the newest state from the server, shows it, and hands the operator's wishes back.
import { Assets } from "./assets.js";
import { Briefing } from "./briefing.js";
import { all, byId, element, write } from "./elements.js";
import { Freshness } from "./freshness.js";
import { Intents } from "./intents.js";
import { Chart } from "./map.js";
import { Offers } from "./offers.js";
import { Strips } from "./strips.js";

/** @import { PageChart, Place, State } from "../documents.js" */

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
/** @type {Record<string, [number, number]>} */
const MOVES = { ArrowLeft: [60, 0], ArrowRight: [-60, 0], ArrowUp: [0, 60], ArrowDown: [0, -60] };

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]") || !state) return;
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
  else if (KEYS[key]) intents.tell("Choose a vehicle first, with its number", "refused");
  else if (key === "/" && !byId("assets").hidden) assets.find();
  else if (MOVES[key] && !document.activeElement?.closest("#vehicles, #assets")) chart.move(...MOVES[key]);
  else if (key === "+" || key === "=") chart.zoom(1.4);
  else if (key === "-") chart.zoom(1 / 1.4);
  else if (key === "0") chart.fit();
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
  if (way === "fit") chart.fit();
  else if (way) chart.zoom(way === "in" ? 1.5 : 1 / 1.5);
});

byId("layer").addEventListener("click", nextLayer);

function nextLayer() {
  chart.ground.next();
  showLayer();
}

setInterval(watch, 500);
loadGround();
listen();
