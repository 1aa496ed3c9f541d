// What the plan page and its server say to each other. Places are [latitude, longitude] in degrees. What the server
// answers stands in documents.d.ts, made from the program's own description of it.
import type {
  AreaPart, ChangeAnswer, FlightPart, GroundAnswer, JobPart, LossAnswer, LossWindow, NetworkAnswer, PlanPart, PlanSummary, ProblemPart,
  RoutePart, SegmentPart, TryAnswer, VehiclePart, VisitPart, WorkspaceAnswer,
} from "./documents.js";

export type { ChangeAnswer, LossAnswer, PlanSummary, TryAnswer };
/** As the page keeps it: without a key the path is empty. */
export type Problem = ProblemPart & { path: Path };
export type Job = JobPart;
export type Workspace = WorkspaceAnswer & { problems: Problem[] };
export type NetworkDocument = NetworkAnswer;
export type Segment = SegmentPart;
export type GroundPlaces = GroundAnswer;
export type GroundArea = AreaPart;
export type PlanDocument = PlanPart;
export type PlannedVehicle = VehiclePart;
export type PlannedRoute = RoutePart;
export type PlannedVisit = VisitPart;
export type FlightEntry = FlightPart;
export type DayWindow = LossWindow;
/** A corner of a path: time, latitude, longitude, height over the depot, battery. */
export type Corner = RoutePart["track"][number];

export type LatLon = [number, number];
export type Path = (string | number)[];
/** A table of the site file, or a value in one. */
export type Json = any;

export interface Change { segment: number; vehicle?: string | null; reversed?: boolean | null; position?: number | null }

/** The checklist, as before every flight. */
export interface Checklist { ready: boolean; checks: { severity: "ok" | "warning" | "stop"; subject: string; text: string }[] }

export interface News { revision: number; checked: number; saved?: boolean; job: Job | null; tabs: number; chosen: string | null; plans: string[] }

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

