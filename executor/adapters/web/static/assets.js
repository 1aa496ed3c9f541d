// What became of each asset: missed ones first. Names and what is asked came with the map; the rest is fetched while
// somebody looks, when the state says that it is another.
import { byId, element, find, write } from "./elements.js";
import { say } from "./translation.js";

/** @import { PageAssets, PageChart, State } from "../documents.js" */
/** @import { Intents } from "./intents.js" */

/** @typedef {{ inspected: Set<number>, inferred: Set<number>, missed: Set<number> }} Lists */
/** @typedef {ReturnType<Assets["of"]>} Asset */

const list = byId("assets", HTMLDetailsElement);
const sought = byId("sought", HTMLInputElement);
const RANKS = ["missed", "given_up", "left_over", "open", "inferred", "seen"];
/** @type {Record<string, string>} */
const MARKS = { missed: "✗", given_up: "✗", left_over: "–", open: "○", inferred: "≈", seen: "✓" };
const MAY_AGAIN = new Set(["seen", "inferred", "given_up"]);
/** @type {Record<string, string>} */
const WHY = {
  missed: "Pictures of it are missing: it is flown again.",
  given_up: "No vehicle flies it any more in this flight.",
  left_over: "It is left for the next flight.",
  open: "It is still to be flown.",
};
// More rows than anybody reads, and than a phone lays out at once.
const MOST_ROWS = 120;
// From so many on it takes a search to find one.
const MANY = 10;
const LEAST_MS = 1500;

export class Assets {
  /**
   * @param {(segment: number | null) => void} pointTo
   * @param {Intents} intents
   */
  constructor(pointTo, intents) {
    this.pointTo = pointTo;
    this.intents = intents;
    /** @type {string[]} */
    this.names = [];
    this.pictures = false;
    /**
     * Of each asset: how many pictures it asks for.
     * @type {Map<number, number>}
     */
    this.asked = new Map();
    /** @type {Map<number, PageAssets["rows"][number]>} */
    this.known = new Map();
    /** @type {Map<number | null, HTMLElement>} */
    this.rows = new Map();
    /** @type {State | null} */
    this.state = null;
    /** @type {number | null} */
    this.chosen = null;
    /** @type {number | null} */
    this.loaded = null;
    this.lists = "";
    this.loading = false;
    this.waitMs = LEAST_MS;
    this.order = "";
    list.addEventListener("toggle", () => this.toggled());
    sought.addEventListener("input", () => this.draw());
  }

  /** @param {PageChart} chart */
  load(chart) {
    const first = !this.asked.size;
    this.names = chart.names;
    this.pictures = chart.pictures;
    this.asked = new Map(chart.assets);
    write(byId("assets-what"), say(this.pictures ? "Assets" : "Segments"));
    sought.hidden = this.asked.size < MANY;
    // On a phone it takes no room until it is asked for, nor where there are no pictures to look after.
    if (first) list.open = this.pictures && matchMedia("(min-width: 901px)").matches;
    if (this.state) this.show(this.state);
  }

  /** @param {State} state */
  show(state) {
    this.state = state;
    const shown = this.asked.size > 0 && (state.flight_s !== null || state.finished);
    list.hidden = !shown;
    document.body.classList.toggle("listing", shown && list.open);
    if (!shown) return;
    const lists = `${state.inspected.length} ${state.missed.join()} ${state.inferred.length} ${state.uncovered.length}`;
    if (lists !== this.lists) {
      this.lists = lists;
      this.count(state);
      this.draw();
    }
    this.act();
    if (list.open && state.assets !== this.loaded && !this.loading) this.fetch();
  }

  /** @param {State} state */
  count(state) {
    const seen = state.inspected.filter((segment) => this.asked.has(segment)).length;
    const missed = state.missed.length;
    write(byId("tally"), say(this.pictures ? "{seen} of {total} seen" : "{seen} of {total} inspected", {
      seen, total: this.pictures ? this.asked.size : state.segments_total,
    }));
    write(byId("tally-missed"), missed ? say("{missed} missed", { missed }) : "");
  }

  toggled() {
    if (!this.state) return;
    this.show(this.state);
    this.draw();
  }

  /**
   * A row that was touched on the map, or in the list.
   * @param {number | null} segment
   */
  choose(segment) {
    this.chosen = segment !== null && this.asked.has(segment) ? segment : null;
    this.draw();
    this.reveal();
  }

  reveal() {
    const row = this.rows.get(this.chosen);
    if (row?.isConnected) row.scrollIntoView({ block: "nearest" });
  }

  find() {
    list.open = true;
    (sought.hidden ? byId("listed").querySelector("button") : sought)?.focus();
  }

  async fetch() {
    this.loading = true;
    const beganMs = performance.now();
    try {
      const answer = await fetch("/assets");
      if (answer.ok) {
        /** @type {PageAssets} */
        const content = await answer.json();
        this.known = new Map(content.rows.map((row) => [row[0], row]));
        this.loaded = content.assets;
        this.draw();
      }
    } catch {
      // The next state asks again.
    }
    // A slow link is not kept busy with it.
    setTimeout(() => { this.loading = false; }, Math.max(LEAST_MS, 10 * (performance.now() - beganMs)));
  }

  /**
   * What is known of one asset; what the newest state says goes first.
   * @param {number} segment
   * @param {Lists} lists
   */
  of(segment, lists) {
    const [, told, pictures, vehicle] = this.known.get(segment) ?? [segment, "open", 0, null];
    let state = told;
    if (lists.inspected.has(segment)) state = lists.inferred.has(segment) ? "inferred" : "seen";
    else if (lists.missed.has(segment)) state = told === "given_up" ? told : "missed";
    else if (told !== "given_up" && told !== "left_over") state = "open";
    return { segment, state, pictures, vehicle, name: this.names[segment] ?? say("segment {segment}", { segment }), asked: this.asked.get(segment) };
  }

  draw() {
    if (!this.state || !list.open) return;
    const { inspected, inferred, missed } = this.state;
    const lists = { inspected: new Set(inspected), inferred: new Set(inferred), missed: new Set(missed) };
    const wanted = sought.value.trim().toLowerCase();
    const found = [...this.asked.keys()].map((segment) => this.of(segment, lists)).filter((one) => this.fits(one, wanted));
    found.sort((one, other) => RANKS.indexOf(one.state) - RANKS.indexOf(other.state) || one.segment - other.segment);
    const shown = found.slice(0, MOST_ROWS);
    const chosen = found.find((one) => one.segment === this.chosen);
    if (chosen && !shown.includes(chosen)) shown.push(chosen);
    this.place(shown.map((one) => this.row(one)));
    const left = found.length - shown.length;
    const nothing = found.length ? "" : say("No asset has this name or this state.");
    write(byId("unlisted"), left ? say("{left} more: search for a name, a state or a vehicle.", { left }) : nothing);
    this.act();
  }

  /**
   * @param {Asset} one
   * @param {string} wanted
   */
  fits(one, wanted) {
    return !wanted || `${one.name}\n${this.word(one.state)}\n${one.vehicle ?? ""}`.toLowerCase().includes(wanted);
  }

  /** @param {string} state */
  word(state) {
    return say(state === "seen" && !this.pictures ? "inspected" : state.replace("_", " "));
  }

  /**
   * Rows that stay where they are keep the finger, and the keyboard, that is on them.
   * @param {HTMLElement[]} rows
   */
  place(rows) {
    const order = rows.map((row) => row.dataset.segment).join();
    if (order === this.order) return;
    this.order = order;
    const held = document.activeElement;
    byId("listed").replaceChildren(...rows);
    if (held instanceof HTMLElement && held.isConnected && held.closest("#listed")) held.focus({ preventScroll: true });
  }

  /** @param {Asset} one */
  row(one) {
    let row = this.rows.get(one.segment);
    if (!row) {
      row = this.make(one);
      this.rows.set(one.segment, row);
    }
    row.className = `asset is-${one.state}${one.segment === this.chosen ? " chosen" : ""}`;
    row.dataset.state = one.state;
    const count = one.asked && (one.pictures || one.state !== "open") ? say("{part} of {total}", { part: one.pictures, total: one.asked }) : "";
    write(find(row, ".mark"), MARKS[one.state]);
    write(find(row, ".became"), [this.word(one.state), count].filter(Boolean).join(" "));
    write(find(row, ".by"), one.vehicle ?? "");
    find(row, ".pick").setAttribute("aria-expanded", String(one.segment === this.chosen));
    find(row, ".more").hidden = one.segment !== this.chosen;
    return row;
  }

  /** @param {Asset} one */
  make(one) {
    const row = element("li");
    row.dataset.segment = String(one.segment);
    const pick = element("button", "", "pick");
    pick.append(element("b", "", "mark"), element("span", one.name, "asset-name"), element("span", "", "became"), element("span", "", "by"));
    pick.addEventListener("click", () => this.picked(one.segment));
    const more = element("div", "", "more");
    const again = element("button", say("Look again"), "again");
    again.addEventListener("click", () => this.intents.lookAgain(one.segment, one.name));
    more.append(element("span", "", "asset-why"), again);
    row.append(pick, more);
    return row;
  }

  /** @param {number} segment */
  picked(segment) {
    this.chosen = this.chosen === segment ? null : segment;
    this.pointTo(this.chosen);
    this.draw();
    this.reveal();
  }

  // What may be asked of the one that is chosen.
  act() {
    const row = this.rows.get(this.chosen);
    if (!row || !this.state) return;
    const over = this.state.finished || this.state.recalled;
    const became = row.dataset.state ?? "";
    find(row, ".again").hidden = over || !MAY_AGAIN.has(became);
    write(find(row, ".asset-why"), say(WHY[became] ?? ""));
  }
}
