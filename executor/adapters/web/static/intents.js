// An operator's wishes: asked back once, or twice where the flight has a question of its own; sent once; and answered
// by the vehicle itself.
import { byId, find } from "./elements.js";
import { say, translate } from "./translation.js";

/** @import { IntentView, State } from "../documents.js" */

/**
 * What is asked for; `what` names it to the operator.
 * @typedef {object} Wish
 * @property {string} action
 * @property {string | null} vehicle
 * @property {string} what
 * @property {boolean} confirmed
 * @property {string} [base]
 * @property {string} [pack]
 * @property {number} [charged]
 * @property {number[]} [assets]
 */
/** @typedef {{ heading: string, meaning: string, button: string, again?: boolean }} Asked */
/** @typedef {IntentView & { confirmed: boolean }} Answer */

/** @type {Record<string, [string, string]>} */
const WORDS = {
  hold: ["Hold", "It stops where it is and waits. It keeps using its battery."],
  resume: ["Resume", "It continues its mission from where it holds."],
  return: ["Bring back", "RTL; stays on the ground until included. Its segments are reassigned."],
  land: ["Land", "It lands exactly where it is. Its segments are reassigned."],
  exclude: ["Exclude", "It is taken out of the plan; RTL if it flies. Its segments are reassigned."],
  include: ["Include", "It takes off once there is work for it. Its pad is clear of people, and its battery is sufficient."],
  swap: ["Pack changed", "Its checks run; it takes off on its next sortie once they pass: its pad is clear of people."],
  disarm: ["Disarm", "Its motors are stopped. Only for a vehicle that is down: in the air it would fall."],
  close: ["Close base", "No vehicle takes off from it until it is opened. Vehicles in the air still land there. Their later sorties are open for others."],
  open: ["Open base", "Its vehicles may take off again, each once its pack is confirmed."],
  count: ["Count packs at", "How many charged packs are at the base now? Packs that are still charging are added when they are ready."],
  replan: ["Re-plan now", "All open segments are re-planned."],
  prove: ["Re-fly inferred", "Segments that were only inferred are flown again, for proof by positions."],
  abort: ["Abort all", "All vehicles return now. Open segments are left over."],
  prepare: ["Prepare", ""],
  "take-off": ["Take off", ""],
};
const BACK = "Its pilot has set mission mode again: it continues in the plan, supervised from here.";
const AGAIN = "It is open again: its pictures so far do not count, and it is planned like every open segment.";
const HANDS = "It is with its pilot.";
const DANGER = new Set(["abort", "land", "exclude", "disarm", "take-off"]);
const TOLD_MS = 8000;

/** @param {string} action */
export const label = (action) => say(WORDS[action]?.[0] ?? action);

export class Intents {
  /** @param {() => State | null} now */
  constructor(now) {
    this.now = now;
    /** @type {Map<string, { what: string, outcome: string }>} */
    this.mine = new Map();
    this.timer = 0;
  }

  /**
   * @param {string} action
   * @param {string | null} vehicle
   */
  ask(action, vehicle) {
    const what = vehicle ? `${label(action)} ${vehicle}` : label(action);
    this.open({ heading: `${what}?`, meaning: this.meaning(action, vehicle), button: what }, { action, vehicle, what, confirmed: false });
  }

  /**
   * @param {string} action
   * @param {string} base
   */
  askBase(action, base) {
    const what = `${label(action)} ${base}`;
    this.open({ heading: `${what}?`, meaning: say(WORDS[action][1]), button: what }, { action, vehicle: null, base, what, confirmed: false });
  }

  /**
   * @param {number} segment
   * @param {string} name
   */
  lookAgain(segment, name) {
    const what = say("Look again at {name}", { name });
    this.open({ heading: `${what}?`, meaning: say(AGAIN), button: say("Look again") }, {
      action: "prove", vehicle: null, what, confirmed: false, assets: [segment],
    });
  }

  /**
   * The answer to what the flight itself asks.
   * @param {string} action
   * @param {string} heading
   * @param {string} meaning
   */
  confirm(action, heading, meaning) {
    this.open({ heading, meaning, button: say("Yes") }, { action, vehicle: null, what: label(action), confirmed: false });
  }

  /**
   * @param {string} action
   * @param {string | null} vehicle
   */
  meaning(action, vehicle) {
    const taken = this.now()?.vehicles.find((one) => one.name === vehicle)?.taken;
    if (!taken) return say(WORDS[action][1]);
    return action === "include" ? say(BACK) : `${say(HANDS)} ${say(WORDS[action][1])}`;
  }

  /**
   * @param {Asked} asked
   * @param {Wish} wish
   */
  open({ heading, meaning, button, again = false }, wish) {
    const dialog = byId("ask", HTMLDialogElement);
    if (dialog.open) return false;
    byId("question").textContent = heading;
    byId("meaning").textContent = meaning;
    const yes = byId("yes");
    yes.textContent = button;
    yes.classList.toggle("danger", again || DANGER.has(wish.action));
    dialog.classList.toggle("again", again);
    const packed = wish.action === "swap" && !again;
    byId("packed").hidden = !packed;
    const pack = byId("pack", HTMLInputElement);
    if (packed) pack.value = "";
    // Not when it is closed: that event comes later, and may find another question in the dialog.
    const counted = wish.action === "count";
    byId("counted").hidden = !counted;
    const charged = byId("charged", HTMLInputElement);
    charged.required = counted;
    charged.disabled = !counted;
    charged.value = "";
    find(dialog, "form", HTMLFormElement).onsubmit = (event) => {
      if (event.submitter !== yes) return;
      this.send(packed ? { ...wish, pack: pack.value.trim() } : counted ? { ...wish, charged: charged.valueAsNumber } : wish);
    };
    dialog.showModal();
    // A second question is read before it is answered: Enter alone means no.
    (again ? byId("no") : counted ? charged : yes).focus();
    return true;
  }

  /** @param {Wish} asked */
  async send(asked) {
    const { action, vehicle, base, what, confirmed, pack, charged, assets } = asked;
    const id = Array.from(crypto.getRandomValues(new Uint8Array(12)), (byte) => byte.toString(16).padStart(2, "0")).join("");
    /** @type {Partial<Wish> & { id: string }} */
    const wish = { id, action };
    if (vehicle) wish.vehicle = vehicle;
    if (base) wish.base = base;
    if (confirmed) wish.confirmed = true;
    if (pack) wish.pack = pack;
    if (charged !== undefined) wish.charged = charged;
    if (assets) wish.assets = assets;
    const body = JSON.stringify(wish);
    this.tell(`${what}: ${say("asked")}`, "accepted");
    // The id makes it safe to send again: a wish is taken once.
    for (let attempt = 0; attempt < 3; attempt += 1) {
      try {
        const answer = await fetch("/intents", { method: "POST", headers: { "content-type": "application/json" }, body });
        if (!(answer.headers.get("content-type") ?? "").startsWith("application/json")) {
          this.tell(`${what}: ${translate(await answer.text())}`, "failed");
          return;
        }
        this.answered(await answer.json(), { ...asked, confirmed: true });
        return;
      } catch {
        await new Promise((resolve) => setTimeout(resolve, 1000));
      }
    }
    this.tell(`${what}: ${say("the ground station does not answer")}`, "failed");
  }

  /**
   * @param {Answer} record
   * @param {Wish} next
   */
  answered(record, next) {
    if (record.outcome === "refused" && record.question && !record.confirmed) {
      const asked = { heading: `${next.what}: ${say("really?")}`, meaning: translate(record.question), button: say("Yes, {what}", { what: next.what }), again: true };
      this.tell(`${next.what}: ${say("not done yet")}`, "accepted");
      if (this.open(asked, next)) return;
    }
    this.mine.set(record.id, { what: next.what, outcome: record.outcome });
    this.tell(`${next.what}: ${translate(record.outcome)}, ${translate(record.text || record.question)}`, record.outcome);
  }

  /** @param {State} state */
  show(state) {
    for (const record of state.intents) {
      const known = this.mine.get(record.id);
      if (known && known.outcome !== record.outcome) {
        known.outcome = record.outcome;
        this.tell(`${known.what}: ${translate(record.outcome)}, ${translate(record.text)}`, record.outcome);
      }
    }
  }

  /**
   * @param {string} text
   * @param {string} outcome
   */
  tell(text, outcome) {
    const place = byId("answer");
    place.textContent = text;
    place.className = `shown ${outcome}`;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => place.classList.remove("shown"), TOLD_MS);
  }
}
