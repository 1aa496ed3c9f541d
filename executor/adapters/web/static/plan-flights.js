// What comes after the plan: its checklist, the flight's own page, and what flights before left over.
import { element, write } from "./elements.js";
import { server } from "./plan-api.js";
import { button } from "./plan-forms.js";
import { count, say } from "./plan-texts.js";
import { translate } from "./translation.js";

/** @import { Checklist, FlightEntry } from "../plan.js" */
/** @import { Store } from "./plan-store.js" */

const ORDER = ["stop", "warning", "ok"];
/** @type {Record<string, string>} */
const MARKS = { stop: "fly.stop", warning: "fly.warning", ok: "fly.ok" };

export class Flights {
  /**
   * @param {Store} store
   * @param {HTMLElement} place
   * @param {(heading: string, meaning: string, yes: string, done: () => void) => void} ask
   */
  constructor(store, place, ask) {
    this.store = store;
    this.ask = ask;
    this.fly = button(say("fly"), () => this.begin(), "primary");
    this.fly.id = "fly";
    this.dry = button(say("fly.check"), () => this.check());
    this.dry.id = "checklist";
    const actions = element("div", "", "actions");
    actions.append(this.fly, this.dry);
    this.notice = element("div", "", "notice");
    this.notice.hidden = true;
    this.notice.setAttribute("role", "status");
    this.runs = element("ul", "", "runs");
    const box = element("div", "", "flying");
    this.rehearsal = element("p", "", "soft");
    box.append(element("h3", say("flying")), element("p", say("fly.how"), "soft"), actions, this.notice, this.rehearsal, this.runs);
    place.append(box);
    this.shown = "";
    this.isBusy = false;
    store.on(["plan", "draft", "workspace", "job"], () => this.show());
  }

  show() {
    const { plan, draft, workspace } = this.store;
    const isStale = workspace?.plans.find((one) => one.id === workspace.chosen)?.stale ?? false;
    this.fly.disabled = this.dry.disabled = this.isBusy || !plan || draft !== null || isStale;
    write(this.rehearsal, workspace?.site ? say("fly.rehearse", { command: `faultline simulate ${workspace.site.path}` }) : "");
    this.fly.title = isStale ? say("plan.stale") : "";
    const key = `${workspace?.site?.path} ${this.store.job?.state}`;
    if (key === this.shown || !workspace?.site) return;
    this.shown = key;
    this.showRuns();
  }

  /** @param {string} text */
  tell(text, name = "") {
    this.notice.hidden = !text;
    this.notice.className = `notice ${name}`;
    write(this.notice, text);
    this.notice.scrollIntoView({ block: "nearest" });
  }

  /**
   * Asks for something that takes its time: meanwhile nothing else is begun, which would want the same vehicles.
   * @template Answer
   * @param {string} words
   * @param {() => Promise<Answer>} question
   */
  async wait(words, question) {
    this.isBusy = true;
    this.show();
    this.tell(words, "is-waiting");
    const answer = await this.store.ask(question);
    this.isBusy = false;
    this.show();
    if (!answer) this.tell(this.store.refusal, "is-bad");
    return answer;
  }

  begin() {
    const { plan } = this.store;
    if (!plan) return;
    this.ask(say("fly.ask"), say("fly.meaning"), say("fly"), async () => {
      const answer = await this.wait(say("fly.begins"), () => server.fly(plan.summary.id));
      if (!answer) return;
      this.tell(`${say("fly.begun")} `, "is-good");
      const link = element("a", say("fly.page"));
      link.href = answer.url;
      this.notice.append(link);
      location.assign(answer.url);
    });
  }

  async check() {
    const { plan } = this.store;
    if (!plan) return;
    const answer = await this.wait(say("fly.checks"), () => server.check(plan.summary.id));
    if (answer) this.showChecks(answer);
  }

  /** @param {Checklist} found */
  showChecks({ ready, checks }) {
    this.tell("", ready ? "is-good" : "is-bad");
    this.notice.hidden = false;
    const list = element("ul", "", "checks");
    for (const one of [...checks].sort((a, b) => ORDER.indexOf(a.severity) - ORDER.indexOf(b.severity))) {
      const row = element("li", "", one.severity);
      row.append(element("b", say(MARKS[one.severity])), ` ${translate(one.subject)}: ${translate(one.text)}`);
      list.append(row);
    }
    this.notice.replaceChildren(element("b", say(ready ? "fly.ready" : "fly.not-ready")), list);
    this.notice.scrollIntoView({ block: "nearest" });
  }

  async showRuns() {
    /** @type {FlightEntry[]} */
    let runs;
    try {
      runs = await server.flights();
    } catch {
      // The list is asked for again with the next plan.
      return;
    }
    this.runs.replaceChildren(...runs.map((one) => this.run(one)));
  }

  /** @param {FlightEntry} one */
  run(one) {
    const item = element("li");
    item.append(element("b", one.run));
    const { report } = one;
    if (one.running) item.append(element("span", say("runs.running")));
    if (report) item.append(element("span", say("runs.inspected", { inspected: report.inspected, total: report.total })));
    if (one.has_report) {
      const link = element("a", say("runs.report"));
      link.href = `/api/report?run=${encodeURIComponent(one.run)}`;
      link.target = "_blank";
      item.append(link);
    }
    if (report?.uncovered.length) {
      item.append(button(count("runs.left", report.uncovered.length), async () => {
        const answer = await this.store.ask(() => server.left(one.run));
        if (!answer) return;
        this.store.job = answer.job;
        this.store.changed("job");
      }));
    }
    return item;
  }
}
