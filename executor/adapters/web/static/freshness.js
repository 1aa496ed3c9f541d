// How old what is shown is, by the flight's own clock: a link that is slow looks like a flight that stands still.
/** @import { State } from "../documents.js" */
import { say } from "./translation.js";
import { age, since } from "./words.js";

/**
 * What is wrong with what is shown; whether it is old, and whether that is because the flight is over.
 * @typedef {{ text: string, old?: boolean, over?: boolean }} Trouble
 */

export const STALE_S = 3;
const ASK_MS = 2000;
const ANSWER_MS = 15000;

export class Freshness {
  constructor() {
    this.speedup = 1;
    /** @type {number | null} */
    this.shownS = null;
    // The flight's clock less this browser's; what has arrived by now says that it is at least so much.
    this.ahead = -Infinity;
    /** @type {number | null} */
    this.askedMs = null;
    this.tripS = 0;
    this.failed = false;
    this.ask();
  }

  /**
   * A state has come.
   * @param {State} state
   */
  shows(state, atMs = performance.now()) {
    this.speedup = state.speedup ?? 1;
    this.shownS = state.now_s;
    this.ahead = Math.max(this.ahead, state.now_s - this.scaled(atMs));
  }

  /**
   * The flight's clock was asked for by itself, beside the stream of states.
   * @param {number} nowS
   * @param {number} sentMs
   * @param {number} gotMs
   */
  answered(nowS, sentMs, gotMs) {
    this.tripS = (gotMs - sentMs) / 1000;
    this.ahead = Math.min(Math.max(this.ahead, nowS - this.scaled(gotMs)), nowS - this.scaled(sentMs));
  }

  /** @param {number} ms */
  scaled(ms) {
    return (ms / 1000) * this.speedup;
  }

  // Seconds of the flight that have passed since what is shown.
  ageS(atMs = performance.now()) {
    return this.shownS === null ? 0 : Math.max(0, this.ahead + this.scaled(atMs) - this.shownS);
  }

  // How long the question for the clock is, or was, under way.
  waitS(atMs = performance.now()) {
    return this.askedMs === null ? this.tripS : Math.max(this.tripS, (atMs - this.askedMs) / 1000);
  }

  /**
   * What is wrong with what is shown, if anything is; ages are in the flight's own time.
   * @param {State | null} state
   * @param {number} openedAt
   * @returns {Trouble | null}
   */
  findTrouble(state, openedAt, nowMs = performance.now()) {
    if (state === null) {
      return nowMs - openedAt > 1000 * STALE_S ? { text: say("The ground station does not answer"), old: true } : null;
    }
    const behindS = this.ageS(nowMs);
    if (behindS > STALE_S * this.speedup) {
      if (state.finished) return { text: say("The flight is over; this page shows its end"), over: true };
      const who = this.failed ? say("The ground station does not answer") : say("The link to this page is behind");
      const old = age(behindS);
      const what = state.flight_s === null ? say("{who}: this is {old} old", { who, old })
        : say("{who}: this is {shown}, {old} old; the flight is at {now}", { who, old, shown: since(state.flight_s), now: since(state.flight_s + behindS) });
      return { text: what, old: true };
    }
    if (this.waitS(nowMs) > STALE_S) {
      return { text: say("The link to this page is slow: an answer takes {time}", { time: age(this.waitS(nowMs)) }) };
    }
    const flies = state.flight_s !== null && !state.finished;
    if (flies && state.decided_age_s !== null && state.decided_age_s > STALE_S * this.speedup) {
      return {
        text: say("The ground station is behind: no decision for {time}", { time: age(state.decided_age_s) }),
        old: true,
      };
    }
    return state.all_silent ? { text: say("All links lost at once: check the radio first") } : null;
  }

  async ask() {
    const sentMs = performance.now();
    this.askedMs = sentMs;
    try {
      const answer = await fetch("/clock", { signal: AbortSignal.timeout(ANSWER_MS) });
      const content = await answer.json();
      this.answered(content.now_s, sentMs, performance.now());
      this.failed = false;
    } catch {
      this.failed = true;
    } finally {
      this.askedMs = null;
      setTimeout(() => this.ask(), ASK_MS);
    }
  }
}
