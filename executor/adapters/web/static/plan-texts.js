// The plan page's words in the reader's language, from catalogues of one file for each language.
import { all } from "./elements.js";
import { language, readCatalogue, useLanguage, wanted } from "./translation.js";

/** @import { Path } from "../plan.js" */

/** @type {Record<string, string>} */
let texts = {};
/** @type {Record<string, [string, string]>} */
let fields = {};

export async function loadTexts(chosen = wanted()) {
  await useLanguage(chosen, ["page", "lines"]);
  texts = await readCatalogue(`plan-texts-${chosen}.json`);
  fields = await readCatalogue(`plan-fields-${chosen}.json`);
}

/**
 * @param {string} key
 * @param {Record<string, string | number>} [values]
 */
export function say(key, values = {}) {
  const text = texts[key];
  if (text === undefined) throw new TypeError(`${key}: expected a text in the catalogue`);
  return text.replace(/\{(\w+)\}/g, (_, name) => String(values[name] ?? ""));
}

/**
 * One of two texts, for one thing and for several.
 * @param {string} key
 * @param {number} count
 * @param {Record<string, string | number>} [values]
 */
export const count = (key, count, values = {}) =>
  say(`${key}.${count === 1 ? "one" : "many"}`, { ...values, count });

/**
 * What a key of the site file is called and means, where the language has words of its own for it. English has meanings
 * from the schema.
 * @param {Path} path
 * @returns {[string, string] | null}
 */
export const fieldWords = (path) => fields[path.filter((one) => typeof one === "string").join(".")] ?? null;

/**
 * A figure as the language writes it.
 * @param {number | null | undefined} value
 */
export const figure = (value, digits = 0) =>
  value === null || value === undefined ? "–"
    : value.toLocaleString(language, { minimumFractionDigits: digits, maximumFractionDigits: digits });

/**
 * Fills in the texts that the document asks for: `data-text` as its text, `data-name` as its name for screen readers.
 * @param {ParentNode} [root]
 */
export function fill(root = document) {
  for (const one of all(root, "[data-text]", Element)) one.textContent = say(one.getAttribute("data-text") ?? "");
  for (const one of all(root, "[data-name]", Element)) one.setAttribute("aria-label", say(one.getAttribute("data-name") ?? ""));
  for (const one of all(root, "[data-hint]", Element)) one.setAttribute("title", say(one.getAttribute("data-hint") ?? ""));
}
