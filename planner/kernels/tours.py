"""Single routes: their energy, changes to them, the best directions of their visits."""

from __future__ import annotations

from planner.kernels.arrays import IntTable, Problem, State
from planner.kernels.compiled import inner, kernel


@kernel()
def measure(problem: Problem, state: State, route: int) -> None:
    """Set the legs and the load of a route from its visits, and enter the route of their segments."""
    length = state.lengths[route]
    legs = state.legs[route]
    visits = state.visits[route]
    if length == 0:
        legs[0] = problem.idle[route]
        state.loads[route] = legs[0]
        return
    move = problem.move[problem.profile[route]]
    legs[0] = problem.start[route, visits[0]]
    load = legs[0]
    state.route_of[visits[0] >> 1] = route
    for position in range(1, length):
        legs[position] = problem.consumption[route] * move[visits[position - 1], visits[position]]
        load += legs[position]
        state.route_of[visits[position] >> 1] = route
    legs[length] = problem.home[route, visits[length - 1]]
    state.loads[route] = load + legs[length]


@kernel()
def insert(problem: Problem, state: State, route: int, position: int, visit: int) -> None:
    """Put a visit into a route and bring legs and load up to date."""
    length = state.lengths[route]
    visits = state.visits[route]
    legs = state.legs[route]
    consumption = problem.consumption[route]
    move = problem.move[problem.profile[route]]
    before = legs[position]
    for place in range(length, position, -1):
        visits[place] = visits[place - 1]
        legs[place + 1] = legs[place]
    visits[position] = visit
    if position == 0:
        legs[0] = problem.start[route, visit]
    else:
        legs[position] = consumption * move[visits[position - 1], visit]
    if position == length:
        legs[position + 1] = problem.home[route, visit]
    else:
        legs[position + 1] = consumption * move[visit, visits[position + 1]]
    state.lengths[route] = length + 1
    state.loads[route] += legs[position] + legs[position + 1] - before
    state.route_of[visit >> 1] = route


@kernel()
def copy_route(source: State, target: State, route: int) -> None:
    """Copy one route; ``route_of`` is the caller's."""
    length = source.lengths[route]
    target.lengths[route] = length
    target.loads[route] = source.loads[route]
    for position in range(length):
        target.visits[route, position] = source.visits[route, position]
        target.legs[route, position] = source.legs[route, position]
    target.legs[route, length] = source.legs[route, length]


@inner()
def copy_owners(source: State, target: State) -> None:
    """Copy which route visits a segment."""
    for segment in range(len(source.route_of)):
        target.route_of[segment] = source.route_of[segment]


@kernel()
def copy_all(source: State, target: State) -> None:
    """Copy all routes."""
    for route in range(len(source.lengths)):
        copy_route(source, target, route)
    copy_owners(source, target)


@inner()
def total_excess(problem: Problem, state: State) -> float:
    """Return what routes with a visit spend beyond their budgets."""
    total = 0.0
    for route in range(len(state.lengths)):
        if state.lengths[route] > 0:
            total += max(0.0, state.loads[route] - problem.budget[route])
    return total


@kernel()
def orient_visits(problem: Problem, state: State, route: int, came_from: IntTable) -> None:
    """Give the visits of a route the directions that are best together, their order kept.

    A two-state dynamic program (Vidal 2017, doi 10.1287/opre.2017.1595). ``came_from`` is (n, 2) int64 of work space.
    """
    length = state.lengths[route]
    if length == 0:
        return
    visits = state.visits[route]
    consumption = problem.consumption[route]
    move = problem.move[problem.profile[route]]
    first = visits[0] & ~1
    forward = problem.start[route, first]
    backward = problem.start[route, first + 1]
    for position in range(1, length):
        before = visits[position - 1] & ~1
        visit = visits[position] & ~1
        forward_forward = forward + consumption * move[before, visit]
        backward_forward = backward + consumption * move[before + 1, visit]
        forward_backward = forward + consumption * move[before, visit + 1]
        backward_backward = backward + consumption * move[before + 1, visit + 1]
        came_from[position, 0] = int(backward_forward < forward_forward)
        came_from[position, 1] = int(backward_backward < forward_backward)
        forward = min(forward_forward, backward_forward)
        backward = min(forward_backward, backward_backward)
    last = visits[length - 1] & ~1
    forward += problem.home[route, last]
    backward += problem.home[route, last + 1]
    if min(forward, backward) >= state.loads[route]:
        return
    direction = int(backward < forward)
    for position in range(length - 1, -1, -1):
        visits[position] = (visits[position] & ~1) + direction
        if position > 0:
            direction = came_from[position, direction]
    measure(problem, state, route)
