# Part of faultline.
"""Plans routes for a fleet within its budgets, and re-plans them when a vehicle is lost.

    >>> instance = build_instance(ends_m, landing_m, vehicles, travel)            # doctest: +SKIP
    >>> result = solve(instance, cost=Cost.MINCOMB, stop=Seconds(5))              # doctest: +SKIP
    >>> left = remaining(instance, result.plan, lost=1, at_s=300)                 # doctest: +SKIP
    >>> repaired = replan(left.instance, warm=left.warm, stop=FirstFeasible())    # doctest: +SKIP

Importing this package is cheap; the first plan, or ``warm_up``, loads the compiled kernels.
"""

from planner.bounds import least_earliest_s, why_certainly_impossible, why_impossible
from planner.carried import CarriedPlan, Worth, best_of, better, carried_plan, granted, worth
from planner.cost import BUDGET_TOLERANCE_PCT, K_C, Cost, CostFunction
from planner.energy import (
    CLIMB_SHARE_PER_M_S,
    PRESETS,
    Drone,
    pct_per_s,
    power_w,
    range_speed_m_s,
    top_speed_m_s,
    usable_wh,
)
from planner.errors import InstanceError, ParamsError, PlanError, PlannerError
from planner.evaluate import (
    Evaluation,
    completions_s,
    cost_value,
    evaluate,
    route_duration_s,
    route_energy_pct,
    spent_pct,
)
from planner.exact import EXACT_SEGMENTS, OPTIMAL_SEGMENTS, covers, solve_exact
from planner.front import FrontPlan, front
from planner.grasp import grasp
from planner.instance import build_instance
from planner.loss import LossRow, Repair
from planner.model import Instance, Plan, Route, Vehicle, is_reversed, segment_of, visit_of
from planner.moves import (
    Dynamics,
    MoveGeometry,
    Moves,
    MoveTables,
    SteadyWind,
    Travel,
    Visits,
    steady_wind,
    travel_for,
)
from planner.params import DEFAULT_PARAMS, AnnealingParams, ExactParams, LargeParams, SearchParams, WindowSearchParams
from planner.replan import FreeVehicle, Remainder, remaining, replan, warm_start
from planner.result import Result
from planner.risk import (
    Blame,
    Campaign,
    Chance,
    Chunk,
    Risk,
    Tally,
    flight_chunks,
    fly_chunk,
    risk_campaign,
    risks_of,
    wilson,
)
from planner.robust import solve_window
from planner.solve import solve, warm_up
from planner.stop import (
    AnyOf,
    Cancelled,
    FirstFeasible,
    Iterations,
    NoImprovement,
    Progress,
    Seconds,
    StopRule,
    StopVerdict,
    Stopwatch,
    any_of,
)
from planner.synthetic import generated_network
from planner.window import Breaking, LossRepair, ReplanWindow, WindowResult, loss_table, repairs_at, replan_window

__all__ = [
    "BUDGET_TOLERANCE_PCT",
    "CLIMB_SHARE_PER_M_S",
    "DEFAULT_PARAMS",
    "EXACT_SEGMENTS",
    "K_C",
    "OPTIMAL_SEGMENTS",
    "PRESETS",
    "AnnealingParams",
    "AnyOf",
    "Blame",
    "Breaking",
    "Campaign",
    "Cancelled",
    "CarriedPlan",
    "Chance",
    "Chunk",
    "Cost",
    "CostFunction",
    "Drone",
    "Dynamics",
    "Evaluation",
    "ExactParams",
    "FirstFeasible",
    "FreeVehicle",
    "FrontPlan",
    "Instance",
    "InstanceError",
    "Iterations",
    "LargeParams",
    "LossRepair",
    "LossRow",
    "MoveGeometry",
    "MoveTables",
    "Moves",
    "NoImprovement",
    "ParamsError",
    "Plan",
    "PlanError",
    "PlannerError",
    "Progress",
    "Remainder",
    "Repair",
    "ReplanWindow",
    "Result",
    "Risk",
    "Route",
    "SearchParams",
    "Seconds",
    "SteadyWind",
    "StopRule",
    "StopVerdict",
    "Stopwatch",
    "Tally",
    "Travel",
    "Vehicle",
    "Visits",
    "WindowResult",
    "WindowSearchParams",
    "Worth",
    "any_of",
    "best_of",
    "better",
    "build_instance",
    "carried_plan",
    "completions_s",
    "cost_value",
    "covers",
    "evaluate",
    "flight_chunks",
    "fly_chunk",
    "front",
    "generated_network",
    "granted",
    "grasp",
    "is_reversed",
    "least_earliest_s",
    "loss_table",
    "pct_per_s",
    "power_w",
    "range_speed_m_s",
    "remaining",
    "repairs_at",
    "replan",
    "replan_window",
    "risk_campaign",
    "risks_of",
    "route_duration_s",
    "route_energy_pct",
    "segment_of",
    "solve",
    "solve_exact",
    "solve_window",
    "spent_pct",
    "steady_wind",
    "top_speed_m_s",
    "travel_for",
    "usable_wh",
    "visit_of",
    "warm_start",
    "warm_up",
    "why_certainly_impossible",
    "why_impossible",
    "wilson",
    "worth",
]
