// The plan page's server: what is asked of it, and what is kept and sent again while it does not answer.
import { language, translate } from "./translation.js";

/** @import { ChangeAnswer, Change, Checklist, Edit, FlightEntry, GroundPlaces, Job, Json, LossAnswer, NetworkDocument, News, PlanDocument, Schema, TryAnswer, Workspace } from "../plan.js" */

const RETRY_MS = 1000;
// What of an answer is said to people, in English.
const SAID = new Set(["error", "lines", "message", "remarks", "save_error", "unreachable", "violations", "why", "words"]);

/** What the server refused, in one line; with the newest workspace where another tab was first. */
export class Refusal extends Error {
  /**
   * @param {string} message
   * @param {number} status
   * @param {Json} body
   */
  constructor(message, status, body) {
    super(message);
    this.status = status;
    this.body = body;
  }

  /** @returns {Workspace | null} */
  get newest() {
    const found = this.body?.workspace ?? this.body;
    return this.status === 409 && typeof found?.revision === "number" ? found : null;
  }
}

/** The server did not answer at all. */
export class Unanswered extends Error {}

/**
 * An answer with what it says in the reader's language.
 * @template {Json} Answer
 * @param {Answer} answer
 * @returns {Answer}
 */
function inOwnWords(answer) {
  if (language === "en") return answer;
  /** @type {(value: Json, isSaid: boolean) => Json} */
  const put = (value, isSaid) => {
    if (typeof value === "string") return isSaid ? translate(value) : value;
    if (value === null || typeof value !== "object") return value;
    for (const [key, one] of Object.entries(value)) value[key] = put(one, Array.isArray(value) ? isSaid : SAID.has(key));
    return value;
  };
  return put(answer, false);
}

/**
 * @param {string} path
 * @param {RequestInit} [request]
 */
async function ask(path, request) {
  let answer;
  try {
    answer = await fetch(path, request);
  } catch (error) {
    throw new Unanswered(String(error));
  }
  const isJson = (answer.headers.get("content-type") ?? "").startsWith("application/json");
  /** @type {Json} */
  let body;
  try {
    body = isJson ? inOwnWords(await answer.json()) : translate(await answer.text());
  } catch (error) {
    throw new Unanswered(String(error));
  }
  if (!answer.ok) throw new Refusal(isJson ? (body.error ?? answer.statusText) : body, answer.status, body);
  return body;
}

/**
 * @param {string} path
 * @param {Json} content
 */
const post = (path, content) =>
  ask(path, { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(content) });

export const server = {
  /** @returns {Promise<Workspace>} */
  workspace: () => ask("/api/workspace"),
  /** @returns {Promise<Schema>} */
  schema: () => ask("/api/schema"),
  /**
   * @param {string} digest
   * @returns {Promise<NetworkDocument>}
   */
  network: (digest) => ask(`/api/network?digest=${encodeURIComponent(digest)}`),
  /** @returns {Promise<GroundPlaces>} */
  ground: () => ask("/api/ground"),
  /**
   * @param {number} revision
   * @param {Edit[]} edits
   * @param {string} label
   * @returns {Promise<Workspace>}
   */
  edit: (revision, edits, label) => post("/api/edits", { revision, edits, label }),
  /**
   * @param {number} revision
   * @returns {Promise<Workspace>}
   */
  undo: (revision) => post("/api/undo", { revision }),
  /**
   * @param {number} revision
   * @returns {Promise<Workspace>}
   */
  redo: (revision) => post("/api/redo", { revision }),
  /**
   * @param {string} path
   * @returns {Promise<Workspace>}
   */
  open: (path) => post("/api/open", { path }),
  /** @returns {Promise<{ path: string, kind: string }[]>} */
  files: async () => (await ask("/api/files")).files,
  /**
   * @param {File} file
   * @param {"network" | "file"} use a network begins a site; another file is kept beside the site
   * @returns {Promise<Workspace>}
   */
  upload: (file, use) =>
    ask(`/api/upload?name=${encodeURIComponent(file.name)}&use=${use}`, {
      method: "POST", headers: { "content-type": "application/octet-stream" }, body: file,
    }),
  /**
   * @param {string} connection
   * @param {number} sysid
   * @param {string} autopilot
   * @returns {Promise<TryAnswer>}
   */
  tryConnection: (connection, sysid, autopilot) => post("/api/try", { connection, sysid, autopilot }),
  /**
   * @param {Json} wanted
   * @returns {Promise<{ job: Job }>}
   */
  plan: (wanted) => post("/api/plan", wanted),
  /** @param {string} job */
  cancel: (job) => post("/api/cancel", { job }),
  /**
   * @param {string} id
   * @returns {Promise<PlanDocument>}
   */
  planOf: (id) => ask(`/api/plans/${encodeURIComponent(id)}`),
  /**
   * @param {string} id
   * @returns {Promise<Workspace>}
   */
  choose: (id) => post(`/api/plans/${encodeURIComponent(id)}/choose`, {}),
  /**
   * @param {string} id
   * @param {string} vehicle
   * @param {number} atS
   * @returns {Promise<LossAnswer>}
   */
  lose: (id, vehicle, atS) => post(`/api/plans/${encodeURIComponent(id)}/loss`, { vehicle, at_s: atS }),
  /**
   * @param {string} id
   * @param {Change[]} changes
   * @param {boolean} keep
   * @returns {Promise<ChangeAnswer>}
   */
  change: (id, changes, keep) => post(`/api/plans/${encodeURIComponent(id)}/change`, { changes, keep }),
  /**
   * Starts the flight of a plan; its own page asks before anything moves.
   * @param {string} plan
   * @returns {Promise<{ url: string }>}
   */
  fly: (plan) => post("/api/fly", { plan }),
  /**
   * @param {string} plan
   * @returns {Promise<Checklist>}
   */
  check: (plan) => post("/api/fly", { plan, dry: true }),
  /** @returns {Promise<FlightEntry[]>} */
  flights: async () => (await ask("/api/flights")).flights,
  /**
   * @param {string} run
   * @returns {Promise<{ job: Job }>}
   */
  left: (run) => post("/api/left", { run }),
};

/**
 * Follows what changes on the server; the browser comes back by itself.
 * @param {(news: News) => void} news
 * @param {(isHeard: boolean) => void} heard
 */
export function listen(news, heard) {
  const stream = new EventSource("/api/events");
  stream.addEventListener("message", (event) => {
    heard(true);
    news(inOwnWords(JSON.parse(event.data)));
  });
  stream.addEventListener("open", () => heard(true));
  stream.addEventListener("error", () => {
    heard(false);
    // A stream that was refused is not asked for again by the browser.
    if (stream.readyState !== EventSource.CLOSED) return;
    stream.close();
    setTimeout(() => listen(news, heard), RETRY_MS);
  });
}

/**
 * Asks again until the server answers; what it refuses is handed on.
 * @template Answer
 * @param {() => Promise<Answer>} question
 * @param {() => void} waiting
 * @returns {Promise<Answer>}
 */
export async function persist(question, waiting) {
  for (;;) {
    try {
      return await question();
    } catch (error) {
      if (!(error instanceof Unanswered)) throw error;
      waiting();
      await new Promise((resolve) => setTimeout(resolve, RETRY_MS));
    }
  }
}
