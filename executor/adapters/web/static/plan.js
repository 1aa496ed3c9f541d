// The page on which a crew makes its flight: wires the steps, the map, the plan and the times to one store.
import { all, byId, find, write } from "./elements.js";
import { listen, persist, server } from "./plan-api.js";
import { dayStep, inspectionStep, otherStep, vehiclesStep } from "./plan-fleet.js";
import { Flights } from "./plan-flights.js";
import { PlanMap } from "./plan-map.js";
import { Dropping, networkStep, remediesOf } from "./plan-network.js";
import { addArea, areasStep, placesStep } from "./plan-places.js";
import { Result } from "./plan-result.js";
import { SelectionBar, SpanActions, spansStep } from "./plan-spans.js";
import { Steps } from "./plan-steps.js";
import { Store } from "./plan-store.js";
import { count, fill, loadTexts, say } from "./plan-texts.js";
import { Timeline } from "./plan-timeline.js";
import { offerLanguages } from "./translation.js";

/** @import { Schema } from "../plan.js" */

const TOLD_MS = 6000;
const SLIDE_S = 10;

/** @param {Schema} schema */
function start(schema) {
  const store = new Store(schema);
  const actions = new SpanActions(store);
  const map = new PlanMap(store, {
    area: (ring) => addArea(store, ring), chosen: (path) => steps.goTo(path), cancel: () => cancel(store, map),
    locks: () => actions.listLocks(),
  });
  const dropping = new Dropping(store);
  /** @type {Steps} */
  const steps = new Steps(store, byId("steps"), [
    networkStep(store, dropping), spansStep(store, actions, map), placesStep(store, map), areasStep(store, map, () => map.use("area")),
    vehiclesStep(store), inspectionStep(store), dayStep(store, map), otherStep(store),
  ], remediesOf(store));
  const result = new Result(store, byId("plans"));
  new Flights(store, byId("plans"), ask);
  new SelectionBar(store, byId("selected"), actions, {
    describe: () => map.describeSelection(), give: (vehicle) => result.give(vehicle), turn: () => result.turn(),
  });
  new Timeline(store, byId("times"), { lose: () => result.lose() });
  byId("drop").append(dropping.makeTarget());
  store.tell = tell;
  // On a small screen the answer is where nobody looks.
  store.on(["loss", "draft"], () => {
    if (store.loss || store.draft) show("plan");
  });
  store.on(["workspace", "link", "job"], () => showState(store));
  let opened = "";
  store.on(["workspace"], () => {
    showSite(store);
    const { workspace } = store;
    // What stops a plan is looked at first, once it is known.
    if (!workspace?.site || workspace.site.path === opened || workspace.checked !== workspace.revision) return;
    opened = workspace.site.path;
    if (store.problems.length) steps.goToProblem(store.problems[0]);
    else steps.open(workspace.plans.length ? "spans" : "network");
  });
  listenToButtons(store, steps);
  listenToKeys(store, { map, steps, result, actions });
  listen((news) => store.news(news), (isHeard) => store.heard(isHeard));
  // Who comes back from the page of a flight sees what it came to.
  addEventListener("pageshow", (event) => {
    if (event.persisted) location.reload();
  });
  addEventListener("beforeunload", (event) => {
    if (store.waiting.length) event.preventDefault();
  });
  return { store, dropping };
}

/** @param {Store} store */
function showSite(store) {
  const site = store.workspace?.site ?? null;
  byId("empty").hidden = site !== null;
  find(document, "main").hidden = site === null;
  write(byId("site-name"), site?.name ?? "");
  byId("site-name").title = site?.path ?? "";
  document.title = site ? `${site.name} · faultline` : "faultline";
}

/** @param {Store} store */
function showState(store) {
  const { workspace, waiting, isHeard } = store;
  const banner = byId("banner");
  const refused = workspace?.save_error ?? null;
  banner.hidden = isHeard && refused === null;
  write(banner, isHeard ? (refused === null ? "" : say("save.error", { error: refused }))
    : waiting.length ? count("link.lost.kept", waiting.length) : say("link.lost"));
  const saved = byId("saved");
  const state = !workspace?.site ? "" : waiting.length ? "saving" : refused || !workspace.saved ? "unsaved" : "saved";
  saved.className = state ? `is-${state}` : "";
  write(saved, state ? say(`save.${state}`) + (store.tabs > 1 ? ` · ${say("tabs.count", { tabs: store.tabs })}` : "") : "");
  for (const way of /** @type {const} */ (["undo", "redo"])) {
    const pressed = byId(way, HTMLButtonElement);
    pressed.disabled = !workspace?.[way];
    pressed.title = workspace?.[way] ? say(`${way}.what`, { label: workspace[way] ?? "" }) : "";
  }
  const wrong = workspace?.problems.length ?? 0;
  byId("wrong").hidden = !wrong;
  write(byId("wrong"), wrong ? count("problems", wrong) : "");
}

/**
 * @param {Store} store
 * @param {Steps} steps
 */
function listenToButtons(store, steps) {
  byId("undo").addEventListener("click", () => store.step("undo"));
  byId("redo").addEventListener("click", () => store.step("redo"));
  let next = 0;
  byId("wrong").addEventListener("click", () => {
    const { problems } = store;
    if (!problems.length) return;
    const one = problems[next % problems.length];
    next += 1;
    show("prepare");
    if (one.path.length) steps.goToProblem(one);
    tell(one.message, "failed");
  });
  byId("keys").addEventListener("click", () => byId("help", HTMLDialogElement).showModal());
  for (const one of all(byId("views"), "button")) one.addEventListener("click", () => show(one.dataset.view ?? ""));
  offerLanguages(byId("language", HTMLSelectElement));
}

/**
 * On a small screen one of both panels is shown.
 * @param {string} view
 */
function show(view) {
  document.body.dataset.view = view;
  for (const one of all(byId("views"), "button")) one.setAttribute("aria-pressed", String(one.dataset.view === view));
}

/**
 * Ends what was begun last: a tool, a change by hand, a choice.
 * @param {Store} store
 * @param {PlanMap} map
 */
function cancel(store, map) {
  if (map.tool !== "pick") map.stop();
  else if (store.draft) store.dropDraft();
  else if (store.selection.size) store.select([]);
}

/**
 * @param {Store} store
 * @param {{ map: PlanMap, steps: Steps, result: Result, actions: SpanActions }} parts
 */
function listenToKeys(store, { map, steps, result, actions }) {
  /** @type {Record<string, () => void>} */
  const keys = {
    b: () => map.use("box"), l: () => map.use("lasso"), a: () => map.use("area"), p: () => {
      show("plan");
      result.plan();
    }, x: () => result.lose(),
    o: () => { if (store.selection.size) actions.leaveOut(); },
    t: () => { if (store.selection.size && store.shown) result.turn(); },
    k: () => press("span.lock"), g: () => press("span.give"),
    ",": () => store.goTo(store.timeS - SLIDE_S), ".": () => store.goTo(store.timeS + SLIDE_S), 0: () => map.fit(),
    m: () => byId("layer").click(),
    "?": () => byId("help", HTMLDialogElement).showModal(),
    "/": () => {
      show("prepare");
      steps.open("spans");
      byId("sought-segments").focus();
    },
  };
  document.addEventListener("keydown", (event) => {
    if (event.defaultPrevented || document.querySelector("dialog[open]")) return;
    const isTyping = event.target instanceof Element && event.target.closest("input:not([type=checkbox], [type=range]), textarea, select");
    if ((event.ctrlKey || event.metaKey) && !event.altKey && !isTyping) {
      const key = event.key.toLowerCase();
      if (key === "z") store.step(event.shiftKey ? "redo" : "undo");
      else if (key === "y") store.step("redo");
      else return;
      event.preventDefault();
      return;
    }
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "Escape") {
      if (isTyping && event.target instanceof HTMLElement) event.target.blur();
      else cancel(store, map);
      return;
    }
    if (isTyping || !store.workspace?.site) return;
    const offered = byId("selected").querySelectorAll(".vehicle");
    const meant = /^[1-9]$/.test(event.key) ? offered[Number(event.key) - 1] : undefined;
    if (meant instanceof HTMLElement) {
      meant.click();
      return;
    }
    if (/^[1-9]$/.test(event.key)) {
      const vehicle = store.shown?.vehicles[Number(event.key) - 1];
      if (vehicle) store.chooseVehicle(vehicle.name);
      return;
    }
    const does = keys[event.key];
    if (!does) return;
    event.preventDefault();
    does();
  });
}

/** @param {string} key */
function press(key) {
  const place = byId("selected").querySelector(`[data-act="${CSS.escape(key)}"]`);
  if (place instanceof HTMLElement) place.click();
}

let timer = 0;

/** @param {string} text */
function tell(text, outcome = "accepted") {
  const place = byId("answer");
  place.textContent = text;
  place.className = `shown ${outcome}`;
  clearTimeout(timer);
  timer = setTimeout(() => place.classList.remove("shown"), TOLD_MS);
}

/**
 * @param {string} heading
 * @param {string} meaning
 * @param {string} yes
 * @param {() => void} done
 */
function ask(heading, meaning, yes, done) {
  const dialog = byId("ask", HTMLDialogElement);
  if (dialog.open) return;
  byId("question").textContent = heading;
  byId("meaning").textContent = meaning;
  byId("yes").textContent = yes;
  find(dialog, "form", HTMLFormElement).onsubmit = (event) => {
    if (event.submitter === byId("yes")) done();
  };
  dialog.showModal();
}

async function begin() {
  await loadTexts();
  fill();
  show("prepare");
  const waits = () => {
    byId("banner").hidden = false;
    write(byId("banner"), say("link.lost"));
  };
  const schema = await persist(() => server.schema(), waits);
  const { store, dropping } = start(schema);
  await store.begin();
  const { workspace } = store;
  if (!workspace?.site) dropping.listFiles(byId("found"));
}

begin();
