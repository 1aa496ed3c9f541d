// Before the take-off: what is asked, and the checklist with what stops the flight first.
import { byId, element, write } from "./elements.js";
import { say, sayCount, translate } from "./translation.js";

/** @import { Check, Question, State } from "../documents.js" */
/** @import { Intents } from "./intents.js" */

/**
 * Severity, mark, and the heading for a number of checks.
 * @typedef {[string, string, (count: number) => string]} Group
 */
/** @type {Group[]} */
const GROUPS = [
  ["stop", "STOP", (count) => sayCount(count, "{count} check stops the flight", "{count} checks stop the flight")],
  ["warning", "warn", (count) => sayCount(count, "{count} warning", "{count} warnings")],
  ["ok", "ok", (count) => say("{count} ok", { count })],
];
/** @type {Record<string, string>} */
const MEANINGS = {
  prepare: "The listed changes are made and the missions uploaded. Nothing moves yet.",
  "take-off": "All vehicles with a route take off now. The pads and their surroundings are clear of people.",
};

export class Briefing {
  /** @param {Intents} intents */
  constructor(intents) {
    this.intents = intents;
    /** @type {Question | null} */
    this.question = null;
    this.shown = "";
    byId("agree").addEventListener("click", () => this.answer());
  }

  answer() {
    if (this.question) this.intents.confirm(this.question.id, translate(this.question.text), say(MEANINGS[this.question.id] ?? ""));
  }

  /** @param {State} state */
  show(state) {
    const before = state.flight_s === null && !state.finished;
    document.body.classList.toggle("before", before);
    byId("briefing").hidden = !before;
    this.question = before ? state.question : null;
    if (!before) return;
    const stops = state.checks.filter((one) => one.severity === "stop").length;
    write(byId("asked"), this.question ? translate(this.question.text) : stops ? say("No question: a check stops the flight") : say("No question yet"));
    byId("agree").hidden = !this.question;
    const key = JSON.stringify([state.checks, this.question]);
    if (key === this.shown) return;
    this.shown = key;
    byId("about").replaceChildren(...(this.question?.lines ?? []).map((line) => element("li", translate(line))));
    byId("checks").replaceChildren(...GROUPS.flatMap((group) => this.group(group, state.checks)));
  }

  /**
   * @param {Group} group
   * @param {Check[]} checks
   */
  group([severity, mark, words], checks) {
    const found = checks.filter((one) => one.severity === severity);
    if (!found.length) return [];
    const part = element("details", "", severity);
    // On a phone what is well takes no room until it is asked for.
    part.open = severity !== "ok" || matchMedia("(min-width: 901px)").matches;
    const list = element("ul");
    for (const one of found) {
      const row = element("li");
      row.append(element("b", say(mark), "mark"), element("span", translate(one.subject), "subject"), element("span", translate(one.text)));
      list.append(row);
    }
    part.append(element("summary", words(found.length)), list);
    return [part];
  }
}
