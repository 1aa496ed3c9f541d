// The network: dropped or opened, and what was understood of its file.
import { byId, element, write } from "./elements.js";
import { button, fileButton, TableForm } from "./plan-forms.js";
import { persist, server } from "./plan-api.js";
import { schemaAt } from "./plan-schema.js";
import { count, figure, say } from "./plan-texts.js";

/** @import { Remedy, Step } from "./plan-steps.js" */
/** @import { Store } from "./plan-store.js" */

const REMARKS = 6;
const FILES = 12;

/** Takes files that are dropped anywhere on the page, chosen, or named by their path on this computer. */
export class Dropping {
  /** @param {Store} store */
  constructor(store) {
    this.store = store;
    this.isBusy = false;
    let depth = 0;
    const veil = byId("dropping");
    const isFile = (/** @type {DragEvent} */ event) => event.dataTransfer?.types.includes("Files") ?? false;
    addEventListener("dragenter", (event) => {
      if (!isFile(event)) return;
      depth += 1;
      veil.hidden = false;
    });
    addEventListener("dragleave", (event) => {
      if (!isFile(event)) return;
      depth = Math.max(0, depth - 1);
      veil.hidden = depth === 0;
    });
    addEventListener("dragover", (event) => event.preventDefault());
    addEventListener("drop", (event) => {
      event.preventDefault();
      depth = 0;
      veil.hidden = true;
      const file = event.dataTransfer?.files[0];
      if (file) this.take(file);
    });
  }

  /** @param {File} file */
  async take(file) {
    if (this.isBusy) return;
    this.isBusy = true;
    this.store.tell(say("upload.reading", { file: file.name }));
    const next = await this.store.ask(() => server.upload(file, "network"));
    this.isBusy = false;
    if (!next) return;
    this.store.tell(say("upload.done", { file: file.name }));
    await this.store.take(next);
  }

  /** @param {string} path */
  async open(path) {
    const next = await this.store.ask(() => persist(() => server.open(path), () => this.store.heard(false)));
    if (next) await this.store.take(next);
    return next !== null;
  }

  /** A place to drop a file on, with a button for those who rather choose it, and a path. */
  makeTarget() {
    const target = element("div", "", "drop");
    const input = element("input");
    input.type = "file";
    input.className = "unseen";
    input.setAttribute("aria-label", say("drop.choose"));
    input.addEventListener("change", () => {
      const file = input.files?.[0];
      if (file) this.take(file);
      input.value = "";
    });
    const choose = button(say("drop.choose"), () => input.click(), "primary");
    const line = element("form", "", "path");
    const path = element("input");
    path.type = "text";
    path.placeholder = say("drop.path.example");
    path.setAttribute("aria-label", say("drop.path"));
    const opens = element("button", say("open"));
    line.append(path, opens);
    line.addEventListener("submit", async (event) => {
      event.preventDefault();
      if (path.value.trim() && await this.open(path.value.trim())) path.value = "";
    });
    target.append(element("p", say("drop.here"), "where"), choose, input, line);
    return target;
  }

  /**
   * The files of the folder that could be opened.
   * @param {HTMLElement} place
   */
  async listFiles(place) {
    const found = await server.files().catch(() => []);
    place.hidden = !found.length;
    place.replaceChildren(element("p", say("drop.found"), "soft"), ...found.slice(0, FILES).map(({ path, kind }) => {
      const one = button(path, () => this.open(path), "found");
      one.append(" ", element("small", say(`kind.${kind}`)));
      return one;
    }));
  }
}

/**
 * @param {Store} store
 * @param {Dropping} dropping
 * @returns {Step}
 */
export function networkStep(store, dropping) {
  const what = element("p", "", "lead");
  const remarks = element("ul", "", "remarks");
  const form = new TableForm(store, ["network"], schemaAt(store.schema, ["network"]), {
    first: [], without: ["only", "leave_out", "radius_m"],
  });
  const other = element("details", "", "more");
  let shown = "";

  function showRemarks() {
    const found = store.network?.remarks ?? [];
    const key = JSON.stringify(found);
    if (key === shown) return;
    shown = key;
    const lines = (/** @type {string[]} */ some) => some.map((one) => element("li", one));
    const rest = found.slice(REMARKS);
    remarks.replaceChildren(...lines(found.slice(0, REMARKS)));
    if (!rest.length) return;
    const more = element("details");
    const list = element("ul");
    list.append(...lines(rest));
    more.append(element("summary", count("remarks.more", rest.length)), list);
    const item = element("li");
    item.append(more);
    remarks.append(item);
  }

  return {
    name: "network",
    paths: [["network", "file"], ["network", "layer"], ["network", "where"], ["network", "snap_m"], ["network", "max_span_m"], ["network", "crs"], ["network", "encoding"], ["network", "tallest_m"], ["network", "pylon_height_m"]],
    status: () => (store.network ? count("segments", store.network.segments.length) : say("status.none")),
    build: (place) => {
      other.append(element("summary", say("network.other")), dropping.makeTarget());
      place.append(what, remarks, form.element, other);
    },
    show: () => {
      const network = store.network;
      const lengthM = (network?.segments ?? []).reduce((sum, one) => sum + one.length_m, 0);
      write(what, network ? say("network.what", {
        source: network.source.split(/[\\/]/).at(-1) ?? "", segments: network.segments.length, pylons: network.pylons.length, length: figure(lengthM / 1000, 1),
      }) : say("network.none"));
      showRemarks();
      form.show();
    },
  };
}

/**
 * A network that does not know its heights can be flown by those of a raster, or where the ground is level.
 * @param {Store} store
 * @returns {Remedy[]}
 */
export function remediesOf(store) {
  const fits = (/** @type {{ message: string }} */ { message }) => message.includes('heights = "flat"');
  return [
    {
      fits,
      make: () => fileButton(store, (file) => store.edit([{ op: "set", path: ["terrain", "files"], value: file }], say("edit.terrain", { file })), say("remedy.terrain")),
    },
    {
      fits,
      make: () => button(say("remedy.flat"), () => store.edit([{ op: "set", path: ["inspection", "heights"], value: "flat" }], say("edit.flat"))),
    },
  ];
}
