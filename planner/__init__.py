# Part of faultline.
"""Plan routes for a fleet within its budgets, and re-plan them when a vehicle is lost.

    >>> instance = build_instance(ends_m, landing_m, vehicles, travel)            # doctest: +SKIP
    >>> result = solve(instance, cost=Cost.MINCOMB, stop=Seconds(5))              # doctest: +SKIP
    >>> left = build_remaining_problem(instance, result.plan, lost=1, at_s=300)   # doctest: +SKIP
    >>> repaired = replan(left.instance, warm=left.warm, stop=FirstFeasible())    # doctest: +SKIP

Importing this package is cheap; the first plan, or ``warm_up``, loads the compiled kernels.
"""

from planner.coverage import solve_coverage
from planner.energy import CLIMB_SHARE_PER_M_S, PRESETS, Drone, pct_per_s, power_w, top_speed_m_s
from planner.errors import InstanceError, PlanError, PlannerError
from planner.evaluate import (
    Cost,
    ReplanWindow,
    Result,
    completion_times_s,
    evaluate,
    route_duration_s,
    route_energy_pct,
)
from planner.exact import solve_exact
from planner.grasp import solve_grasp
from planner.model import Instance, Plan, Route, Vehicle, build_instance, is_reversed, segment_of, visit_of
from planner.moves import Moves, MoveTables, SteadyWind, Travel, Visits, build_steady_wind, travel_for
from planner.params import DEFAULT_PARAMS, SearchParams
from planner.replan import (
    OnboardPlan,
    RemainingProblem,
    build_onboard_plan,
    build_remaining_problem,
    grant_onboard_budgets,
    rate_plan,
    replan,
    select_best_plan,
    warm_start,
)
from planner.risk import (
    FlightChunk,
    RiskCampaign,
    RiskEstimate,
    build_risk_campaign,
    estimate_coverage,
    estimate_risks,
    simulate_chunk,
    split_flights,
)
from planner.solve import solve, warm_up
from planner.stop_rules import (
    Cancelled,
    FirstFeasible,
    Iterations,
    NoImprovement,
    Progress,
    Seconds,
    StopRule,
    Stopwatch,
    combine_stop_rules,
)
from planner.window import find_repairs_at, replan_window
from planner.window_search import ParetoPlan, find_pareto_front, solve_window
