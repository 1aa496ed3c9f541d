// What became of each asset: missed ones first. Names and what is asked came with the map; the rest is fetched while
// somebody looks, when the state says that it is another.
import { element, write } from "./words.js";

const byId = (id) => document.getElementById(id);
const RANKS = ["missed", "given_up", "left_over", "open", "inferred", "seen"];
const MARKS = { missed: "✗", given_up: "✗", left_over: "–", open: "○", inferred: "≈", seen: "✓" };
const MAY_AGAIN = new Set(["seen", "inferred", "given_up"]);
const WHY = {
  missed: "Pictures of it are missing: it is flown again.",
  given_up: "Nobody flies it any more in this flight.",
  left_over: "It is left for the next sortie.",
  open: "It is still to be flown.",
};
// More rows than anybody reads, and than a phone lays out at once.
const MOST_ROWS = 120;
// From so many on it takes a search to find one.
const MANY = 10;
const LEAST_MS = 1500;

export class Assets {
  constructor(pointTo, intents) {
    this.pointTo = pointTo;
    this.intents = intents;
    this.names = [];
    // Of each asset: how many pictures it asks for.
    this.asked = new Map();
    this.known = new Map();
    this.rows = new Map();
    this.state = null;
    this.chosen = null;
    this.loaded = null;
    this.loading = false;
    this.waitMs = LEAST_MS;
    this.order = "";
    byId("assets").addEventListener("toggle", () => this.toggled());
    byId("sought").addEventListener("input", () => this.draw());
  }

  load(chart) {
    const first = !this.asked.size;
    this.names = chart.names;
    this.pictures = chart.pictures;
    this.asked = new Map(chart.assets);
    write(byId("assets-what"), this.pictures ? "Assets" : "Segments");
    byId("sought").hidden = this.asked.size < MANY;
    // On a phone it takes no room until it is asked for, nor where there are no pictures to look after.
    if (first) byId("assets").open = this.pictures && matchMedia("(min-width: 901px)").matches;
    if (this.state) this.show(this.state);
  }

  show(state) {
    this.state = state;
    const shown = this.asked.size > 0 && (state.flight_s !== null || state.finished);
    byId("assets").hidden = !shown;
    document.body.classList.toggle("listing", shown && byId("assets").open);
    if (!shown) return;
    const lists = `${state.inspected.length} ${state.missed.join()} ${state.inferred.length} ${state.uncovered.length}`;
    if (lists !== this.lists) {
      this.lists = lists;
      this.count();
      this.draw();
    }
    this.act();
    if (byId("assets").open && state.assets !== this.loaded && !this.loading) this.fetch();
  }

  count() {
    const seen = this.state.inspected.filter((segment) => this.asked.has(segment)).length;
    const missed = this.state.missed.length;
    write(byId("tally"), `${seen} of ${this.asked.size} ${this.pictures ? "seen" : "inspected"}`);
    write(byId("tally-missed"), missed ? `${missed} missed` : "");
  }

  toggled() {
    if (!this.state) return;
    this.show(this.state);
    this.draw();
  }

  // A row that was touched on the map, or in the list.
  choose(segment) {
    this.chosen = this.asked.has(segment) ? segment : null;
    this.draw();
    this.reveal();
  }

  reveal() {
    const row = this.rows.get(this.chosen);
    if (row?.isConnected) row.scrollIntoView({ block: "nearest" });
  }

  find() {
    byId("assets").open = true;
    const field = byId("sought");
    (field.hidden ? byId("listed").querySelector("button") : field)?.focus();
  }

  async fetch() {
    this.loading = true;
    const beganMs = performance.now();
    try {
      const answer = await fetch("/assets");
      if (answer.ok) {
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

  // What is known of one asset; what the newest state says goes first.
  of(segment, lists) {
    const [, told, pictures, vehicle] = this.known.get(segment) ?? [segment, "open", 0, null];
    let state = told;
    if (lists.inspected.has(segment)) state = lists.inferred.has(segment) ? "inferred" : "seen";
    else if (lists.missed.has(segment)) state = told === "given_up" ? told : "missed";
    else if (told !== "given_up" && told !== "left_over") state = "open";
    return { segment, state, pictures, vehicle, name: this.names[segment] ?? `segment ${segment}`, asked: this.asked.get(segment) };
  }

  draw() {
    if (!this.state || !byId("assets").open) return;
    const lists = Object.fromEntries(["inspected", "inferred", "missed"].map((name) => [name, new Set(this.state[name])]));
    const sought = byId("sought").value.trim().toLowerCase();
    const found = [...this.asked.keys()].map((segment) => this.of(segment, lists)).filter((one) => this.fits(one, sought));
    found.sort((one, other) => RANKS.indexOf(one.state) - RANKS.indexOf(other.state) || one.segment - other.segment);
    const shown = found.slice(0, MOST_ROWS);
    const chosen = found.find((one) => one.segment === this.chosen);
    if (chosen && !shown.includes(chosen)) shown.push(chosen);
    this.place(shown.map((one) => this.row(one)));
    const left = found.length - shown.length;
    const nothing = found.length ? "" : "Nothing is called so, or is in that state.";
    write(byId("unlisted"), left ? `${left} more: search for a name, a state or a vehicle.` : nothing);
    this.act();
  }

  fits(one, sought) {
    return !sought || `${one.name}\n${this.word(one.state)}\n${one.vehicle ?? ""}`.toLowerCase().includes(sought);
  }

  word(state) {
    return state === "seen" && !this.pictures ? "inspected" : state.replace("_", " ");
  }

  // Rows that stay where they are keep the finger, and the keyboard, that is on them.
  place(rows) {
    const order = rows.map((row) => row.dataset.segment).join();
    if (order === this.order) return;
    this.order = order;
    const held = document.activeElement;
    byId("listed").replaceChildren(...rows);
    if (held?.isConnected && held.closest("#listed")) held.focus({ preventScroll: true });
  }

  row(one) {
    let row = this.rows.get(one.segment);
    if (!row) {
      row = this.make(one);
      this.rows.set(one.segment, row);
    }
    row.className = `asset is-${one.state}${one.segment === this.chosen ? " chosen" : ""}`;
    row.dataset.state = one.state;
    const count = one.asked && (one.pictures || one.state !== "open") ? `${one.pictures} of ${one.asked}` : "";
    write(row.querySelector(".mark"), MARKS[one.state]);
    write(row.querySelector(".became"), [this.word(one.state), count].filter(Boolean).join(" "));
    write(row.querySelector(".by"), one.vehicle ?? "");
    row.querySelector(".pick").setAttribute("aria-expanded", one.segment === this.chosen);
    row.querySelector(".more").hidden = one.segment !== this.chosen;
    return row;
  }

  make(one) {
    const row = element("li");
    row.dataset.segment = one.segment;
    const pick = element("button", "", "pick");
    pick.append(element("b", "", "mark"), element("span", one.name, "asset-name"), element("span", "", "became"), element("span", "", "by"));
    pick.addEventListener("click", () => this.picked(one.segment));
    const more = element("div", "", "more");
    const again = element("button", "Look again", "again");
    again.addEventListener("click", () => this.intents.lookAgain(one.segment, one.name));
    more.append(element("span", "", "asset-why"), again);
    row.append(pick, more);
    return row;
  }

  picked(segment) {
    this.chosen = this.chosen === segment ? null : segment;
    this.pointTo(this.chosen);
    this.draw();
    this.reveal();
  }

  // What may be asked of the one that is chosen.
  act() {
    const row = this.rows.get(this.chosen);
    if (!row) return;
    const over = this.state.finished || this.state.recalled;
    row.querySelector(".again").hidden = over || !MAY_AGAIN.has(row.dataset.state);
    write(row.querySelector(".asset-why"), WHY[row.dataset.state] ?? "");
  }
}
