// Every span and pylon by its name: what became of it, where it is, and that somebody wants to see it again.
import { element, write } from "./words.js";

const MOST = 100;
const byId = (id) => document.getElementById(id);
// What asks for attention comes first.
const KINDS = [
  ["missed", "not seen", "✗"],
  ["left", "left over", "✗"],
  ["inferred", "inferred", "≈"],
  ["now", "under way", "▸"],
  ["open", "to inspect", "·"],
  ["done", "inspected", "✓"],
];

export class Assets {
  constructor(show, again) {
    this.show_ = show;
    this.again = again;
    this.names = [];
    this.state = null;
    this.shown = "";
    byId("part").addEventListener("input", () => this.draw());
    byId("part").addEventListener("keydown", (event) => event.key === "Enter" && event.preventDefault());
    byId("rows").addEventListener("click", (event) => this.clicked(event.target.closest("button")));
  }

  open() {
    byId("part").value = "";
    byId("assets").showModal();
    this.draw();
  }

  show(state) {
    this.state = state;
    if (byId("assets").open) this.draw();
  }

  clicked(button) {
    if (!button) return;
    const segment = Number(button.closest("li").dataset.segment);
    if (button.dataset.what === "again") this.again(this.names[segment]);
    else {
      byId("assets").close();
      this.show_(segment);
    }
  }

  kinds() {
    const { inspected, inferred, missed, uncovered, vehicles } = this.state;
    const kinds = new Map();
    const mark = (segments, kind) => segments.forEach((segment) => kinds.set(segment, kind));
    mark(inspected, "done");
    mark(inferred, "inferred");
    mark(vehicles.map((one) => one.progress.segment).filter((segment) => segment !== null && !kinds.has(segment)), "now");
    mark(uncovered, "left");
    mark(missed, "missed");
    return kinds;
  }

  draw() {
    if (!this.state) return;
    const kinds = this.kinds();
    const found = this.names.map((name, segment) => ({ name, segment, kind: kinds.get(segment) ?? "open" }));
    const counts = KINDS.map(([kind, word]) => [found.filter((one) => one.kind === kind).length, word]);
    write(byId("tally"), counts.filter(([count]) => count).map(([count, word]) => `${count} ${word}`).join(", "));
    const part = byId("part").value.trim().toLowerCase();
    const rank = new Map(KINDS.map(([kind], at) => [kind, at]));
    const wanted = found.filter((one) => one.name.toLowerCase().includes(part));
    wanted.sort((a, b) => rank.get(a.kind) - rank.get(b.kind) || a.segment - b.segment);
    const idle = this.state.finished || this.state.recalled || this.state.flight_s === null;
    const rows = wanted.slice(0, MOST);
    const key = JSON.stringify([rows, wanted.length, idle]);
    if (key === this.shown) return;
    this.shown = key;
    byId("rows").replaceChildren(...rows.map((one) => this.row(one, idle)));
    write(byId("rest"), wanted.length > MOST ? `and ${wanted.length - MOST} more: write a part of a name` : wanted.length ? "" : "none of this name");
  }

  row({ name, segment, kind }, idle) {
    const [, word, mark] = KINDS.find(([one]) => one === kind);
    const row = element("li", "", kind);
    row.dataset.segment = segment;
    const state = element("span", `${mark} ${word}`, "kind");
    const where = element("button", name, "name");
    where.title = "Show it on the map";
    where.type = "button";
    row.append(state, where);
    if (!["open", "now"].includes(kind)) {
      const again = element("button", "Look again");
      again.type = "button";
      again.dataset.what = "again";
      again.disabled = idle;
      again.setAttribute("aria-label", `Look again at ${name}`);
      row.append(again);
    }
    return row;
  }
}
