// An operator's wishes: asked once, sent once, and answered by the vehicle itself.
const WORDS = {
  hold: ["Hold", "It stops where it is and waits. Its battery goes on being used."],
  resume: ["Resume", "It goes on with its mission from where it holds."],
  return: ["Bring back", "It comes home and stays on the ground until it is included. The others are given its segments."],
  land: ["Land", "It comes down right where it is. The others are given its segments."],
  exclude: ["Exclude", "It is treated as lost and told to return. The others are given its segments."],
  include: ["Include", "It is given work again: its battery is fresh, and it stands on its pad, clear of people."],
  replan: ["Re-plan now", "Everything that is still to be flown is planned anew."],
  abort: ["Abort all", "Everybody comes home now. What is not inspected stays so."],
};
const DANGER = new Set(["abort", "land", "exclude"]);
const TOLD_MS = 8000;
const byId = (id) => document.getElementById(id);

export const label = (action) => WORDS[action][0];

export class Intents {
  constructor(now) {
    this.now = now;
    this.mine = new Map();
    this.timer = 0;
  }

  ask(action, vehicle) {
    const dialog = byId("ask");
    if (dialog.open) return;
    const [verb, meaning] = WORDS[action];
    const what = vehicle ? `${verb} ${vehicle}` : verb;
    byId("question").textContent = `${what}?`;
    byId("meaning").textContent = meaning;
    const yes = byId("yes");
    yes.textContent = what;
    yes.classList.toggle("danger", DANGER.has(action));
    dialog.returnValue = "no";
    dialog.onclose = () => {
      if (dialog.returnValue === "yes") this.send(action, vehicle, what);
    };
    dialog.showModal();
    yes.focus();
  }

  async send(action, vehicle, what) {
    const id = Array.from(crypto.getRandomValues(new Uint8Array(12)), (byte) => byte.toString(16).padStart(2, "0")).join("");
    const body = JSON.stringify(vehicle ? { id, action, vehicle } : { id, action });
    this.tell(`${what}: asked`, "accepted");
    // The id makes it safe to send again: a wish is taken once.
    for (let attempt = 0; attempt < 3; attempt += 1) {
      try {
        const answer = await fetch("/intents", { method: "POST", headers: { "content-type": "application/json" }, body });
        if (!(answer.headers.get("content-type") ?? "").startsWith("application/json")) {
          this.tell(`${what}: ${await answer.text()}`, "failed");
          return;
        }
        const record = await answer.json();
        this.mine.set(id, { what, outcome: record.outcome });
        this.tell(`${what}: ${record.outcome}, ${record.text}`, record.outcome);
        return;
      } catch {
        await new Promise((resolve) => setTimeout(resolve, 1000));
      }
    }
    this.tell(`${what}: the ground station does not answer`, "failed");
  }

  show(state) {
    for (const record of state.intents) {
      const known = this.mine.get(record.id);
      if (known && known.outcome !== record.outcome) {
        known.outcome = record.outcome;
        this.tell(`${known.what}: ${record.outcome}, ${record.text}`, record.outcome);
      }
    }
  }

  tell(text, outcome) {
    const place = byId("answer");
    place.textContent = text;
    place.className = `shown ${outcome}`;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => place.classList.remove("shown"), TOLD_MS);
  }
}
