// What the page knows: the site as the server has it, the network, the plan that is looked at, what is chosen; and the
// edits on their way to the server, in their order, none lost while it does not answer.
import { persist, Refusal, server, Unanswered } from "./plan-api.js";
import { say } from "./plan-texts.js";
import { momentOf } from "./plan-track.js";
import { clock } from "./words.js";

/** @import { Edit, GroundPlaces, Job, Json, LossAnswer, NetworkDocument, News, Path, PlanDocument, PlannedVehicle, Problem, Schema, Workspace } from "../plan.js" */

/** @typedef {"workspace" | "network" | "ground" | "plan" | "selection" | "time" | "vehicle" | "loss" | "job" | "link" | "draft"} Topic */
/** @typedef {{ edits: Edit[], label: string, way?: "undo" | "redo", done: (isTaken: boolean) => void }} Waiting */

/** @param {Json} one @param {Json} other */
const same = (one, other) => JSON.stringify(one) === JSON.stringify(other);

/**
 * What stands at a path; undefined where nothing does.
 * @param {Json} values
 * @param {Path} path
 */
export const at = (values, path) => path.reduce((/** @type {Json} */ found, key) => found?.[key], values);

/**
 * Whether the item of a list that a path leads through is the same in two versions: then an edit means the same one.
 * @param {Path} path
 * @param {Json} before
 * @param {Json} now
 */
function meansSame(path, before, now) {
  const index = path.findIndex((one) => typeof one === "number");
  return index < 0 || same(at(before, path.slice(0, index + 1)), at(now, path.slice(0, index + 1)));
}

export class Store {
  /** @param {Schema} schema */
  constructor(schema) {
    this.schema = schema;
    /** @type {Workspace | null} */
    this.workspace = null;
    /** @type {NetworkDocument | null} */
    this.network = null;
    /**
     * Of its segments, by their numbers.
     * @type {Map<number, string>}
     */
    this.segmentNames = new Map();
    /** @type {GroundPlaces | null} */
    this.ground = null;
    /** @type {PlanDocument | null} */
    this.plan = null;
    /**
     * A plan as changed by hand, that is not kept yet.
     * @type {import("../plan.js").ChangeAnswer | null}
     */
    this.draft = null;
    /** @type {import("../plan.js").Change[]} */
    this.changes = [];
    /** @type {LossAnswer & { vehicle: string, at_s: number } | null} */
    this.loss = null;
    /** @type {Job | null} */
    this.job = null;
    /** @type {Set<number>} */
    this.selection = new Set();
    /** @type {string | null} */
    this.vehicle = null;
    this.timeS = 0;
    this.tabs = 1;
    this.isHeard = true;
    /** @type {Waiting[]} */
    this.waiting = [];
    this.isSending = false;
    this.isFetching = false;
    this.isAsked = false;
    /** Why the server did not do what it was asked last. */
    this.refusal = "";
    /** @type {[Topic[], () => void][]} */
    this.listeners = [];
    /** @type {(text: string, outcome?: string) => void} */
    this.tell = () => {};
  }

  /**
   * @param {Topic[]} topics
   * @param {() => void} listener
   */
  on(topics, listener) {
    this.listeners.push([topics, listener]);
  }

  /** @param {Topic[]} topics */
  changed(...topics) {
    for (const [wanted, listener] of this.listeners) if (topics.some((one) => wanted.includes(one))) listener();
  }

  get values() {
    return this.workspace?.values ?? {};
  }

  /** @type {Problem[]} */
  get problems() {
    return this.workspace?.problems ?? [];
  }

  /** The plan to show: as changed by hand, if it is. */
  get shown() {
    return this.draft?.plan ?? this.plan;
  }

  get names() {
    return /** @type {string[]} */ ((this.values.vehicle ?? []).map((/** @type {Json} */ one) => one?.name).filter((/** @type {Json} */ one) => typeof one === "string"));
  }

  get isDay() {
    return this.shown?.summary.kind === "day";
  }

  /** Whether the plan can be changed by hand: days are planned as a whole. */
  get mayChange() {
    return this.shown !== null && !this.isDay;
  }

  /** @param {number} segment */
  nameOf(segment) {
    return this.segmentNames.get(segment) ?? `${segment}`;
  }

  async begin() {
    await this.refresh();
  }

  async refresh() {
    this.isAsked = true;
    if (this.isFetching) return;
    this.isFetching = true;
    try {
      while (this.isAsked) {
        this.isAsked = false;
        await this.take(await persist(() => server.workspace(), () => this.heard(false)));
      }
    } finally {
      this.isFetching = false;
    }
  }

  /** @param {boolean} isHeard */
  heard(isHeard) {
    if (isHeard === this.isHeard) return;
    this.isHeard = isHeard;
    this.changed("link");
  }

  /** @param {News} news */
  news(news) {
    this.tabs = news.tabs;
    const ended = this.job?.state === "running" && news.job?.state !== "running";
    this.job = news.job;
    if (news.job?.state === "failed" && ended) this.tell(news.job.error ?? say("job.failed"), "failed");
    this.changed("job");
    const known = this.workspace;
    const isNewer = !known || news.revision > known.revision;
    // What this tab sends comes back as its answer.
    if (this.isSending) return;
    const isOther = known && (
      news.chosen !== known.chosen || news.checked !== known.checked || (news.saved ?? known.saved) !== known.saved ||
      !same(news.plans, known.plans.map((one) => one.id + (one.stale ? "*" : "")))
    );
    if (isNewer && known && !ended) this.tell(say("tabs.changed"));
    if (isNewer || ended || isOther) this.refresh();
  }

  /** @param {Workspace} next */
  async take(next) {
    const before = this.workspace;
    if (before && next.revision < before.revision) return;
    this.heard(true);
    next.problems = next.problems.map((one) => ({ ...one, path: one.path ?? [] }));
    this.workspace = next;
    this.tabs = next.tabs;
    if (next.job || this.job?.state !== "running") this.job = next.job ?? this.job;
    this.changed("workspace", "job");
    const digest = next.network?.digest ?? null;
    const wanted = [];
    const isOther = !before || next.revision !== before.revision || next.checked !== before.checked;
    if (isOther) wanted.push(this.fetchGround());
    if (digest !== (this.network?.digest ?? null)) wanted.push(this.fetchNetwork(digest));
    const summary = (/** @type {Workspace | null} */ of, /** @type {string | null} */ id) => ({ ...of?.plans.find((one) => one.id === id), stale: null });
    if (next.chosen !== (this.plan?.summary.id ?? null) || !same(summary(before, next.chosen), summary(next, next.chosen))) {
      wanted.push(this.fetchPlan(next.chosen));
    }
    await Promise.all(wanted);
  }

  async fetchGround() {
    if (!this.workspace?.site) return;
    try {
      this.ground = await server.ground();
    } catch (error) {
      if (error instanceof Unanswered) this.heard(false);
      this.ground = null;
    }
    this.changed("ground");
  }

  /** @param {string | null} digest */
  async fetchNetwork(digest) {
    const before = this.network?.source;
    try {
      this.network = digest === null ? null : await server.network(digest);
    } catch (error) {
      if (error instanceof Unanswered) this.heard(false);
      else if (error instanceof Refusal) this.tell(error.message, "failed");
      this.network = null;
    }
    this.segmentNames = new Map(this.network?.segments.map((one) => [one.id, one.name]));
    // Of another file the same numbers are other segments.
    const isSame = this.network?.source === before;
    this.selection = new Set([...this.selection].filter((one) => isSame && this.segmentNames.has(one)));
    this.changed("network", "selection");
  }

  /** @param {string | null} id */
  async fetchPlan(id) {
    this.loss = null;
    this.dropDraft();
    try {
      this.plan = id === null ? null : await server.planOf(id);
    } catch (error) {
      if (error instanceof Unanswered) this.heard(false);
      this.plan = null;
    }
    const ends = this.endS;
    if (!this.plan || this.timeS > ends || this.timeS < this.beginS) this.timeS = this.beginS;
    this.changed("plan", "loss", "time");
  }

  /**
   * Who flies what: as planned, and once somebody is lost as the answer to that has it.
   * @type {PlannedVehicle[]}
   */
  get vehicles() {
    const { loss } = this;
    return (this.shown?.vehicles ?? []).map((one) => loss?.routes.find((other) => other.name === one.name && one.name !== loss.vehicle) ?? one);
  }

  /**
   * Where a vehicle is at the time that is looked at; who is lost stays where that was.
   * @param {PlannedVehicle} vehicle
   */
  momentOf(vehicle) {
    const { loss, timeS } = this;
    return momentOf(vehicle, loss?.vehicle === vehicle.name ? Math.min(timeS, loss.at_s) : timeS);
  }

  get beginS() {
    const starts = (this.shown?.vehicles ?? []).flatMap((one) => one.routes.map((route) => route.start_s));
    return starts.length ? Math.min(...starts) : 0;
  }

  get endS() {
    const ends = this.vehicles.flatMap((one) => one.routes.map((route) => route.start_s + route.duration_s));
    return Math.max(this.beginS + 1, ...ends);
  }

  /**
   * A time of the plan in words: from its begin, of days by the clock.
   * @param {number} timeS
   */
  wordOf(timeS) {
    if (!this.isDay && this.beginS < 3600) return `T+${clock(timeS)}`;
    const day = Math.floor(timeS / 86400);
    const time = `${String(Math.floor(timeS / 3600) % 24).padStart(2, "0")}:${String(Math.floor(timeS / 60) % 60).padStart(2, "0")}`;
    return this.endS > 86400 ? say("times.day", { day: day + 1, time }) : time;
  }

  /**
   * Sends edits after those before them; one call is one step of undo. Returns whether the server took them.
   * @param {Edit[]} edits
   * @param {string} label
   * @returns {Promise<boolean>}
   */
  edit(edits, label) {
    return new Promise((done) => {
      this.waiting.push({ edits, label, done });
      this.changed("link");
      this.send();
    });
  }

  async send() {
    if (this.isSending) return;
    this.isSending = true;
    for (;;) {
      const next = this.waiting[0];
      if (!next) break;
      const isTaken = await (next.way ? this.stepOne(next.way) : this.sendOne(next));
      this.waiting.shift();
      this.changed("link");
      next.done(isTaken);
    }
    this.isSending = false;
    // News that came meanwhile was not looked at.
    if (this.workspace && this.workspace.checked < this.workspace.revision) this.refresh();
  }

  /** @param {Waiting} next */
  async sendOne({ edits, label }) {
    let mayHaveCome = false;
    for (let attempt = 0; attempt < 4; attempt += 1) {
      const known = /** @type {Workspace} */ (this.workspace);
      try {
        await this.take(await persist(() => server.edit(known.revision, edits, label), () => {
          mayHaveCome = true;
          this.heard(false);
        }));
        return true;
      } catch (error) {
        if (!(error instanceof Refusal)) throw error;
        const newest = error.newest;
        if (!newest) {
          this.refusal = error.message;
          this.tell(error.message, "failed");
          return false;
        }
        // Only the answer to it was lost.
        const isOurs = mayHaveCome && newest.undo === label && newest.revision === known.revision + 1;
        const isMeant = edits.every((one) => meansSame(one.path, known.values, newest.values));
        await this.take(newest);
        if (isOurs) return true;
        if (!isMeant) {
          this.tell(say("tabs.not-applied", { label }), "failed");
          return false;
        }
        this.tell(say("tabs.first"));
      }
    }
    return false;
  }

  /**
   * Goes a step back, or forward again, after the edits that are on their way.
   * @param {"undo" | "redo"} way
   */
  step(way) {
    return new Promise((done) => {
      this.waiting.push({ edits: [], label: "", way, done });
      this.send();
    });
  }

  /** @param {"undo" | "redo"} way */
  async stepOne(way) {
    const known = this.workspace;
    const label = known?.[way];
    if (!known || !label) return false;
    try {
      await this.take(await persist(() => server[way](known.revision), () => this.heard(false)));
    } catch (error) {
      if (!(error instanceof Refusal)) throw error;
      // Another tab was first: its step is not the one that was meant.
      if (error.newest) await this.take(error.newest);
      this.tell(error.message, "failed");
      return false;
    }
    this.tell(say(`${way}.done`, { label }));
    return true;
  }

  /**
   * Asks the server for something that is not an edit; says what it refuses.
   * @template Answer
   * @param {() => Promise<Answer>} question
   * @returns {Promise<Answer | null>}
   */
  async ask(question) {
    try {
      const answer = await question();
      this.heard(true);
      return answer;
    } catch (error) {
      if (error instanceof Unanswered) {
        this.heard(false);
        this.refusal = say("link.unanswered");
      } else if (error instanceof Refusal) this.refusal = error.message;
      else throw error;
      this.tell(this.refusal, "failed");
      return null;
    }
  }

  /**
   * @param {Iterable<number>} segments
   * @param {"set" | "add" | "toggle"} how
   */
  select(segments, how = "set") {
    const next = how === "set" ? new Set() : new Set(this.selection);
    for (const one of segments) {
      if (how === "toggle" && next.has(one)) next.delete(one);
      else next.add(one);
    }
    this.selection = /** @type {Set<number>} */ (next);
    this.changed("selection");
  }

  /** @param {string | null} name */
  chooseVehicle(name) {
    this.vehicle = name;
    this.changed("vehicle");
  }

  /** @param {number} timeS */
  goTo(timeS) {
    this.timeS = Math.min(this.endS, Math.max(this.beginS, timeS));
    this.changed("time");
  }

  dropDraft() {
    if (!this.draft && !this.changes.length) return;
    this.draft = null;
    this.changes = [];
    this.changed("draft", "plan", "time");
  }
}
