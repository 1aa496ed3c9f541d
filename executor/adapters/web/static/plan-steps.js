// The steps from a network to a plan, one below the other: each says in a word how far it is.
import { element, write } from "./elements.js";
import { button, startsWith } from "./plan-forms.js";
import { labelOf } from "./plan-schema.js";
import { at } from "./plan-store.js";
import { count, say } from "./plan-texts.js";

/** @import { Path, Problem } from "../plan.js" */
/** @import { Store } from "./plan-store.js" */

/**
 * @typedef {object} Step
 * @property {string} name
 * @property {Path[]} paths tables of the site file that are filled in here
 * @property {() => string} status how far it is, in a word
 * @property {(place: HTMLElement) => void} build
 * @property {() => void} show
 */

/**
 * What may be done at once about something that is wrong.
 * @typedef {object} Remedy
 * @property {(problem: Problem) => boolean} fits
 * @property {() => HTMLElement} make
 */

export class Steps {
  /**
   * @param {Store} store
   * @param {HTMLElement} place
   * @param {Step[]} steps
   * @param {Remedy[]} remedies
   */
  constructor(store, place, steps, remedies) {
    this.store = store;
    this.remedies = remedies;
    /** @type {string[]} */
    this.before = [];
    this.steps = steps.map((step, index) => {
      const box = element("details", "", "step");
      box.id = `step-${step.name}`;
      const head = element("summary");
      const status = element("span", "", "status");
      head.append(element("i", `${index + 1}`, "number"), element("b", say(`step.${step.name}`)), status);
      const body = element("div", "", "body");
      const wrong = element("ul", "", "wrongs");
      body.append(wrong);
      box.append(head, body);
      place.append(box);
      step.build(body);
      // What is not looked at is not kept up to date: a fleet of fifty has hundreds of fields.
      box.addEventListener("toggle", () => {
        if (box.open) step.show();
      });
      return { step, box, status, wrong };
    });
    store.on(["workspace", "network", "ground", "selection", "plan"], () => this.show());
  }

  show() {
    const found = this.store.problems.map((problem) => ({ problem, step: this.find(problem.path)?.step }));
    for (const { step, box, status, wrong } of this.steps) {
      const own = found.filter((one) => one.step === step).map((one) => one.problem);
      box.classList.toggle("is-wrong", own.length > 0);
      write(status, own.length ? count("problems", own.length) : step.status());
      this.showWrong(wrong, own);
      if (box.open) step.show();
    }
    this.goOn();
  }

  /**
   * @param {HTMLElement} place
   * @param {Problem[]} problems
   */
  showWrong(place, problems) {
    const key = JSON.stringify(problems);
    if (place.dataset.shown === key) return;
    place.dataset.shown = key;
    place.replaceChildren(...problems.map((one) => {
      const item = element("li");
      const remedies = element("div", "", "actions");
      remedies.append(...this.remedies.filter((remedy) => remedy.fits(one)).map((remedy) => remedy.make()));
      item.append(button(this.describe(one), () => this.goToProblem(one), "wrong"), remedies);
      return item;
    }));
  }

  /**
   * What is wrong, with the field that it is about.
   * @param {Problem} problem
   */
  describe({ path, message }) {
    const index = path.findIndex((one) => typeof one === "number");
    const item = index > 0 ? at(this.store.values, path.slice(0, index + 1))?.name : undefined;
    const key = path.length > 1 && typeof path.at(-1) === "string" ? labelOf(path) : "";
    const where = [item, key].filter(Boolean).join(", ");
    return where && !message.startsWith("/") ? `${where}: ${message}` : message;
  }

  /** Opens what is wrong next, once all that was wrong before is mended. */
  goOn() {
    const { workspace, problems } = this.store;
    if (workspace?.checked !== workspace?.revision) return;
    const now = problems.map((one) => one.message);
    const isMended = this.before.length > 0 && !this.before.some((one) => now.includes(one));
    this.before = now;
    const next = isMended && problems.length ? this.find(problems[0].path) : undefined;
    if (next && !next.box.open) this.open(next.step.name);
  }

  /**
   * The step that a path of the site file belongs to.
   * @param {Path} path
   */
  find(path) {
    const is = (/** @type {(one: Path) => boolean} */ fits) => this.steps.find(({ step }) => step.paths.some(fits));
    return is((one) => startsWith(path, one)) ?? (path.length ? is((one) => startsWith(one, path)) : undefined);
  }

  /** @param {string} name */
  open(name) {
    const found = this.steps.find(({ step }) => step.name === name);
    if (!found) return;
    found.box.open = true;
    found.step.show();
    found.box.scrollIntoView({ block: "start" });
  }

  /**
   * Opens what is wrong where it is mended: by a button in its step, if it has one, else in its field.
   * @param {Problem} problem
   */
  goToProblem(problem) {
    const step = this.find(problem.path)?.step;
    if (step && this.remedies.some((one) => one.fits(problem))) this.open(step.name);
    else this.goTo(problem.path);
  }

  /**
   * Opens the field that a path of the site file leads to.
   * @param {Path} path
   */
  goTo(path) {
    const found = this.find(path);
    if (!found) return;
    this.open(found.step.name);
    for (let length = path.length; length > 0; length -= 1) {
      const place = found.box.querySelector(`[data-path="${CSS.escape(path.slice(0, length).join("."))}"]`);
      if (!(place instanceof HTMLElement)) continue;
      for (let outer = place.parentElement; outer && outer !== found.box; outer = outer.parentElement) {
        if (outer instanceof HTMLDetailsElement) outer.open = true;
      }
      if (place instanceof HTMLDetailsElement) place.open = true;
      const input = place.querySelector("input, select, textarea");
      place.scrollIntoView({ block: "center" });
      if (input instanceof HTMLElement) input.focus();
      return;
    }
  }
}
