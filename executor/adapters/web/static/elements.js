// The page's elements, and what is read from its style.

/**
 * The element below another that a selector names; that it is missing, or of another kind, is a mistake in the page.
 * @template {Element} [Kind=HTMLElement]
 * @param {ParentNode} root
 * @param {string} selector
 * @param {new () => Kind} [kind]
 */
export function find(root, selector, kind) {
  const found = root.querySelector(selector);
  if (!(found instanceof (kind ?? HTMLElement))) throw new TypeError(`${selector}: expected an element of its kind`);
  return /** @type {Kind} */ (found);
}

/**
 * @template {Element} [Kind=HTMLElement]
 * @param {string} id
 * @param {new () => Kind} [kind]
 */
export const byId = (id, kind) => find(document, `#${id}`, kind);

/**
 * Every element of a kind below another that a selector names.
 * @template {Element} [Kind=HTMLElement]
 * @param {ParentNode} root
 * @param {string} selector
 * @param {new () => Kind} [kind]
 */
export const all = (root, selector, kind) =>
  /** @type {Kind[]} */ ([...root.querySelectorAll(selector)].filter((one) => one instanceof (kind ?? HTMLElement)));

/**
 * @template {keyof HTMLElementTagNameMap} Tag
 * @param {Tag} tag
 */
export function element(tag, text = "", name = "") {
  const made = document.createElement(tag);
  if (text) made.textContent = text;
  if (name) made.className = name;
  return made;
}

/**
 * Changes a text only where it is another one: what somebody has marked stays marked.
 * @param {Element} place
 * @param {string} text
 */
export function write(place, text) {
  if (place.textContent !== text) place.textContent = text;
}

/** @param {string} name */
export const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
