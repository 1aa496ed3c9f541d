// The page's words in the reader's language, from catalogues of one file for each language.
import { all } from "./elements.js";

/** @import { Path } from "../plan.js" */

export const LANGUAGES = ["en", "de"];
/** @type {Record<string, string>} */
let texts = {};
/** @type {Record<string, [string, string]>} */
let fields = {};
export let language = "en";

/** The language that was asked for in the address, else the first known one of the browser's. */
export function wanted() {
  const asked = new URLSearchParams(location.search).get("lang");
  const short = (/** @type {string} */ one) => one.toLowerCase().split("-")[0];
  return [asked ?? "", ...navigator.languages].map(short).find((one) => LANGUAGES.includes(one)) ?? "en";
}

/** @param {string} name */
async function read(name) {
  const answer = await fetch(`/files/${name}`);
  if (!answer.ok) throw new TypeError(`${name}: expected a catalogue`);
  return answer.json();
}

/** @param {string} [chosen] */
export async function loadTexts(chosen = wanted()) {
  language = chosen;
  document.documentElement.lang = chosen;
  texts = await read(`plan-texts-${chosen}.json`);
  fields = await read(`plan-fields-${chosen}.json`);
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
