// What came of planning: progress, the plans side by side, the routes as a table, what is left over, and changes by
// hand, each checked and priced before it is kept.
import { element, write } from "./elements.js";
import { server } from "./plan-api.js";
import { drawFront } from "./plan-charts.js";
import { button } from "./plan-forms.js";
import { hueOf } from "./map.js";
import { count, figure, say } from "./plan-texts.js";
import { clock } from "./words.js";

/** @import { Change, PlannedVehicle, PlanSummary, PlannedVisit } from "../plan.js" */
/** @import { Store } from "./plan-store.js" */

const SECONDS = [2, 5, 20, 60, 300];
const COSTS = ["", "coverage", "minmax", "minsum", "mincomb"];
const MTBF_H = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];

/**
 * Seconds from a midnight as a time of the day.
 * @param {number} seconds
 */
const timeOfDay = (seconds) => [3600, 60].map((unit) => String(Math.floor((seconds % (unit === 60 ? 3600 : 86400)) / unit)).padStart(2, "0")).join(":");

/**
 * A menu of texts, by what they stand for.
 * @param {string} name
 * @param {[string, string][]} entries
 */
function menu(name, entries) {
  const label = element("label", "", "menu");
  const made = element("select");
  for (const [value, text] of entries) {
    const option = element("option", text);
    option.value = value;
    made.append(option);
  }
  label.append(element("span", name), made);
  return { label, made };
}

/**
 * @param {string} name
 */
function tick(name) {
  const label = element("label", "", "tick");
  const made = element("input");
  made.type = "checkbox";
  label.append(made, element("span", name));
  return { label, made };
}

export class Result {
  /**
   * @param {Store} store
   * @param {HTMLElement} place
   */
  constructor(store, place) {
    this.store = store;
    this.start = button("", () => this.plan(), "primary");
    this.start.id = "start";
    this.start.append(element("span", say("plan.start")), " ", element("kbd", "P"));
    this.seconds = menu(say("plan.seconds"), SECONDS.map((one) => [String(one), one < 60 ? `${one} s` : `${one / 60} min`]));
    this.seconds.made.value = "5";
    this.cost = menu(say("plan.cost"), COSTS.map((one) => [one, say(`cost.${one || "window"}`)]));
    this.mtbf = menu(say("plan.mtbf"), MTBF_H.map((one) => [String(one), `${one} h`]));
    this.mtbf.made.value = "100";
    this.mtbf.label.hidden = true;
    this.cost.made.addEventListener("change", () => this.showJob());
    this.front = tick(say("plan.front"));
    this.day = tick(say("plan.day"));
    this.busy = element("div", "", "busy");
    this.bar = element("progress");
    this.progress = element("p");
    this.busy.append(this.bar, this.progress, button(say("cancel"), () => this.cancel(), "cancel"));
    this.busy.hidden = true;
    this.failed = element("p", "", "notice is-bad failed");
    this.failed.hidden = true;
    this.shownJob = "";
    this.stale = element("p", say("plan.stale"), "notice");
    this.choices = element("div", "", "choices");
    this.notice = element("div", "", "notice answer");
    this.notice.hidden = true;
    this.routes = element("div", "", "routes");
    this.lines = element("div", "", "lines");
    const options = element("div", "", "options");
    options.append(this.seconds.label, this.cost.label, this.mtbf.label, this.front.label, this.day.label);
    const head = element("div", "", "start");
    head.append(this.start, options);
    place.append(head, this.busy, this.failed, this.stale, this.choices, this.notice, this.routes, this.lines);
    this.shownChoices = "";
    /** @type {string | null} */
    this.opened = null;
    store.on(["job", "workspace"], () => this.showJob());
    store.on(["workspace", "plan"], () => this.showChoices());
    store.on(["loss", "draft", "plan"], () => this.showNotice());
    store.on(["plan", "draft", "vehicle", "network", "loss"], () => this.showRoutes());
    store.on(["selection"], () => this.showMarks());
  }

  async plan() {
    const { workspace, job } = this.store;
    if (!workspace?.site || job?.state === "running") return;
    const answer = await this.store.ask(() => server.plan({
      revision: workspace.revision, seconds: Number(this.seconds.made.value), cost: (!this.isDay && this.cost.made.value) || null, seed: 1,
      mtbf_h: this.isCoverage ? Number(this.mtbf.made.value) : null,
      front: this.front.made.checked && !this.isCoverage, day: this.isDay,
    }));
    if (!answer) return;
    this.store.job = answer.job;
    this.store.changed("job");
  }

  get isDay() {
    return this.store.values.day !== undefined && this.day.made.checked;
  }

  get isCoverage() {
    return this.cost.made.value === "coverage" && !this.isDay;
  }

  cancel() {
    const job = this.store.job;
    if (job) this.store.ask(() => server.cancel(job.id));
  }

  showJob() {
    const { job, workspace } = this.store;
    const isRunning = job?.state === "running";
    this.start.disabled = isRunning || !workspace?.network || workspace.problems.length > 0;
    this.start.title = workspace?.problems.length ? say("plan.wrong-first") : "";
    this.busy.hidden = !isRunning;
    this.showFailure();
    const hasDay = this.store.values.day !== undefined;
    if (hasDay && this.day.label.hidden) this.day.made.checked = true;
    this.day.label.hidden = !hasDay;
    this.front.label.hidden = this.isDay || this.isCoverage;
    this.mtbf.label.hidden = !this.isCoverage;
    if (!isRunning || !job) return;
    this.bar.max = Math.max(job.limit_s, 0.1);
    this.bar.value = Math.min(job.elapsed_s, job.limit_s);
    const parts = [`${figure(job.elapsed_s)} / ${figure(job.limit_s)} s`];
    if (job.better_pct !== null) parts.push(say("job.better", { better: figure(job.better_pct, 1) }));
    if (job.since_s !== null) parts.push(say("job.since", { since: figure(job.since_s) }));
    write(this.progress, parts.join(" · "));
  }

  /** Says why there is no plan until something else is asked for, or changed; who pressed a button further down sees it. */
  showFailure() {
    const { job, workspace } = this.store;
    const key = `${job?.id} ${job?.state}`;
    const isNew = key !== this.shownJob;
    if (isNew) this.revision = workspace?.revision;
    this.shownJob = key;
    const isSaid = job?.state === "failed" && this.revision === workspace?.revision;
    write(this.failed, isSaid ? job.error ?? say("job.failed") : "");
    this.failed.hidden = !isSaid;
    if (isNew && (isSaid || job?.state === "running")) (isSaid ? this.failed : this.busy).scrollIntoView({ block: "nearest" });
  }

  /** @param {PlanSummary} one */
  describe(one) {
    return say("plan.describe", {
      longest: clock(one.longest_s), window: one.window_pct === null ? "–" : `${figure(one.window_pct)} %`, left: one.uncovered,
    });
  }

  showChoices() {
    const plans = this.store.workspace?.plans ?? [];
    const chosen = this.store.workspace?.chosen ?? null;
    this.stale.hidden = !plans.find((one) => one.id === chosen)?.stale;
    const key = JSON.stringify([plans, chosen]);
    if (key === this.shownChoices) return;
    this.shownChoices = key;
    const isNew = (/** @type {PlanSummary} */ one) => !one.stale || one.id === chosen;
    const fresh = plans.filter(isNew);
    const earlier = plans.filter((one) => !isNew(one));
    /** @type {HTMLElement[]} */
    const parts = fresh.length ? [this.cards(fresh, chosen)] : [element("p", say("plan.none"), "soft")];
    if (fresh.filter((one) => one.window_pct !== null).length > 1) {
      const figureOf = element("figure", "", "front");
      figureOf.append(drawFront(fresh, chosen, (id) => this.choose(id), (one) => this.describe(one)), element("figcaption", say("front.axes")));
      parts.push(figureOf);
    }
    if (earlier.length) {
      const more = element("details", "", "more");
      more.append(element("summary", count("plan.earlier", earlier.length)), this.cards(earlier, chosen));
      parts.push(more);
    }
    this.choices.replaceChildren(...parts);
  }

  /**
   * @param {PlanSummary[]} plans
   * @param {string | null} chosen
   */
  cards(plans, chosen) {
    const list = element("div", "", "cards");
    list.setAttribute("role", "radiogroup");
    list.setAttribute("aria-label", say("plan.choose"));
    const cards = plans.map((one) => this.card(one, one.id === chosen));
    // One of them is in the row of Tab; arrows lead to the others.
    const held = Math.max(0, plans.findIndex((one) => one.id === chosen));
    cards.forEach((card, index) => {
      card.tabIndex = index === held ? 0 : -1;
    });
    list.addEventListener("keydown", (event) => {
      const step = { ArrowDown: 1, ArrowRight: 1, ArrowUp: -1, ArrowLeft: -1 }[event.key];
      const here = cards.findIndex((card) => card.matches(":focus"));
      if (!step || here < 0) return;
      event.preventDefault();
      cards[(here + step + cards.length) % cards.length].focus();
    });
    list.append(...cards);
    return list;
  }

  /**
   * @param {PlanSummary} one
   * @param {boolean} isChosen
   */
  card(one, isChosen) {
    const card = button("", () => this.choose(one.id), "card");
    card.setAttribute("role", "radio");
    card.setAttribute("aria-checked", String(isChosen));
    const row = (/** @type {string} */ key, /** @type {string} */ value, name = "") => {
      const line = element("span", "", `fact ${name}`);
      line.append(element("small", say(key)), element("b", value));
      return line;
    };
    card.append(
      row("fact.longest", clock(one.longest_s)),
      one.kind === "day" ? row("fact.finish", timeOfDay(one.finish_s ?? 0)) : row("fact.window", one.window_pct === null ? "–" : `${figure(one.window_pct)} %`),
      row("fact.left", String(one.uncovered), one.uncovered ? "is-bad" : ""),
    );
    if (one.stale) card.append(element("em", say("plan.old")));
    return card;
  }

  /** @param {string} id */
  async choose(id) {
    if (id === this.store.workspace?.chosen) return;
    const next = await this.store.ask(() => server.choose(id));
    if (next) await this.store.take(next);
  }

  /** The vehicle at fault is taken out of the plan, and what the others would fly then is shown. */
  async lose() {
    const { plan, vehicle, timeS } = this.store;
    if (!plan || !vehicle) return;
    const began = performance.now();
    const answer = await this.store.ask(() => server.lose(plan.summary.id, vehicle, timeS));
    if (!answer) return;
    this.store.loss = { ...answer, vehicle, at_s: timeS };
    this.store.changed("loss");
    // What was asked for is seen with the frame after the next one's begin.
    requestAnimationFrame(() => requestAnimationFrame(() => performance.measure("loss", { start: began })));
  }

  /** @param {Change[]} changes */
  async change(changes) {
    const { plan, mayChange } = this.store;
    if (!plan || !mayChange) return;
    // Of two changes of one segment the later one holds.
    const all = new Map(this.store.changes.map((one) => [one.segment, one]));
    for (const one of changes) all.set(one.segment, { ...all.get(one.segment), ...one });
    const wanted = [...all.values()];
    const answer = await this.store.ask(() => server.change(plan.summary.id, wanted, false));
    if (!answer) return;
    this.store.changes = wanted;
    this.store.draft = answer;
    this.store.loss = null;
    this.store.changed("draft", "plan", "loss", "time");
  }

  async keep() {
    const { plan, changes } = this.store;
    if (!plan || !changes.length) return;
    const answer = await this.store.ask(() => server.change(plan.summary.id, changes, true));
    if (!answer) return;
    this.store.dropDraft();
    await this.store.refresh();
  }

  /** @param {string} vehicle */
  give(vehicle) {
    this.change([...this.store.selection].map((segment) => ({ segment, vehicle })));
  }

  turn() {
    const now = new Map((this.store.shown?.vehicles ?? []).flatMap((one) => one.routes.flatMap((route) => route.visits.map((visit) => [visit.segment, visit.reversed]))));
    const changes = [...this.store.selection].filter((one) => now.has(one)).map((segment) => ({ segment, reversed: !now.get(segment) }));
    if (changes.length) this.change(changes);
  }

  showNotice() {
    const { loss, draft } = this.store;
    this.notice.hidden = !loss && !draft;
    if (draft) this.showDraft();
    else if (loss) this.showLoss();
    if (draft || loss) this.notice.scrollIntoView({ block: "nearest" });
  }

  showDraft() {
    const draft = this.store.draft;
    if (!draft) return;
    const { violations, window_was: was, window_is: is } = draft;
    this.notice.className = `notice answer ${violations.length ? "is-bad" : "is-good"}`;
    const before = this.store.plan?.summary;
    const now = draft.plan.summary;
    const facts = element("ul");
    for (const one of violations) facts.append(element("li", one, "wrong"));
    if (!violations.length) facts.append(element("li", say("draft.holds")));
    facts.append(element("li", say("draft.window", { was: was === null ? "–" : figure(was), is: is === null ? "–" : figure(is) })),
      element("li", say("draft.longest", { was: clock(before?.longest_s ?? null), is: clock(now.longest_s) })));
    const actions = element("div", "", "actions");
    const keep = button(say("draft.keep"), () => this.keep(), "primary");
    keep.disabled = violations.length > 0;
    actions.append(keep, button(say("draft.drop"), () => this.store.dropDraft()));
    this.notice.replaceChildren(element("h3", count("draft", this.store.changes.length)), facts, actions);
  }

  showLoss() {
    const loss = this.store.loss;
    if (!loss) return;
    this.notice.className = `notice answer ${loss.complete ? "is-good" : "is-bad"}`;
    const facts = element("ul");
    facts.append(element("li", loss.complete ? count("loss.all", loss.recovered) : count("loss.some", loss.uncovered.length, { recovered: loss.recovered })));
    const names = loss.uncovered.map((one) => this.store.nameOf(one.segment));
    if (names.length) facts.append(element("li", say("loss.left", { names: names.slice(0, 8).join(", ") + (names.length > 8 ? " …" : "") })));
    facts.append(element("li", say("loss.seconds", { seconds: figure(loss.seconds, 2) }), "soft"));
    const actions = element("div", "", "actions");
    actions.append(button(say("loss.close"), () => {
      this.store.loss = null;
      this.store.changed("loss");
    }));
    this.notice.replaceChildren(element("h3", say("loss.title", { vehicle: loss.vehicle, time: this.store.wordOf(loss.at_s) })), facts, actions);
  }

  showRoutes() {
    const { shown, vehicle } = this.store;
    if (!shown) {
      this.routes.replaceChildren();
      this.lines.replaceChildren();
      return;
    }
    const table = element("table");
    const head = element("tr");
    for (const key of ["route.vehicle", "route.segments", "route.time", "route.battery"]) head.append(element("th", say(key)));
    const top = element("thead");
    top.append(head);
    const body = element("tbody");
    this.store.vehicles.forEach((one, index) => {
      body.append(this.row(one, index));
      if (one.name === vehicle && one.routes.length) body.append(this.visits(one));
    });
    table.append(top, body);
    this.routes.replaceChildren(element("h3", say("routes")), table);
    const left = shown.uncovered.map((one) => element("li", `${this.store.nameOf(one.segment)}: ${one.why}`));
    const parts = [];
    if (left.length) {
      const box = element("details", "", "left-over");
      const list = element("ul");
      list.append(...left);
      box.open = left.length < 6;
      box.append(element("summary", count("left-over", left.length)), list);
      parts.push(box);
    }
    const said = element("ul", "", "said");
    // What each one does stands in the table.
    const rest = shown.lines.filter((line) => !shown.vehicles.some((one) => line.startsWith(`${one.name}: `)));
    said.append(...rest.map((one) => element("li", one)));
    this.lines.replaceChildren(...parts, said);
    this.showMarks();
  }

  /**
   * @param {PlannedVehicle} vehicle
   * @param {number} index
   */
  row(vehicle, index) {
    const row = element("tr", "", this.store.vehicle === vehicle.name ? "chosen" : "");
    row.style.setProperty("--hue", hueOf(index));
    const visits = vehicle.routes.reduce((sum, route) => sum + route.visits.length, 0);
    const times = vehicle.routes.reduce((sum, route) => sum + route.duration_s, 0);
    const most = Math.max(0, ...vehicle.routes.map((route) => route.energy_pct));
    const who = button(vehicle.name, () => this.store.chooseVehicle(this.store.vehicle === vehicle.name ? null : vehicle.name), "who");
    who.setAttribute("aria-expanded", String(this.store.vehicle === vehicle.name));
    const gauge = element("span", "", `gauge ${most > vehicle.budget_pct ? "over" : ""}`);
    const level = element("i", "", "level");
    level.style.width = `${Math.min(100, most)}%`;
    const budget = element("i", "", "budget");
    budget.style.left = `${Math.min(100, vehicle.budget_pct)}%`;
    gauge.append(level, budget);
    const energy = element("td", "", "energy");
    energy.append(element("span", say("route.of-budget", { used: figure(most), budget: figure(vehicle.budget_pct) })), gauge);
    const first = element("td");
    first.append(who);
    const sorties = vehicle.routes.length > 1 ? ` (${vehicle.routes.length})` : "";
    row.append(first, element("td", `${visits}${sorties}`), element("td", vehicle.routes.length ? clock(times) : "–"), energy);
    return row;
  }

  /** @param {PlannedVehicle} vehicle */
  visits(vehicle) {
    const row = element("tr", "", "visits");
    const cell = element("td");
    cell.colSpan = 4;
    const list = element("ol");
    for (const route of vehicle.routes) {
      if (vehicle.routes.length > 1) list.append(element("li", say("route.sortie", { number: route.sortie + 1, time: timeOfDay(route.start_s) }), "sortie"));
      route.visits.forEach((visit, index) => {
        list.append(this.visit(visit, index, route.visits.length, vehicle));
      });
    }
    cell.append(list);
    row.append(cell);
    return row;
  }

  /**
   * @param {PlannedVisit} visit
   * @param {number} index
   * @param {number} all
   * @param {PlannedVehicle} vehicle
   */
  visit(visit, index, all, vehicle) {
    const item = element("li");
    item.dataset.segment = String(visit.segment);
    const name = this.store.nameOf(visit.segment);
    const picks = button(`${visit.reversed ? "←" : "→"} ${name}`, () => this.store.select([visit.segment], "toggle"), "pick");
    const time = element("span", clock(visit.from_s - this.store.beginS), "at");
    item.append(picks, time);
    if (this.store.mayChange && !this.store.loss) {
      const actions = element("span", "", "hand");
      const act = (/** @type {string} */ text, /** @type {string} */ key, /** @type {Change} */ change, isIdle = false) => {
        const one = button(text, () => this.change([change]));
        one.setAttribute("aria-label", say(key, { name }));
        one.title = say(key, { name });
        one.disabled = isIdle;
        actions.append(one);
      };
      act("↑", "visit.earlier", { segment: visit.segment, vehicle: vehicle.name, position: index - 1 }, index === 0);
      act("↓", "visit.later", { segment: visit.segment, vehicle: vehicle.name, position: index + 1 }, index === all - 1);
      act("⇄", "visit.turn", { segment: visit.segment, reversed: !visit.reversed });
      item.append(actions);
    }
    return item;
  }

  showMarks() {
    for (const item of this.routes.querySelectorAll("li[data-segment]")) {
      if (item instanceof HTMLElement) item.classList.toggle("chosen", this.store.selection.has(Number(item.dataset.segment)));
    }
  }
}
