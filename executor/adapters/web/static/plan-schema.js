// The schema of the site file: what a key takes, in which unit, what it means, and what holds without it.
import { fieldWords } from "./plan-texts.js";

/** @import { Json, Path, Schema } from "../plan.js" */

/** @typedef {"number" | "integer" | "boolean" | "choice" | "text" | "texts" | "numbers" | "tables" | "other"} Kind */
/** @typedef {{ schema: Schema, isOptional: boolean }} Resolved */

/** @type {[string, string][]} */
const UNITS = [
  ["m_s", "m/s"], ["m2", "m²"], ["pct_per_min", "%/min"], ["bytes_s", "B/s"], ["deg", "°"], ["pct", "%"], ["kg", "kg"], ["ah", "Ah"],
  ["hz", "Hz"], ["mm", "mm"], ["px", "px"], ["ohm", "Ω"], ["wh", "Wh"], ["m", "m"], ["s", "s"],
];

/**
 * A part of the schema without its references, and without that it may be null.
 * @param {Schema} part
 * @param {Schema} root
 * @returns {Resolved}
 */
export function resolve(part, root) {
  let found = part;
  let isOptional = false;
  for (;;) {
    if (found.$ref) {
      const known = root.$defs?.[found.$ref.split("/").at(-1) ?? ""] ?? {};
      const { $ref, ...own } = found;
      found = { ...known, ...own };
    } else if (found.anyOf?.some((one) => one.type === "null")) {
      isOptional = true;
      const rest = found.anyOf.filter((one) => one.type !== "null");
      const { anyOf, ...own } = found;
      found = rest.length === 1 ? { ...rest[0], ...own } : { ...own, anyOf: rest };
    } else return { schema: found, isOptional };
  }
}

/**
 * The schema of what stands at a path.
 * @param {Schema} root
 * @param {Path} path
 * @returns {Schema}
 */
export function schemaAt(root, path) {
  let { schema } = resolve(root, root);
  for (const key of path) {
    const part = typeof key === "number" ? schema.items : schema.properties?.[key];
    if (!part) throw new TypeError(`${path.join(".")}: expected a key of the site file`);
    schema = resolve(part, root).schema;
  }
  return schema;
}

/**
 * @param {Schema} schema
 * @param {Schema} root
 * @returns {Kind}
 */
export function kindOf(schema, root) {
  if (schema.enum) return "choice";
  if (schema.anyOf) return schema.anyOf.some((one) => one.type === "array") ? "texts" : "other";
  if (schema.type === "number" || schema.type === "integer" || schema.type === "boolean") return schema.type;
  if (schema.type === "string") return "text";
  if (schema.type !== "array") return "other";
  const item = schema.prefixItems?.[0] ?? schema.items;
  if (!item) return "other";
  const own = resolve(item, root).schema;
  if (own.type === "object") return "tables";
  if (own.type === "number" || own.type === "integer") return "numbers";
  return own.type === "string" ? "texts" : "other";
}

/**
 * @param {string} key
 * @param {Schema} schema
 */
export function unitOf(key, schema) {
  if (typeof schema.unit === "string") return schema.unit;
  return UNITS.find(([suffix]) => key.endsWith(`_${suffix}`))?.[1] ?? "";
}

/**
 * What a key is called: in the language's own words, else from its name, without the unit.
 * @param {Path} path
 */
export function labelOf(path) {
  const own = fieldWords(path);
  if (own) return own[0];
  const key = String(path.at(-1));
  const suffix = UNITS.find(([unit]) => key.endsWith(`_${unit}`))?.[0];
  const words = (suffix ? key.slice(0, -suffix.length - 1) : key).replaceAll("_", " ");
  return words.charAt(0).toUpperCase() + words.slice(1);
}

/**
 * @param {Path} path
 * @param {Schema} schema
 */
export const meaningOf = (path, schema) => fieldWords(path)?.[1] || (schema.description ?? "").replaceAll("`", "");

/** @param {Json} value */
export const isGiven = (value) => value !== undefined && value !== null && !(Array.isArray(value) && !value.length);

/**
 * A figure that somebody typed, with a point or a comma; their own words where it is none, for the server to judge.
 * @param {string} text
 * @param {boolean} isWhole
 */
export function parseNumber(text, isWhole = false) {
  const plain = text.trim().replace(",", ".");
  const value = Number(plain);
  return plain === "" || Number.isNaN(value) || (isWhole && !Number.isInteger(value)) ? text.trim() : value;
}

/**
 * What somebody typed into a field, as the site file has it; undefined where nothing stands there.
 * @param {string} text
 * @param {Kind} kind
 * @returns {Json}
 */
export function parseValue(text, kind) {
  if (text.trim() === "") return undefined;
  if (kind === "number" || kind === "integer") return parseNumber(text, kind === "integer");
  if (kind === "numbers") return text.split(/[;\s]+/).filter(Boolean).map((one) => parseNumber(one));
  if (kind === "texts") {
    const parts = text.split(/[;,\n]+/).map((one) => one.trim()).filter(Boolean);
    return parts;
  }
  return text.trim();
}

/**
 * A value as a field shows it.
 * @param {Json} value
 */
export function formatValue(value) {
  if (!isGiven(value)) return "";
  if (Array.isArray(value)) return value.join(typeof value[0] === "number" ? "; " : ", ");
  return typeof value === "object" ? "…" : String(value);
}
