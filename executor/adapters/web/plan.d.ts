// What the plan page and its server say to each other. Places are [latitude, longitude] in degrees.

export type LatLon = [number, number];
export type Path = (string | number)[];
/** A table of the site file, or a value in one. */
export type Json = any;

export interface Problem { path: Path; message: string }

export interface Job {
  id: string;
  kind: string;
  state: "running" | "done" | "cancelled" | "failed";
  elapsed_s: number;
  limit_s: number;
  /** What the best plan so far costs. */
  value: number | null;
  /** How much better it is than the first one. */
  better_pct: number | null;
  /** How long ago it became better the last time. */
  since_s: number | null;
  error: string | null;
}

export interface Breaking { vehicle: string; from_s: number; to_s: number }

export interface PlanSummary {
  id: string;
  file: string;
  kind?: "flight" | "day";
  /** When the last one has landed, in seconds from the first midnight of a day. */
  finish_s?: number;
  longest_s: number;
  energy_pct: Record<string, number>;
  window_pct: number | null;
  window_from_s: number | null;
  breaking: Breaking | null;
  uncovered: number;
  cost: string;
  /** Whether the site has changed since. */
  stale: boolean;
}

export interface Workspace {
  revision: number;
  /** Of which revision network, ground and problems are. */
  checked: number;
  /** Of a file that was sent: its name from the site's folder. */
  uploaded?: string;
  site: { path: string; name: string; text: string } | null;
  /** Only what the file says. */
  values: Record<string, Json>;
  problems: Problem[];
  undo: string | null;
  redo: string | null;
  network: { digest: string; segments: number } | null;
  plans: PlanSummary[];
  chosen: string | null;
  job: Job | null;
  saved: boolean;
  save_error: string | null;
  tabs: number;
}

export interface Segment {
  id: number;
  name: string;
  a: LatLon;
  b: LatLon;
  length_m: number;
  left_out: boolean;
  /** Why no vehicle can inspect it. */
  unreachable: string | null;
}

export interface Pylon { name: string; place: LatLon; height_m: number | null }

export interface NetworkDocument {
  digest: string;
  source: string;
  frame: { lat_deg: number; lon_deg: number; alt_m: number };
  segments: Segment[];
  pylons: Pylon[];
  remarks: string[];
}

export interface GroundArea {
  index: number;
  name: string;
  kind: string;
  rings: LatLon[][];
  margin_m: number;
  from_file: boolean;
}

export interface NamedPlace { name: string; place: LatLon }

export interface GroundPlaces {
  depot: LatLon | null;
  pads: { vehicle: string; place: LatLon }[];
  bases: NamedPlace[];
  alternates: NamedPlace[];
  areas: GroundArea[];
  footprints: LatLon[][];
}

export interface PlannedVisit { segment: number; reversed: boolean; from_s: number; to_s: number }

/** A corner of a path: time, latitude, longitude, height over the depot, battery. */
export type Corner = [number, number, number, number, number];

export interface PlannedRoute {
  sortie: number;
  day: number;
  start_s: number;
  duration_s: number;
  energy_pct: number;
  visits: PlannedVisit[];
  track: Corner[];
}

export interface PlannedVehicle {
  name: string;
  budget_pct: number;
  routes: PlannedRoute[];
  /** Distance flown, height, and that of the ground where it is known. */
  profile: [number, number, number | null][];
}

export interface LeftOver { segment: number; why: string }

export interface PlanDocument {
  summary: PlanSummary;
  vehicles: PlannedVehicle[];
  uncovered: LeftOver[];
  lines: string[];
  windows?: DayWindow[];
}

export interface LossAnswer {
  routes: PlannedVehicle[];
  uncovered: LeftOver[];
  recovered: number;
  complete: boolean;
  seconds: number;
}

export interface Change { segment: number; vehicle?: string | null; reversed?: boolean | null; position?: number | null }

export interface ChangeAnswer {
  plan: PlanDocument;
  violations: string[];
  window_was: number | null;
  window_is: number | null;
}

export interface TryAnswer { answers: boolean; words: string }

/** What a flight came to; `report` is null while there is none. */
export interface FlightEntry {
  run: string;
  running: boolean;
  has_report: boolean;
  report: { finished: boolean; inspected: number; total: number; uncovered: string[]; duration_s: number | null; lost: string[] } | null;
}

/** The checklist, as before every flight. */
export interface Checklist { ready: boolean; checks: { severity: "ok" | "warning" | "stop"; subject: string; text: string }[] }

/** Of a day: from when on a vehicle may be lost for good. */
export interface DayWindow { vehicle: string; from_s: number; breaks: string | null }

export interface News { revision: number; checked: number; saved?: boolean; job: Job | null; tabs: number; chosen: string | null }

export type Edit =
  | { op: "set"; path: Path; value: Json }
  | { op: "unset"; path: Path }
  | { op: "add"; path: Path; value: Json; at?: number | null }
  | { op: "remove"; path: Path };

/** A part of the schema of the site file. */
export interface Schema {
  type?: string | string[];
  title?: string;
  description?: string;
  default?: Json;
  unit?: string;
  enum?: Json[];
  const?: Json;
  minimum?: number;
  maximum?: number;
  exclusiveMinimum?: number;
  maxLength?: number;
  pattern?: string;
  anyOf?: Schema[];
  $ref?: string;
  $defs?: Record<string, Schema>;
  items?: Schema;
  prefixItems?: Schema[];
  properties?: Record<string, Schema>;
  required?: string[];
}

