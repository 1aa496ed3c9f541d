// Which segments are flown: chosen by click, box, lasso, name or distance, then left out, taken in, locked.
import { element, write } from "./elements.js";
import { button, Field, TableList } from "./plan-forms.js";
import { hueOf } from "./map.js";
import { parseNumber, schemaAt } from "./plan-schema.js";
import { count, figure, say } from "./plan-texts.js";
import { apartM } from "./plan-track.js";

/** @import { Edit, Json, Segment } from "../plan.js" */
/** @import { PlanMap } from "./plan-map.js" */
/** @import { Step } from "./plan-steps.js" */
/** @import { Store } from "./plan-store.js" */

const LISTED = 200;
/** No vehicle's name. */
const NOBODY = "-";

/** @param {string} text */
const natural = (text) => text.toLowerCase().normalize("NFKC");
const order = new Intl.Collator(undefined, { numeric: true, sensitivity: "base" });

/**
 * The segments that words name: a part of a name, `*` for anything, or a range `from..to` in the order of their names.
 * @param {Segment[]} segments
 * @param {string} words
 * @returns {Segment[]}
 */
export function findNamed(segments, words) {
  const parts = words.split(/[,;\n]+/).map((one) => one.trim()).filter(Boolean);
  /** @type {Set<Segment>} */
  const found = new Set();
  for (const part of parts) {
    const [from, to] = part.split("..").map((one) => one.trim());
    for (const one of segments) {
      const isIn = to ? inRange(one.name, from, to)
        : part.includes("*") ? asPattern(part).test(one.name) : natural(one.name).includes(natural(part));
      if (isIn) found.add(one);
    }
  }
  return [...found];
}

/**
 * Whether an entry of a list of names, as the site file has it, means a segment: its name, `FIRST..LAST`, the name of
 * its line, or a pattern.
 * @param {string} name
 * @param {string} entry
 */
export function isMeant(name, entry) {
  const [from, to] = entry.split("..");
  if (name === entry || name.startsWith(`${entry}.`)) return true;
  const line = (/** @type {string} */ one) => one.slice(0, one.lastIndexOf("."));
  if (to) return line(name) === line(from) && inRange(name, from, to);
  return /[*?]/.test(entry) && asPattern(entry.replaceAll("?", "*")).test(name);
}

/** @param {string} name @param {string} from @param {string} to */
function inRange(name, from, to) {
  const [low, high] = order.compare(from, to) <= 0 ? [from, to] : [to, from];
  return order.compare(name, low) >= 0 && order.compare(name, high) <= 0;
}

/** @param {string} words */
const asPattern = (words) => new RegExp(`^${words.replace(/[.+?^${}()|[\]\\]/g, "\\$&").replaceAll("*", ".*")}$`, "i");

/**
 * What is done with the segments that are chosen; as edits of the site.
 */
export class SpanActions {
  /** @param {Store} store */
  constructor(store) {
    this.store = store;
  }

  get chosen() {
    return (this.store.network?.segments ?? []).filter((one) => this.store.selection.has(one.id));
  }

  /**
   * Writes which segments are left out: those that are now, with or without some.
   * @param {Set<number>} out
   * @param {string} label
   */
  write(out, label) {
    const segments = this.store.network?.segments ?? [];
    const names = segments.filter((one) => out.has(one.id)).map((one) => one.name);
    /** @type {Edit[]} */
    const edits = [names.length ? { op: "set", path: ["network", "leave_out"], value: names } : { op: "unset", path: ["network", "leave_out"] }];
    if (this.store.values.network?.only !== undefined) edits.push({ op: "unset", path: ["network", "only"] });
    return this.store.edit(edits, label);
  }

  leaveOut() {
    const out = new Set((this.store.network?.segments ?? []).filter((one) => one.left_out).map((one) => one.id));
    for (const one of this.chosen) out.add(one.id);
    return this.write(out, count("edit.leave-out", this.chosen.length));
  }

  takeIn() {
    const out = new Set((this.store.network?.segments ?? []).filter((one) => one.left_out).map((one) => one.id));
    for (const one of this.chosen) out.delete(one.id);
    return this.write(out, count("edit.take-in", this.chosen.length));
  }

  only() {
    const names = this.chosen.map((one) => one.name);
    /** @type {Edit[]} */
    const edits = [{ op: "set", path: ["network", "only"], value: names }];
    if (this.store.values.network?.leave_out !== undefined) edits.push({ op: "unset", path: ["network", "leave_out"] });
    return this.store.edit(edits, count("edit.only", names.length));
  }

  /** @param {string} vehicle */
  lock(vehicle) {
    const names = this.chosen.map((one) => one.name);
    const rest = this.withoutLocks(new Set(names));
    const others = rest.filter((one) => one.vehicle !== vehicle || Object.keys(one).some((key) => !["segments", "vehicle"].includes(key)));
    const own = rest.filter((one) => !others.includes(one)).flatMap((one) => one.segments);
    return this.writeLocks([...others, { segments: [...own, ...names], vehicle }], say("edit.lock", { names: names.slice(0, 2).join(", "), vehicle }));
  }

  unlock() {
    const names = new Set(this.chosen.map((one) => one.name));
    return this.writeLocks(this.withoutLocks(names), say("edit.unlock", { names: [...names].slice(0, 2).join(", ") }));
  }

  /** @param {Set<string>} names */
  withoutLocks(names) {
    const locks = /** @type {Json[]} */ (this.store.values.lock ?? []);
    const all = (this.store.network?.segments ?? []).map((one) => one.name);
    return locks.map((one) => {
      /** @type {string[]} */
      const entries = one.segments ?? [];
      // An entry that means others, too, becomes the names of those.
      const kept = entries.flatMap((entry) => {
        const meant = all.filter((name) => isMeant(name, entry));
        return meant.some((name) => names.has(name)) ? meant.filter((name) => !names.has(name)) : [entry];
      });
      return { ...one, segments: kept };
    }).filter((one) => one.segments.length);
  }

  /**
   * @param {Json[]} locks
   * @param {string} label
   */
  writeLocks(locks, label) {
    return this.store.edit([locks.length ? { op: "set", path: ["lock"], value: locks } : { op: "unset", path: ["lock"] }], label);
  }

  /** The colours of those whom segments are locked to. */
  listLocks() {
    /** @type {Map<number, string>} */
    const found = new Map();
    if (!this.store.values.lock) return found;
    for (const one of this.store.network?.segments ?? []) {
      const vehicle = this.store.names.indexOf(this.lockOf(one.name)?.vehicle);
      if (vehicle >= 0) found.set(one.id, hueOf(vehicle));
    }
    return found;
  }

  /** @param {string} name */
  lockOf(name) {
    const locks = /** @type {Json[]} */ (this.store.values.lock ?? []);
    return locks.find((one) => one.segments?.some((/** @type {string} */ entry) => isMeant(name, entry))) ?? null;
  }

  /**
   * Whose a segment stays, or from whose base it is flown; empty if it is not locked.
   * @param {string} name
   * @returns {string}
   */
  keeperOf(name) {
    const lock = this.lockOf(name);
    return lock?.vehicle ?? lock?.from ?? "";
  }
}

/**
 * Chooses the segments that lie within a distance of a place on the map.
 * @param {Store} store
 * @param {PlanMap} map
 */
function makeAround(store, map) {
  const line = element("form", "", "search");
  const distance = element("input");
  distance.type = "text";
  distance.inputMode = "decimal";
  distance.value = "200";
  distance.setAttribute("aria-label", say("spans.within"));
  const label = element("label", say("spans.within"), "soft");
  label.append(" ", distance, " m");
  line.append(label, element("button", say("spans.around")));
  line.addEventListener("submit", (event) => {
    event.preventDefault();
    const radius = parseNumber(distance.value);
    if (typeof radius !== "number") return;
    map.askPlace(say("guide.around"), (place) => {
      const found = (store.network?.segments ?? []).filter((one) => apartM(one.a, place) <= radius && apartM(one.b, place) <= radius);
      store.select(found.map((one) => one.id), "add");
    });
  });
  return line;
}

/**
 * @param {Store} store
 * @param {SpanActions} actions
 * @param {PlanMap} map
 * @returns {Step}
 */
export function spansStep(store, actions, map) {
  const keys = schemaAt(store.schema, ["network"]).properties ?? {};
  const radius = new Field(store, ["network", "radius_m"], keys.radius_m ?? {});
  const lists = ["leave_out", "only"].filter((key) => keys[key]).map((key) => new Field(store, ["network", key], keys[key]));
  const vehicles = () => store.names.map((name) => /** @type {[string, string]} */ ([name, name]));
  const locks = new TableList(store, ["lock"], schemaAt(store.schema, []).properties?.lock ?? {}, {
    choices: { vehicle: vehicles }, isAdded: false, title: (one) => `${(one?.segments ?? []).join(", ")}: ${one?.vehicle ?? one?.from ?? ""}`,
  });
  const search = element("input");
  search.type = "search";
  search.id = "sought-segments";
  search.autocomplete = "off";
  search.placeholder = say("spans.find.example");
  search.setAttribute("aria-label", say("spans.find"));
  const list = element("ul", "", "spans");
  list.setAttribute("aria-label", say("spans.list"));
  const note = element("p", "", "soft");
  const takes = button("", () => store.select(named().map((one) => one.id), "add"), "take");

  const named = () => findNamed(store.network?.segments ?? [], search.value || "*");

  search.addEventListener("input", () => showList());
  search.addEventListener("keydown", (event) => {
    if (event.key !== "Enter" || !search.value.trim()) return;
    store.select(named().map((one) => one.id), "add");
  });
  list.addEventListener("change", (event) => {
    if (event.target instanceof HTMLInputElement) store.select([Number(event.target.value)], "toggle");
  });

  /** @param {Segment} one @param {Map<number, string>} flown */
  function row(one, flown) {
    const keeper = actions.keeperOf(one.name);
    const item = element("li", "", one.left_out ? "is-out" : one.unreachable ? "is-over" : "");
    const label = element("label");
    const box = element("input");
    box.type = "checkbox";
    box.value = String(one.id);
    box.checked = store.selection.has(one.id);
    const state = one.left_out ? say("span.left-out") : one.unreachable ? say("span.unreachable")
      : keeper ? say("span.locked", { vehicle: keeper }) : flown.get(one.id) ?? "";
    label.append(box, element("span", one.name, "name"), element("span", state, "state-word"), element("span", `${figure(one.length_m)} m`, "length"));
    if (one.unreachable) item.title = one.unreachable;
    item.append(label);
    return item;
  }

  function showList() {
    const found = named();
    /** @type {Map<number, string>} */
    const flown = new Map();
    for (const vehicle of store.shown?.vehicles ?? []) {
      for (const route of vehicle.routes) for (const visit of route.visits) flown.set(visit.segment, vehicle.name);
    }
    list.replaceChildren(...found.slice(0, LISTED).map((one) => row(one, flown)));
    const rest = found.length - LISTED;
    write(note, rest > 0 ? count("spans.rest", rest) : "");
    write(takes, count("spans.take", found.length));
    takes.disabled = !found.length;
  }

  return {
    name: "spans",
    paths: [["network", "only"], ["network", "leave_out"], ["network", "radius_m"], ["lock"]],
    status: () => {
      const all = store.network?.segments ?? [];
      const out = all.filter((one) => one.left_out).length;
      const locked = all.filter((one) => actions.keeperOf(one.name)).length;
      const taken = out ? say("spans.status", { taken: all.length - out, all: all.length }) : all.length ? say("spans.all") : "";
      return locked ? `${taken}, ${say("spans.locked", { count: locked })}` : taken;
    },
    build: (place) => {
      const line = element("div", "", "search");
      line.append(search, takes);
      const more = element("details", "", "more");
      more.append(element("summary", say("spans.named")), ...lists.map((one) => one.element));
      place.append(element("p", say("spans.how"), "soft"), line, list, note, makeAround(store, map), radius.element, locks.element, more);
    },
    show: () => {
      radius.show();
      locks.show();
      for (const one of lists) one.show();
      showList();
    },
  };
}

/**
 * What can be done with the segments that are chosen, over the map.
 */
export class SelectionBar {
  /**
   * @param {Store} store
   * @param {HTMLElement} place
   * @param {SpanActions} actions
   * @param {{ describe: () => string, give: (vehicle: string) => void, turn: () => void }} by
   */
  constructor(store, place, actions, by) {
    this.store = store;
    this.place = place;
    this.actions = actions;
    this.by = by;
    this.what = element("b");
    this.buttons = element("div", "", "actions");
    place.append(this.what, this.buttons);
    place.addEventListener("keydown", (event) => {
      if (event.key !== "Escape" || !this.buttons.querySelector(".vehicle")) return;
      event.preventDefault();
      this.shown = "";
      this.show();
    });
    this.shown = "";
    store.on(["selection", "network", "plan", "draft", "workspace"], () => this.show());
  }

  show() {
    const chosen = this.actions.chosen;
    this.place.hidden = !chosen.length;
    if (!chosen.length) return;
    const keepers = new Set(chosen.map((one) => this.actions.keeperOf(one.name)).filter(Boolean));
    write(this.what, [this.by.describe(), ...[...keepers].map((vehicle) => say("span.locked", { vehicle }))].join(" · "));
    const names = this.store.names;
    const key = JSON.stringify([names, chosen.some((one) => one.left_out), chosen.some((one) => !one.left_out),
      chosen.some((one) => this.actions.lockOf(one.name)), this.store.mayChange]);
    if (key === this.shown) return;
    this.shown = key;
    this.buttons.replaceChildren(...this.makeButtons(chosen, names));
  }

  /**
   * @param {Segment[]} chosen
   * @param {string[]} names
   */
  makeButtons(chosen, names) {
    const made = [];
    const act = (/** @type {string} */ key, /** @type {() => void} */ does, /** @type {string} */ stroke, name = "") => {
      const one = button(say(key), does, name);
      one.dataset.act = key;
      if (stroke) one.append(" ", element("kbd", stroke));
      made.push(one);
    };
    if (chosen.some((one) => !one.left_out)) act("span.leave-out", () => this.actions.leaveOut(), "O");
    if (chosen.some((one) => one.left_out)) act("span.take-in", () => this.actions.takeIn(), "");
    act("span.only", () => this.actions.only(), "");
    made.push(this.makeChoice("span.lock", names, (vehicle) => this.actions.lock(vehicle), "K"));
    if (chosen.some((one) => this.actions.lockOf(one.name))) act("span.unlock", () => this.actions.unlock(), "");
    if (this.store.mayChange) {
      made.push(this.makeChoice("span.give", [...names, NOBODY], (vehicle) => this.by.give(vehicle === NOBODY ? "" : vehicle), "G"));
      act("span.turn", () => this.by.turn(), "T");
    }
    act("span.clear", () => this.store.select([]), "Esc", "plain");
    return made;
  }

  /**
   * A button that asks for a vehicle.
   * @param {string} key
   * @param {string[]} names
   * @param {(vehicle: string) => void} chosen
   */
  makeChoice(key, names, chosen, stroke = "") {
    const made = button(say(key), () => this.askVehicle(key, names, chosen));
    made.dataset.act = key;
    made.append(" ", element("kbd", stroke));
    return made;
  }

  /**
   * Shows the vehicles instead of what can be done, until one is chosen.
   * @param {string} key
   * @param {string[]} names
   * @param {(vehicle: string) => void} chosen
   */
  askVehicle(key, names, chosen) {
    const done = () => {
      this.shown = "";
      this.show();
    };
    const vehicles = names.map((name, index) => {
      const one = button(name === NOBODY ? say("span.nobody") : name, () => {
        done();
        chosen(name);
      }, "vehicle");
      one.dataset.vehicle = name;
      if (name !== NOBODY) one.style.setProperty("--hue", hueOf(index));
      return one;
    });
    const back = button(say("cancel"), done, "plain");
    back.append(" ", element("kbd", "Esc"));
    this.buttons.replaceChildren(element("span", say(key)), ...vehicles, back);
    vehicles[0]?.focus();
  }
}
