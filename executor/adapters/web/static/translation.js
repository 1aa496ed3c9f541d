// What the program says, in the reader's language: the server sends English, and the catalogue has the words of each
// line in another language, beside the English words with `{names}` that the program makes the line of.
import { all, element } from "./elements.js";

/** @typedef {{ weight: number, isWeak: boolean, literal: string, pattern: RegExp, holes: Hole[], text: string }} Line */
/** @typedef {{ name: string, isFigure?: boolean, isTheirs?: boolean }} Hole */

const LANGUAGES = ["en", "de"];
/** @type {Record<string, string>} */
const OWN_NAMES = { en: "English", de: "Deutsch" };
const HOLE = /\{(\w*)(?:!\w)?(?::([^}]*))?\}/;
const FIGURE = "(-?[\\d.]+(?:e[-+]?\\d+)?|-?inf|nan)";
// With fewer letters than this a line says too little: then each value in it has to be one word, or known, and nothing
// stands before it.
const LEAST_LETTERS = 5;
// Figures with so many decimals are places: they are read out, and typed in, with a point.
const PLACE = /\.\d{4,}$/;
// What vehicles and other programs say is theirs.
const THEIRS = /says: $/;
const SEPARATORS = ["; ", ". ", ": ", ", ", " and ", " or "];
const NAMES = /^((?:\S+, )*\S+)( and | or )(\S+)$/;
const MOST_KEPT = 3000;

export let language = "en";
/** @type {Map<string, string>} */
let whole = new Map();
/** @type {Line[]} */
let lines = [];
/** @type {Map<string, string>} */
const kept = new Map();

/** The language that was asked for in the address, else the first known one of the browser's. */
export function wanted() {
  const asked = new URLSearchParams(location.search).get("lang");
  const short = (/** @type {string} */ one) => one.toLowerCase().split("-")[0];
  return [asked ?? "", ...navigator.languages].map(short).find((one) => LANGUAGES.includes(one)) ?? "en";
}

/** @param {string} name */
export async function readCatalogue(name) {
  const answer = await fetch(`/files/${name}`);
  if (!answer.ok) throw new TypeError(`${name}: expected a catalogue`);
  return answer.json();
}

/**
 * Takes up what is said in a language; English needs nothing.
 * @param {string} chosen
 * @param {string[]} names of catalogues
 */
export async function useLanguage(chosen, names) {
  const found = chosen === "en" ? [] : await Promise.all(names.map((name) => readCatalogue(`${name}-${chosen}.json`)));
  learn(chosen, Object.assign({}, ...found));
  document.documentElement.lang = chosen;
}

/**
 * @param {string} chosen
 * @param {Record<string, string>} catalogue
 */
export function learn(chosen, catalogue) {
  language = chosen;
  kept.clear();
  whole = new Map(Object.entries(catalogue));
  for (const [words, text] of [...whole]) {
    // A line about a key of the site file is also shown at that key, without its name.
    const [, key = "", rest = ""] = words.match(/^([\w.[\]{}]+): (.+)$/s) ?? [];
    if (rest && text.startsWith(`${key}: `) && !whole.has(rest)) whole.set(rest, text.slice(key.length + 2));
  }
  lines = [...whole].filter(([words]) => HOLE.test(words) || isEnd(words)).map(([words, text]) => readLine(words, text)).filter((one) => one.weight > 0);
  lines.sort((one, other) => other.weight - one.weight || figures(other) - figures(one));
}

/** @param {Line} line */
const figures = (line) => line.holes.filter((one) => one.isFigure).length;

/** Whether words stand behind others. @param {string} words */
const isEnd = (words) => /^[ ,;:]/.test(words);

/**
 * @param {string} words
 * @param {string} text
 * @returns {Line}
 */
function readLine(words, text) {
  /** @type {Hole[]} */
  const holes = [];
  const parts = words.split(new RegExp(HOLE, "g"));
  const literals = parts.filter((_, index) => index % 3 === 0);
  const weight = literals.join("").replace(/[^a-z]/gi, "").length;
  const isWeak = weight < LEAST_LETTERS && !/^[,;:]|says:/.test(words);
  let pattern = "";
  for (const [index, literal] of literals.entries()) {
    pattern += literal.replace(/[.*+?^${}()|[\]\\]/g, "\\$&");
    if (index === literals.length - 1) break;
    const isFigure = /[dfg]$/.test(parts[3 * index + 2] ?? "");
    holes.push({ name: parts[3 * index + 1], isFigure, isTheirs: THEIRS.test(literal) });
    pattern += isFigure ? FIGURE : "(.*?)";
  }
  const isBehind = isEnd(words) && !isWeak;
  if (isBehind) holes.unshift({ name: "" });
  const literal = literals.reduce((longest, one) => (one.length > longest.length ? one : longest), "");
  return { weight, isWeak, literal, pattern: new RegExp(`^${isBehind ? "(.*)" : ""}${pattern}$`, "s"), holes, text: isBehind ? `{}${text}` : text };
}

/**
 * What the program says, in the reader's language; what the catalogue does not know stays as it is.
 * @param {string} text
 * @returns {string}
 */
export function translate(text) {
  if (!lines.length || !text) return text;
  const before = kept.get(text);
  if (before !== undefined) return before;
  const found = known(text) ?? fromParts(text);
  if (kept.size >= MOST_KEPT) kept.clear();
  kept.set(text, found);
  return found;
}

/** @param {string} text */
function known(text) {
  const exact = whole.get(text);
  if (exact !== undefined) return exact;
  for (const line of lines) {
    const found = text.includes(line.literal) ? line.pattern.exec(text) : null;
    if (!found) continue;
    /** @type {Map<string, string>} */
    const values = new Map(line.holes.map(({ name, isFigure, isTheirs }, index) => {
      const value = found[index + 1];
      return [name, isFigure ? writeFigure(value) : isTheirs ? value : translate(value)];
    }));
    const isSure = !line.isWeak || found.slice(1).every((value) => !value.includes(" ") || translate(value) !== value);
    if (isSure) return fillIn(line.text, (name) => values.get(name) ?? "");
  }
  return null;
}

/**
 * Texts that were put together, of which at least one is known; or names in a row.
 * @param {string} text
 */
function fromParts(text) {
  for (const separator of SEPARATORS) {
    for (let at = text.indexOf(separator); at >= 0; at = text.indexOf(separator, at + 1)) {
      const parts = [text.slice(0, at), text.slice(at + separator.length)];
      const own = parts.map(translate);
      if (own.some((one, index) => one !== parts[index])) return own.join(whole.get(separator) ?? separator);
    }
  }
  return text.replace(NAMES, (_, names, word, last) => `${names}${whole.get(word)}${last}`);
}

/**
 * A figure that has a decimal point in English.
 * @param {string} value
 */
export const writeFigure = (value) => (language === "en" || PLACE.test(value) ? value : value.replace(".", ","));

/**
 * @param {string} text
 * @param {(name: string) => string | number} getValue
 */
const fillIn = (text, getValue) => text.replace(new RegExp(HOLE, "g"), (_, name) => String(getValue(name)));

/**
 * The page's own words, which stand in its source in English.
 * @param {string} words
 * @param {Record<string, string | number>} [values]
 */
export const say = (words, values = {}) => fillIn(whole.get(words) ?? words, (name) => values[name] ?? "");

/**
 * One of two texts, for one thing and for several.
 * @param {number} count
 * @param {string} one
 * @param {string} many
 */
export const sayCount = (count, one, many) => say(count === 1 ? one : many, { count });

/**
 * The words that stand in the document, in the reader's language.
 * @param {Element} root
 */
export function translateDocument(root) {
  if (!lines.length) return;
  const walk = document.createTreeWalker(root, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const words = walk.currentNode.nodeValue ?? "";
    const own = whole.get(words.trim());
    if (own) walk.currentNode.nodeValue = words.replace(words.trim(), own);
  }
  for (const name of ["aria-label", "title", "placeholder"]) {
    for (const one of all(root, `[${name}]`, Element)) one.setAttribute(name, say(one.getAttribute(name) ?? ""));
  }
}

/**
 * Offers the languages; the chosen one stands in the address.
 * @param {HTMLSelectElement} menu
 */
export function offerLanguages(menu) {
  for (const one of LANGUAGES) {
    const option = element("option", OWN_NAMES[one]);
    option.value = one;
    menu.append(option);
  }
  menu.value = language;
  menu.addEventListener("change", () => {
    const address = new URL(location.href);
    address.searchParams.set("lang", menu.value);
    location.assign(address);
  });
}
