// Vehicles on the ground that could take over work: offered, and started by somebody's word alone.
import { byId, element, write } from "./elements.js";
import { say, translate } from "./translation.js";

/** @import { State } from "../documents.js" */

export class Offers {
  /** @param {(action: string, vehicle: string) => void} ask */
  constructor(ask) {
    this.ask = ask;
    this.shown = "";
  }

  /** @param {State} state */
  show(state) {
    const offer = state.finished ? null : state.offer;
    byId("offer").hidden = offer === null;
    const key = JSON.stringify(offer);
    if (key === this.shown) return;
    this.shown = key;
    write(byId("offered"), offer === null ? "" : translate(offer.text));
    byId("takers").replaceChildren(...(offer?.vehicles ?? []).map((name) => {
      const button = element("button", say("{name}: pad is clear", { name }));
      button.dataset.vehicle = name;
      button.addEventListener("click", () => this.ask("include", name));
      return button;
    }));
  }
}
