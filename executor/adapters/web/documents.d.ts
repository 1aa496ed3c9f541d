// Made by ./scripts/reference from the program's documents (DOCUMENTS in scripts/pages/page_types.py).

/** East and north of the depot, in metres. */
export type Place = [number, number];

/** A vehicle as the page gets it. */
export type Vehicle = VehicleView & BesideVehicle;

/** The flight at one moment, as the page gets it. */
export type State = Omit<FleetView, "vehicles"> & BesideFleet & { vehicles: Vehicle[] };

/** The flight at one moment. */
export interface FleetView {
  /** The flight's clock. */
  now_s: number;
  /** Since launch. */
  flight_s: number | null;
  revision: number;
  segments_total: number;
  inspected: number[];
  /** Segments not inspected in this flight: left over by the plan, or given up since. */
  uncovered: number[];
  /** Segments flown but not seen: pictures are missing. */
  missed: number[];
  replan: ReplanView | null;
  /** Whether no vehicle is received. */
  all_silent: boolean;
  recalled: boolean;
  finished: boolean;
  min_separation_m: number | null;
  vehicles: VehicleView[];
  /** The last decisions, oldest first. */
  said: OperatorLine[];
  /** The last ones, oldest first. */
  intents: IntentView[];
  /** The checklist, in the crew's reading order. */
  checks: Check[];
  /** The open question to the crew before the flight. */
  question: Question | null;
  offer: OfferView | null;
  /** For vehicles behind telemetry radios, once their load is measured. */
  radios: RadioView[];
}

/** Additions to the fleet's view in each state of the page. */
export interface BesideFleet {
  /** Speed-up: flight seconds per real second. */
  speedup: number;
  /** Seconds since the flight's last decision. */
  decided_age_s: number | null;
  /** Stamp of the routes; if it changes, there is a new `PageChart`. */
  chart: number[];
  /** Segments that count as inspected by evidence alone. */
  inferred: number[];
  /** Stamp of the assets; changes whenever `PageAssets` may have. */
  assets: number;
}

/** Additions to each vehicle's view on the page. */
export interface BesideVehicle {
  place_m: [number, number] | null;
  /** Waypoint of its route that it flies to. */
  waypoint: number;
}

/** `/chart`: data that seldom changes. */
export interface PageChart {
  chart: number[];
  /** Re-plan window of the first plan. */
  window: Window | null;
  /** Whether segments are inspected by pictures. */
  pictures: boolean;
  /** Segments, and the number of pictures that each needs. */
  assets: [number, number][];
  /** Name of each segment. */
  names: string[];
  /** Segments that are not part of this flight. */
  left_out: number[];
  /** Segments in an area, or behind one. */
  unreachable: number[];
  areas: PageArea[];
  segments_m: [[number, number], [number, number]][];
  vehicles: PageVehicle[];
}

/** `/assets`: all assets except open ones without a picture. */
export interface PageAssets {
  assets: number;
  rows: ([number, string, number, string | null])[];
}

/** `ground.json`. */
export interface GroundDocument {
  format: "faultline-ground/1";
  /** South-western corner, in metres east and north of the depot. */
  low_m: [number, number];
  high_m: [number, number];
  attribution: string;
  /** File of the picture. */
  photo: string | null;
  relief: HillshadePart | null;
  degrees: DegreesPart;
}

/** Workspace of the page. */
export interface WorkspaceAnswer {
  /** Grows with every change of the site. */
  revision: number;
  /** Last revision whose network and ground were read. Until it equals `revision`, `problems` covers the keys alone. */
  checked: number;
  /** Folder of the page; only files below it can be opened. */
  folder: string;
  site: SitePart | null;
  /** Values in the site file, without defaults. */
  values: Record<string, any>;
  problems: ProblemPart[];
  /** Name of the edit that undo would revert. */
  undo: string | null;
  redo: string | null;
  network: NetworkPart | null;
  /** Newest first. */
  plans: PlanSummary[];
  chosen: string | null;
  /** Search in progress, or the last one. */
  job: JobPart | null;
  /** Whether the planner is loaded; it is compiled once, which takes a while. */
  warm: boolean;
  /** Whether this state is saved in the site file. */
  saved: boolean;
  save_error: string | null;
  /** Number of browsers that follow the event stream. */
  tabs: number;
  /** Name under which an upload was saved. */
  uploaded: string | null;
}

/** Network as read. */
export interface NetworkAnswer {
  digest: string;
  source: string;
  format: string;
  crs: string;
  has_depot: boolean;
  frame: FramePart;
  segments: SegmentPart[];
  pylons: PylonPart[];
  /** Repairs and findings. */
  remarks: string[];
}

/** Surroundings of the network. */
export interface GroundAnswer {
  depot: [number, number] | null;
  pads: VehiclePadPart[];
  bases: BasePart[];
  places: PlacePart[];
  alternates: PlacePart[];
  areas: AreaPart[];
  footprints: FootprintPart[];
}

/** A plan in full. */
export interface PlanPart {
  summary: PlanSummary;
  vehicles: VehiclePart[];
  uncovered: LeftPart[];
  windows: LossWindow[];
  /** Lines that `faultline plan` prints. */
  lines: string[];
}

/** Routes of the survivors after a loss. */
export interface LossAnswer {
  /** Routes of all survivors: flown until the loss, and new. */
  routes: VehiclePart[];
  uncovered: LeftPart[];
  /** Spans that the survivors take over. */
  recovered: number;
  /** Whether the re-plan covers every segment. */
  complete: boolean;
  /** Duration of the re-plan. */
  seconds: number;
}

/** Plan that was changed by hand. */
export interface ChangeAnswer {
  plan: PlanPart;
  /** Reasons why the changed plan cannot be flown. */
  violations: string[];
  window_was: number | null;
  window_is: number;
}

/** Result of listening for a vehicle. */
export interface TryAnswer {
  answers: boolean;
  words: string;
}

/** A flight of this folder. */
export interface FlightPart {
  run: string;
  running: boolean;
  has_report: boolean;
  report: FlightReportPart | null;
}

/** `flight` in report.html: content of its map. */
export interface ReportMap {
  frame: ReportFrame | null;
  segments: ReportSegment[];
  areas: PageArea[];
  places: ReportPlace[];
  vehicles: ReportVehicle[];
  plans: ReportPlan[];
}

/** A re-plan under way. */
export interface ReplanView {
  revision: number;
  trigger: string;
  solving: boolean;
  /** Vehicles whose new mission is not on board yet. */
  pending: string[];
}

/** One vehicle. */
export interface VehicleView {
  name: string;
  sysid: number;
  /** ground, starting, flying, holding, pilot, returning, landing, landed, down or lost. */
  state: string;
  mode: string | null;
  armed: boolean;
  /** 0 is the lowest. */
  layer: number;
  /** Height of its layer over the lowest one. */
  layer_m: number;
  position: PositionView | null;
  battery: BatteryView;
  link_age_s: number | null;
  /** Share of frames lost in the last seconds. */
  link_loss: number | null;
  /** Each of its links, where it has several. */
  links: LinkView[];
  stale: boolean;
  progress: ProgressView;
  fault: string | null;
  fault_kind: string | null;
  fault_code: "link_lost" | "heartbeat_lost" | "position_lost" | "item_lost" | "battery_report_lost" | "battery_step" | "voltage_step" | "cell_weak" | "battery_critical" | "battery_failsafe" | "battery_plunge" | "battery_drift" | "pack_short" | "battery_low" | "disarmed" | "crashed" | "falling" | "sinking" | "thrust_lost" | "terminated" | "position_jump" | "mode_changed" | "fence_breached" | "stall" | "down" | "not_started" | "mission_foreign" | "mission_mixed" | "operator_land" | "camera_silent" | "camera_mute" | "card_full" | "gimbal_stuck" | "operator_exclude" | null;
  excluded: boolean;
  /** None while unknown, or where there is nothing to lose. */
  loss: LossView | null;
  /** Expected time until it is back on its pad; None if unknown. */
  lands_in_s: number | null;
  /** GPS_FIX_TYPE. */
  gps_fix: number | null;
  satellites: number | null;
  voltage_v: number | null;
  /** As the vehicle measures it. */
  wind: Wind | null;
  /** The party that controls it, if not this flight. */
  taken: TakenView | null;
  /** Whether it could take over segments, and waits for the crew's include. */
  offered: boolean;
  /** None in a flight of one sortie. */
  turn: TurnView | null;
}

/** A line for the operator, kept for later readers: a decision with its reason. */
export interface OperatorLine {
  at_s: number;
  level: "info" | "warning" | "fault";
  text: string;
}

/** An operator's intent and its outcome. */
export interface IntentView {
  id: string;
  action: string;
  vehicle: string | null;
  source: string;
  outcome: string;
  text: string;
  at_s: number;
  /** The question to confirm first; empty if there is none. */
  question: string;
}

/** One line of the checklist. */
export interface Check {
  severity: "ok" | "warning" | "stop";
  subject: string;
  text: string;
  code: "not_ready" | "firmware" | "vehicle_type" | "autopilot" | "double_sysid" | "armed" | "far_from_depot" | "pad_height" | "link_failsafe" | "watched_station" | "other_station" | "battery_failsafe" | "geofence" | "energy" | "pack" | "rtl_altitude" | "parameter_change" | "signing" | "radio" | "disk" | "separation" | "heights" | "clearance" | "camera" | "terrain" | "ceiling" | "areas" | "plan" | "left_over";
}

/** A question to the crew before the flight continues. */
export interface Question {
  /** prepare or take-off: the action that answers yes. */
  id: string;
  text: string;
  /** Details, line by line. */
  lines: string[];
}

/** Vehicles on the ground that could take over segments. */
export interface OfferView {
  vehicles: string[];
  /** Segments without a vehicle. */
  segments: number[];
  /** The pads that must be clear, and the purpose. */
  text: string;
}

/** A telemetry radio, as measured in the last seconds with all vehicles behind it. */
export interface RadioView {
  vehicles: string[];
  /** fine, congested or weak. */
  state: string;
  /** The reason; None if it is fine. */
  code: "buffer_full" | "at_capacity" | "round_trip_grown" | "signal_low" | "frames_lost" | null;
  /** Load and capacity, round trip and losses, in words. */
  text: string;
  bytes_s: number;
  capacity_bytes_s: number;
  round_trip_s: number | null;
  /** Share of frames lost; None while there are too few. */
  lost: number | null;
  /** Requested position rate of its vehicles. */
  positions_hz: number;
}

/** The re-plan window: the time from which the others can finish if any one vehicle is lost, or any two. */
export interface Window {
  /** Window as a share of the longest route. */
  window_pct: number;
  earliest_s: number;
  longest_route_s: number;
  /** Latest loss before it without a re-plan. */
  breaking: BreakingLoss | null;
  /** 2 if any two vehicles may be lost, one after the other or at once; None if any one may. */
  losses: 2 | null;
  /** Second loss without a re-plan after that one; None if that one alone has none. */
  then: BreakingLoss | null;
}

/** An area to avoid. */
export interface PageArea {
  name: string;
  /** Whether it is a height limit. */
  limit: boolean;
  outlines_m: [number, number][][];
}

/** A vehicle on the map. */
export interface PageVehicle {
  name: string;
  pad_m: [number, number];
  route: PageRoute | null;
  /** Track flown so far. */
  track_m: [number, number][];
}

/** The shape of the ground. */
export interface HillshadePart {
  file: string;
  interval_m: number;
  contours: Contour[];
  heights: GroundHeightsPart;
}

/** Where the local metres are: latitudes and longitudes of a lattice from corner to corner, the north first. */
export interface DegreesPart {
  rows: number;
  columns: number;
  lat_deg: number[];
  lon_deg: number[];
}

/** The site file. */
export interface SitePart {
  path: string;
  name: string;
  text: string;
}

/** Problem of the site. */
export interface ProblemPart {
  /** Site-file key that caused the problem, if known. */
  path: (string | number)[] | null;
  /** Same text as on the command line. */
  message: string;
}

/** The network of the site. */
export interface NetworkPart {
  /** Changes whenever the answer of `GET /api/network` changes. */
  digest: string;
  segments: number;
}

/** Plan in a list. */
export interface PlanSummary {
  id: string;
  /** File that `fly` takes; only the chosen plan has one. */
  file: string | null;
  /** Whether the site has changed since the plan was made. */
  stale: boolean;
  kind: "flight" | "day";
  longest_s: number;
  /** Battery used by each vehicle; for days, by all its sorties. */
  energy_pct: Record<string, number>;
  window_pct: number | null;
  window_from_s: number | null;
  /** Latest loss that no re-plan covers, just before the window. */
  breaking: BreakingLoss | null;
  /** Number of segments that no route covers. */
  uncovered: number;
  /** Cost function that chose the plan. */
  cost: string;
  value: number;
  /** Duration of the search. */
  seconds: number;
  /** Time at which the last vehicle has landed. */
  finish_s: number;
}

/** A search for plans. */
export interface JobPart {
  id: string;
  kind: "plan" | "front" | "day" | "left";
  state: "running" | "done" | "cancelled" | "failed";
  elapsed_s: number;
  limit_s: number;
  /** Cost of the best plan so far; null until there is one. */
  value: number | null;
  /** Segments that the best plan leaves out. */
  uncovered: number | null;
  /** Improvement over the first plan that left as few segments out. */
  better_pct: number | null;
  /** Time at which that first plan was found. */
  since_s: number | null;
  /** Time of the last improvement. */
  improved_s: number | null;
  error: string | null;
  /** Ids of the plans that the job made. */
  plans: string[];
}

/** Origin of local metres: the depot. */
export interface FramePart {
  lat_deg: number;
  lon_deg: number;
  alt_m: number;
}

/** A span. */
export interface SegmentPart {
  id: number;
  name: string;
  a: [number, number];
  b: [number, number];
  line: string;
  length_m: number;
  /** Whether the site leaves the segment out. */
  left_out: boolean;
  /** Reason why no flight can inspect the segment. */
  unreachable: string | null;
}

/** A pylon. */
export interface PylonPart {
  name: string;
  place: [number, number];
  height_m: number | null;
  elevation_m: number | null;
}

/** Pad of a vehicle. */
export interface VehiclePadPart {
  vehicle: string;
  place: [number, number];
}

/** A base of a day. */
export interface BasePart {
  name: string;
  place: [number, number];
  vehicles: string[];
}

/** A place of the site file. */
export interface PlacePart {
  name: string;
  kind: "pad" | "alternate";
  place: [number, number];
}

/** No-fly area, or area with a height limit. */
export interface AreaPart {
  /** Index of its table in the site file. */
  index: number;
  name: string | null;
  kind: "no-fly" | "corridor" | "height-limit";
  rings: [number, number][][];
  margin_m: number | null;
  from_file: boolean;
}

/** Footprint of one picture in the middle of a span. */
export interface FootprintPart {
  segment: number;
  camera: string;
  every_m: number;
  ring: [number, number][];
}

/** A vehicle of a plan. */
export interface VehiclePart {
  name: string;
  budget_pct: number;
  routes: RoutePart[];
  /** Height profile of the first sortie: metres flown, metres above the depot, and the ground's where a raster has it. */
  profile: ([number, number, number | null])[];
}

/** Span that no vehicle flies. */
export interface LeftPart {
  segment: number;
  name: string;
  why: string;
}

/** The time from which a vehicle may be permanently lost with everything inspected by the end of the last day. */
export interface LossWindow {
  vehicle: string;
  /** Seconds from the first midnight; 0 for any time. */
  from_s: number;
  /** Its last sortie, counted from 0, for whose loss no re-plan was found. */
  breaks: number | null;
}

/** Result of a flight. */
export interface FlightReportPart {
  finished: boolean;
  inspected: number;
  total: number;
  uncovered: string[];
  duration_s: number;
  lost: string[];
}

/** Origin of the local metres. */
export interface ReportFrame {
  lat_deg: number;
  lon_deg: number;
}

/** A segment on a report's map. */
export interface ReportSegment {
  name: string;
  ends_m: [[number, number], [number, number]];
  /** State on the map: done, inferred, missed, left-over, left-out or unreachable. */
  state: string;
  /** Vehicle that inspected it. */
  by: string | null;
  /** Time of the inspection; empty if unknown. */
  at: string;
  /** Vehicle that it was planned for when the flight began. */
  planned: string | null;
  /** Whether it was taken over from a lost vehicle. */
  taken_over: boolean;
}

/** Landing place other than a pad. */
export interface ReportPlace {
  /** Kind: base or alternate. */
  kind: string;
  name: string;
  place_m: [number, number];
}

/** A vehicle on a report's map. */
export interface ReportVehicle {
  name: string;
  pad_m: [number, number];
  /** Track in pieces, split where nothing was received. */
  flown_m: [number, number][][];
  lost: ReportLoss | null;
  end: ReportEnd | null;
}

/** First plan (for a day with all its sorties), or a re-plan. */
export interface ReportPlan {
  name: string;
  routes: ReportRoute[];
}

/** The position of a vehicle. */
export interface PositionView {
  lat_deg: number;
  lon_deg: number;
  /** Over its own home. */
  relative_alt_m: number;
  ground_speed_m_s: number;
  age_s: number;
  /** Position error; a lower bound for a dead-reckoned position. */
  accuracy_m: number | null;
  heading_deg: number | null;
  /** fix: with GPS. reckoned: GPS is lost, dead-reckoned since. unsaid: the vehicle has not reported its GPS. */
  known: string;
  /** For a dead-reckoned position, the last one with GPS: the place to begin a search. */
  last_fix: PlaceView | null;
}

/** A battery, in percent of a full one. A band should contain the actual value nine times in ten. */
export interface BatteryView {
  measured_pct: number | null;
  /** Modelled charge at present. */
  predicted_pct: number | null;
  predicted_band_pct: number | null;
  /** Energy still needed for the mission on board. */
  to_finish_pct: number;
  /** Expected charge at landing, from measurements. */
  landing_pct: number | null;
  landing_band_pct: number | null;
  reserve_pct: number;
}

/** One of a vehicle's links, as displayed. */
export interface LinkView {
  connection: string;
  /** Age of the last message; None if there was none. */
  heard_age_s: number | null;
  /** Share of frames lost in the last seconds. */
  loss: number | null;
  /** Whether commands and missions use it. */
  used: boolean;
}

/** The progress of a vehicle on its route. */
export interface ProgressView {
  /** Segments of its route behind it. */
  done: number;
  total: number;
  /** The segment that it inspects or flies to. */
  segment: number | null;
  /** The same by its asset's name. */
  segment_name: string | null;
  /** takeoff, transit, inspect, return or land. */
  phase: string | null;
  /** Share of the segment behind it, from 0 to 1. */
  segment_share: number | null;
  /** Segments it has inspected, on this route and earlier ones. */
  inspected: number;
}

/** The effect of a vehicle's loss. */
export interface LossView {
  /** Whether the others could still finish all segments but those left over anyway. */
  inside_window: boolean;
  /** Segments that they could not. */
  uncovered: number[];
  /** Age of the result. */
  age_s: number;
  /** Segments left over in any case: `uncovered` of the fleet. */
  left_over: number[];
}

/** WIND_COV of PX4, WIND of ArduPilot. */
export interface Wind {
  speed_m_s: number;
  /** Direction the wind comes from, clockwise from north. */
  from_deg: number;
}

/** A vehicle under another party's control: it is not commanded from here. */
export interface TakenView {
  /** On the flight's clock. */
  since_s: number;
  /** Time for which its segments are still reserved for it; 0 once reassigned. */
  kept_s: number;
  /** Whether its pilot has returned it to its mission: it may be included. */
  returned: boolean;
}

/** A vehicle at its base between two sorties, or on a later one. */
export interface TurnView {
  /** Id of its pack as entered by the crew; empty if none. */
  pack: string;
  /** The sortie under way, or the next, from 1. */
  sortie: number;
  /** Whether it waits for the crew's report of a pack change. */
  awaited: boolean;
  /** What it waits for, in words; empty for nothing. */
  text: string;
  /** Its base of the day; empty if the flight is no day of sorties. */
  base: string;
  /** Whether take-offs from there are closed. */
  base_closed: boolean;
  /** Charged packs there; None if they are not counted. */
  packs: number | null;
}

/** A loss that no re-plan can recover. */
export interface BreakingLoss {
  /** Vehicle name. */
  vehicle: string;
  from_s: number;
  to_s: number;
}

/** A route on board. */
export interface PageRoute {
  revision: number;
  places_m: [number, number][];
  /** Whether the leg to each waypoint is an inspection. */
  inspect: boolean[];
  segments: number[];
}

/** One contour line. */
export interface Contour {
  height_m: number;
  /** East and north. */
  places_m: [number, number][];
  bold: boolean;
}

/** The ground's heights above mean sea level in the middles of cells; the northernmost row first. */
export interface GroundHeightsPart {
  rows: number;
  columns: number;
  /** Heights row by row; null where unknown. */
  metres: (number | null)[];
}

/** A sortie. */
export interface RoutePart {
  sortie: number;
  day: number;
  start_s: number;
  duration_s: number;
  energy_pct: number;
  visits: VisitPart[];
  /** Corners of the route: seconds (for days, from the first midnight), latitude, longitude, metres above the depot, battery percent. */
  track: [number, number, number, number, number][];
}

/** Vehicle that was lost. */
export interface ReportLoss {
  /** Last GPS position. */
  place_m: [number, number];
  at: string;
  why: string;
}

/** Vehicle that did not return to its pad. */
export interface ReportEnd {
  /** Last reported position. */
  place_m: [number, number];
  state: string;
}

/** A route of a plan. */
export interface ReportRoute {
  vehicle: string;
  way_m: [number, number][];
}

/** A position of a vehicle, and its speed there. */
export interface PlaceView {
  lat_deg: number;
  lon_deg: number;
  /** Over its own home. */
  relative_alt_m: number;
  ground_speed_m_s: number;
  age_s: number;
  /** Position error; a lower bound for a dead-reckoned position. */
  accuracy_m: number | null;
}

/** A span of a route. */
export interface VisitPart {
  segment: number;
  /** Whether it is flown from end b to end a. */
  reversed: boolean;
  from_s: number;
  to_s: number;
}
