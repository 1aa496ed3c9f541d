// Fields made from the schema of the site file: each with its unit, its default and its meaning beside it, and what is
// wrong said at it. A field is saved when it is left, or with Enter.
import { element, write } from "./elements.js";
import { server } from "./plan-api.js";
import { formatValue, isGiven, kindOf, labelOf, meaningOf, parseValue, resolve, unitOf } from "./plan-schema.js";
import { at } from "./plan-store.js";
import { say } from "./plan-texts.js";
import { language } from "./translation.js";

/** @import { Edit, Json, Path, Problem, Schema } from "../plan.js" */
/** @import { Store } from "./plan-store.js" */
/** @import { Kind } from "./plan-schema.js" */

let fields = 0;
/** Keys that name a file: one can be sent to stand beside the site file. */
const FILES = new Set(["file", "files", "background", "packs", "key_file", "ca_file", "cert_file"]);

/** @param {Path} path @param {Path} start */
export const startsWith = (path, start) => start.every((one, index) => path[index] === one);

/**
 * A button that says what it does.
 * @param {string} text
 * @param {() => void} act
 */
export function button(text, act, name = "") {
  const made = element("button", text, name);
  made.type = "button";
  made.addEventListener("click", act);
  return made;
}

/**
 * A button that sends a file to stand beside the site file.
 * @param {Store} store
 * @param {(name: string) => void} sent
 */
export function fileButton(store, sent, text = "…") {
  const input = element("input", "", "unseen");
  input.type = "file";
  input.tabIndex = -1;
  input.setAttribute("aria-hidden", "true");
  input.addEventListener("change", async () => {
    const file = input.files?.[0];
    input.value = "";
    const next = file ? await store.ask(() => server.upload(file, "file")) : null;
    if (!file || !next) return;
    await store.take(next);
    sent(next.uploaded ?? file.name);
  });
  const made = button(text, () => input.click(), "file");
  made.setAttribute("aria-label", say("drop.choose"));
  const both = element("span", "", "chooses");
  both.append(made, input);
  return both;
}

/**
 * What is wrong at a path, or below it.
 * @param {Problem[]} problems
 * @param {Path} path
 */
export const wrongAt = (problems, path) => problems.filter((one) => startsWith(one.path, path)).map((one) => one.message).join("; ");

/**
 * The edit that makes a value stand at a path.
 * @param {Path} path
 * @param {Json} value
 * @returns {Edit}
 */
export const setOrUnset = (path, value) => (value === undefined ? { op: "unset", path } : { op: "set", path, value });

export class Field {
  /**
   * @param {Store} store
   * @param {Path} path
   * @param {Schema} part
   * @param {{ isRequired?: boolean, choices?: () => [string, string][] }} [options]
   */
  constructor(store, path, part, { isRequired = false, choices } = {}) {
    const { schema } = resolve(part, store.schema);
    this.store = store;
    this.path = path;
    this.schema = schema;
    /** @type {Kind} */
    this.kind = choices ? "choice" : kindOf(schema, store.schema);
    this.choices = choices;
    this.isRequired = isRequired;
    fields += 1;
    const id = `field-${fields}`;
    this.element = element("div", "", `field is-${this.kind}`);
    this.element.dataset.path = path.join(".");
    const label = element("label", labelOf(path));
    label.htmlFor = id;
    this.input = this.makeInput(id);
    this.unit = element("span", unitOf(String(path.at(-1)), schema), "unit");
    const line = element("div", "", "entry");
    line.append(this.input, this.unit);
    if (this.kind !== "choice" && FILES.has(String(path.at(-1)))) line.append(fileButton(store, (name) => this.store.edit([{ op: "set", path, value: name }], say("edit.set", { key: labelOf(path) }))));
    this.meaning = element("p", "", "meaning");
    this.meaning.id = `${id}-meaning`;
    this.wrong = element("p", "", "wrong");
    this.wrong.id = `${id}-wrong`;
    this.wrong.hidden = true;
    this.input.setAttribute("aria-describedby", `${id}-wrong ${id}-meaning`);
    this.element.append(label, line, this.wrong, this.meaning);
    this.describe();
  }

  /** @param {string} id */
  makeInput(id) {
    const made = this.kind === "choice" ? element("select") : this.schema.type === "string" && (this.schema.maxLength ?? 0) > 300
      ? element("textarea") : element("input");
    made.id = id;
    if (made instanceof HTMLInputElement) {
      made.type = this.kind === "boolean" ? "checkbox" : "text";
      made.autocomplete = "off";
      made.spellcheck = false;
      if (this.kind === "number" || this.kind === "integer") made.inputMode = "decimal";
    }
    made.addEventListener("change", () => this.save());
    return made;
  }

  /** What holds without the key, in words. */
  get fallback() {
    const held = this.schema.default;
    if (!isGiven(held)) return "";
    if (this.kind === "boolean") return say(held ? "yes" : "no");
    return formatValue(held);
  }

  describe() {
    const meaning = meaningOf(this.path, this.schema);
    const unit = this.unit.textContent ? ` ${this.unit.textContent}` : "";
    const fallback = this.fallback ? say("default", { value: `${this.fallback}${this.kind === "numbers" || this.kind === "number" || this.kind === "integer" ? unit : ""}` }) : "";
    this.meaning.replaceChildren(element("span", meaning));
    if (fallback) this.meaning.append(element("span", ` ${fallback}`, "fallback"));
    if (this.input instanceof HTMLInputElement && this.kind !== "boolean") this.input.placeholder = this.fallback;
  }

  async save() {
    const before = at(this.store.values, this.path);
    /** @type {Json} */
    let value;
    if (this.kind === "boolean" && this.input instanceof HTMLInputElement) value = this.input.checked;
    else if (this.kind === "choice") value = this.input.value === "" ? undefined : this.typed(this.input.value);
    else value = parseValue(this.input.value, this.kind);
    if (Array.isArray(value) && value.length === 1 && this.schema.anyOf) value = value[0];
    if (JSON.stringify(value) === JSON.stringify(before)) return;
    const isTaken = await this.store.edit([setOrUnset(this.path, value)], say("edit.set", { key: labelOf(this.path) }));
    // What was typed stays there, with the reason why it is not in the file.
    if (!isTaken) this.tellWrong(this.store.refusal);
  }

  /** @param {string} text */
  tellWrong(text) {
    write(this.wrong, text);
    this.wrong.hidden = !text;
    this.input.setAttribute("aria-invalid", String(Boolean(text)));
  }

  /** @param {string} text */
  typed(text) {
    return this.schema.enum?.find((one) => String(one) === text) ?? text;
  }

  showChoices() {
    if (!(this.input instanceof HTMLSelectElement)) return;
    /** @type {[string, string][]} */
    const known = this.choices?.() ?? (this.schema.enum ?? []).map((one) => [String(one), String(one)]);
    const value = at(this.store.values, this.path);
    /** @type {[string, string][]} */
    const without = this.isRequired && isGiven(value) ? [] : [["", this.fallback ? say("choice.default", { value: this.fallback }) : say("choice.none")]];
    const strange = isGiven(value) && !known.some(([one]) => one === String(value)) ? [[String(value), String(value)]] : [];
    const wanted = JSON.stringify([...without, ...known, ...strange]);
    if (this.input.dataset.shown === wanted) return;
    this.input.dataset.shown = wanted;
    this.input.replaceChildren(...[...without, ...known, ...strange].map(([one, text]) => {
      const option = element("option", text);
      option.value = one;
      return option;
    }));
  }

  show() {
    this.showChoices();
    const value = at(this.store.values, this.path);
    const isHeld = document.activeElement === this.input && this.kind !== "boolean" && this.kind !== "choice";
    if (this.kind === "boolean" && this.input instanceof HTMLInputElement) this.input.checked = isGiven(value) ? value === true : this.schema.default === true;
    else if (!isHeld || this.input.dataset.saved === this.input.value) this.input.value = formatValue(value);
    this.input.dataset.saved = this.input.value;
    this.element.classList.toggle("given", isGiven(value));
    this.tellWrong(wrongAt(this.store.problems, this.path));
  }
}

/**
 * A table of the site file as fields: those that are asked for first, the others behind "more".
 */
export class TableForm {
  /**
   * @param {Store} store
   * @param {Path} path
   * @param {Schema} part
   * @param {{ first?: string[], without?: string[], choices?: Record<string, () => [string, string][]> }} [options]
   */
  constructor(store, path, part, { first, without = [], choices = {} } = {}) {
    const { schema } = resolve(part, store.schema);
    this.store = store;
    this.path = path;
    this.element = element("div", "", "form");
    this.wrong = element("p", "", "wrong");
    this.wrong.hidden = true;
    this.element.append(this.wrong);
    /** @type {(Field | TableList | TableForm)[]} */
    this.parts = [];
    const keys = Object.keys(schema.properties ?? {}).filter((one) => !without.includes(one));
    const early = (first ?? keys).filter((one) => keys.includes(one));
    const late = keys.filter((one) => !early.includes(one));
    for (const key of early) this.add(this.element, key, schema, choices);
    if (late.length) {
      const more = element("details", "", "more");
      more.append(element("summary", say("more")));
      for (const key of late) this.add(more, key, schema, choices);
      this.element.append(more);
    }
  }

  /**
   * @param {HTMLElement} place
   * @param {string} key
   * @param {Schema} schema
   * @param {Record<string, () => [string, string][]>} choices
   */
  add(place, key, schema, choices) {
    const part = /** @type {Schema} */ (schema.properties?.[key]);
    const own = resolve(part, this.store.schema).schema;
    const path = [...this.path, key];
    const kind = kindOf(own, this.store.schema);
    const made = kind === "tables" ? new TableList(this.store, path, part)
      : kind === "other" ? (own.type === "object" ? new TableForm(this.store, path, part) : null)
        : new Field(this.store, path, part, { isRequired: schema.required?.includes(key), choices: choices[key] });
    if (!made) return;
    this.parts.push(made);
    place.append(made.element);
  }

  show() {
    for (const part of this.parts) part.show();
    // What is wrong with the table as a whole, or with a key that has no field here.
    const own = this.store.problems.filter((one) => startsWith(one.path, this.path)
      && !this.parts.some((part) => startsWith(one.path, part.path)));
    write(this.wrong, own.map((one) => one.message).join("; "));
    this.wrong.hidden = !own.length;
  }
}

/** Tables of one kind, such as cameras: as many as there are, each can be removed, and one more added. */
export class TableList {
  /**
   * @param {Store} store
   * @param {Path} path
   * @param {Schema} part
   * @param {{ first?: string[], without?: string[], choices?: Record<string, () => [string, string][]>, add?: () => Json, title?: (value: Json, index: number) => string, note?: (value: Json) => string, extras?: (index: number) => HTMLElement[], word?: string, isAdded?: boolean }} [options]
   */
  constructor(store, path, part, options = {}) {
    this.store = store;
    this.path = path;
    this.options = options;
    this.item = /** @type {Schema} */ (resolve(part, store.schema).schema.items);
    this.element = element("div", "", "tables");
    this.element.dataset.path = path.join(".");
    this.rows = element("div", "", "rows");
    this.element.append(this.rows);
    if (options.isAdded !== false) {
      const what = this.word;
      this.element.append(button(say("list.add", { what }), () => this.addOne(), "add"));
    }
    /** @type {{ form: TableForm, title: HTMLElement, note: HTMLElement, box: HTMLDetailsElement }[]} */
    this.forms = [];
  }

  /** What one of them is called. */
  get word() {
    const label = labelOf(this.path);
    return this.options.word ?? (language === "en" ? label.toLowerCase() : label);
  }

  get items() {
    const found = at(this.store.values, this.path);
    return Array.isArray(found) ? found : [];
  }

  async addOne() {
    const what = this.word;
    const index = this.items.length;
    const isTaken = await this.store.edit([{ op: "add", path: this.path, value: this.options.add?.() ?? {}, at: null }], say("edit.add", { what }));
    if (!isTaken) return;
    this.open(index);
  }

  /** @param {number} index */
  open(index) {
    const box = this.forms[index]?.box;
    if (!box) return;
    box.open = true;
    box.querySelector("input, select")?.scrollIntoView({ block: "nearest" });
  }

  /** @param {number} index */
  titleOf(index) {
    const value = this.items[index];
    return this.options.title?.(value, index) ?? (typeof value?.name === "string" ? value.name : `${labelOf(this.path)} ${index + 1}`);
  }

  show() {
    const items = this.items;
    while (this.forms.length > items.length) this.forms.pop()?.box.remove();
    while (this.forms.length < items.length) this.append(this.forms.length);
    items.forEach((_, index) => {
      const { form, title, note, box } = this.forms[index];
      write(title, this.titleOf(index));
      write(note, this.options.note?.(items[index]) ?? "");
      form.show();
      box.classList.toggle("is-wrong", this.store.problems.some((one) => startsWith(one.path, [...this.path, index])));
    });
  }

  /** @param {number} index */
  append(index) {
    const box = element("details", "", "item");
    const head = element("summary");
    const title = element("b");
    const note = element("span", "", "note");
    head.append(title, note);
    const form = new TableForm(this.store, [...this.path, index], this.item, this.options);
    const tail = element("div", "", "actions");
    tail.append(...(this.options.extras?.(index) ?? []), button(say("remove"), () => {
      const label = say("edit.remove", { what: this.titleOf(index) });
      this.store.edit([{ op: "remove", path: [...this.path, index] }], label);
    }, "remove"));
    box.append(head, form.element, tail);
    this.rows.append(box);
    this.forms.push({ form, title, note, box });
  }
}
