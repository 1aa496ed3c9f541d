"""Wire the parts of one flight together, and end it on the operator's or the computer's signal; decides nothing."""

from __future__ import annotations

import asyncio
import gc
import signal
from collections.abc import Callable, Coroutine, Mapping, Sequence
from contextlib import AbstractAsyncContextManager, nullcontext
from functools import partial
from pathlib import Path
from types import FrameType

from executor import supervised
from executor.adapters.clock import SystemClock
from executor.adapters.eventlog import EventLog
from executor.adapters.interrupts import ENDS, SignalDebouncer, forget_terminal
from executor.adapters.run_directory import RunDirectory, lock_run_directory, today
from executor.adapters.solver import SolverProcess, SolverSetup
from executor.analysis.documents import FlightReport
from executor.analysis.report import build_report, build_vehicle_answers
from executor.core import fleet_step
from executor.core.context import Context
from executor.core.fleet_view import build_fleet_view
from executor.core.imaging.asset_status import build_asset_views, list_asked_pictures
from executor.core.interface.codes import Check, Severity
from executor.core.interface.commands import Level, Say
from executor.core.interface.events import Asked, IntentReceived, Reopened, ReturnAllOrdered
from executor.core.interface.intents import Action
from executor.core.interface.ports import OpenLink
from executor.core.preflight.fence_changes import OnboardLists
from executor.core.preflight.parameter_changes import ParameterProposal
from executor.core.state.fleet_state import FleetState
from executor.core.state.onboard_fence import build_first_fences
from executor.core.state.vehicle_parts import OnboardMission
from executor.errors import PreflightFailed
from executor.flight import preparation
from executor.flight.flight_recorder import FlightRecorder, FlightSession, read_plan_in_force
from executor.flight.open_links import follow_fleet_time, open_links
from executor.flight.publication import Publication, check_web, serve_page
from executor.flight.restore_vehicles import build_parameter_rows, restore_board
from executor.flight.run_start import Console, FlightRequest
from executor.images.index_files import build_image_index, write_index
from executor.runtime.flight_loop import Flight, keep_judging
from executor.site import day_plans
from executor.site.learned_files import build_flown_packs, learn_from_flight
from executor.site.plan_summary import describe_routes, summarise_plan
from executor.site.site_model import SiteModel
from missions import build_plan_document
from missions.fences import Fence

LEAVE_AFTER_S = 5.0
"""Real seconds after the first Ctrl-C within which a second one still means RTL for all."""
STAYS = "the vehicles continue what they are doing, unless their GCS failsafe acts"
LEFT = f"supervision ends; {STAYS}"


class Interrupts:
    """Handle Ctrl-C: before the take-off it ends everything.

    In flight, once leaves the vehicles on their missions, twice orders RTL for all, three times ends supervision at
    once. SIGTERM and SIGHUP (a closed terminal) count as one Ctrl-C however often they come: they never mean RTL.
    """

    def __init__(self, flight: Flight, console: Console) -> None:
        """Handle the signals that end this flight's supervision, inside the block."""
        self._flight = flight
        self._console = console
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._recalled = False
        self._declined = asyncio.Event()
        self._how = "Ctrl-C"
        self._once = SignalDebouncer()
        self._before: dict[int, Callable[[int, FrameType | None], object] | int | None] = {}
        self.left = False

    def __enter__(self) -> Interrupts:
        for number in (signal.SIGINT, *ENDS):
            before = signal.getsignal(number)
            if before is signal.SIG_IGN and number in ENDS:
                continue  # as under nohup
            self._loop.add_signal_handler(
                number, self._on_interrupt if number == signal.SIGINT else self._on_signal, number
            )
            self._before[number] = before
        return self

    def __exit__(self, *_: object) -> None:
        if self._timer is not None:
            self._timer.cancel()
        for number, before in self._before.items():
            self._loop.remove_signal_handler(number)
            if before is not None:
                signal.signal(number, before)  # after the flight, signals act as before it

    async def run_unless_interrupted(self, work: Coroutine[None, None, None]) -> None:
        """Run a coroutine before the take-off.

        Raises:
            PreflightFailed: the operator, or the computer, ended it before it was done.
        """
        task, pressed = asyncio.ensure_future(work), asyncio.ensure_future(self._declined.wait())
        try:
            await asyncio.wait({task, pressed}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            pressed.cancel()
            ended = task.done()
            if not ended:
                task.cancel()
                await asyncio.gather(task, return_exceptions=True)
        if not ended:
            raise PreflightFailed(f"{self._how}: nothing has moved")
        await task

    def _on_signal(self, number: int) -> None:
        """Handle a signal; repeated ones count as one."""
        forget_terminal()
        if not self._once.is_first():
            return
        self._how = signal.Signals(number).name
        if self._flight.state.progress.launched_s is None or self._timer is None or self._recalled:
            self._on_interrupt(number)

    def _on_interrupt(self, _: int) -> None:
        if self._flight.state.progress.launched_s is None:
            self._declined.set()
        elif self._recalled or self.left:
            self._leave()
        elif self._timer is None:
            again = "once more" if self._how == "Ctrl-C" else "Ctrl-C"
            stay = f"the vehicles stay on their missions; {again} within {LEAVE_AFTER_S:g} s commands RTL to all"
            text = f"{self._how}: {stay}"
            self._console.say(Level.WARNING, text)
            self._timer = self._loop.call_later(LEAVE_AFTER_S, self._leave)
        else:
            self._timer.cancel()
            self._recalled = True
            self._flight.apply(ReturnAllOrdered())
            self._console.say(Level.WARNING, "once more ends the supervision; the vehicles return by themselves")

    def _leave(self) -> None:
        waits_for = self._flight.stop_supervising(at_once=self.left or self._recalled)
        self.left = True
        uploads = f"the upload to {' and '.join(waits_for)} has ended"
        text = f"supervision ends once {uploads}, Ctrl-C ends it at once; {STAYS}" if waits_for else LEFT
        self._console.say(Level.WARNING, text)


async def run_flight(request: FlightRequest, console: Console) -> FlightReport:
    """Connect, check, upload, fly and report.

    Raises:
        ExecutorError: a vehicle does not answer, or a check fails; nothing has moved then.
    """
    load_optional_parts(request)
    solver = make_solver_process(request, console)
    with (
        lock_run_directory(request.run),
        supervised.watch_internal_errors(lambda text: console.say(Level.FAULT, text), request.run),
    ):
        async with follow_fleet_time(request.site, console) as fleet:
            clock = SystemClock.start_on(request.site.flight.speedup, fleet.steady_s)
            async with open_links(request, clock) as links, solver:
                return await _check_and_supervise(request, console, clock, solver, links)


def load_optional_parts(request: FlightRequest) -> None:
    """Load optional parts before anything is connected: no vehicle would be heard during the import.

    Raises:
        SiteError: as `check_web`.
    """
    check_web(request.site.web)
    if request.mqtt is not None:
        import executor.adapters.mqtt.publisher  # noqa: F401 - loaded here, used later


def make_solver_process(request: FlightRequest, console: Console) -> SolverProcess:
    """Return the solver of a flight, not started yet."""
    setup = SolverSetup(request.site.flight.solve_s, request.plan.solved.seed)
    return SolverProcess(setup, partial(console.say, Level.WARNING))


async def _check_and_supervise(
    request: FlightRequest,
    console: Console,
    clock: SystemClock,
    solver: SolverProcess,
    links: Mapping[str, OpenLink],
) -> FlightReport:
    run = request.run
    facts = await preparation.interview_vehicles(request, links, clock, console)
    context, boards, found = preparation.build_context_and_checklist(request, facts)
    lists = await preparation.read_fences(context, links, clock)
    found += preparation.check_fences_on_board(context, facts, boards, lists, run)
    console.show_checks(found)
    try:
        _raise_on_stop(found)
        proposal = await preparation.read_changes(context, links, clock)
        console.show_checks(proposal.checks)
        _raise_on_stop(proposal.checks)
    except PreflightFailed:
        await restore_board(run, links, clock, console)  # of an earlier attempt in this directory
        raise
    found += proposal.checks
    fences = build_first_fences(context, boards)
    state = fleet_step.build_initial_state(
        boards,
        tuple(found),
        fences,
        {} if request.day is None else day_plans.sorties_ahead_of(request.day),
    )
    log = EventLog(
        RunDirectory(run).events,
        began_unix_s=clock.began_unix_s,
        speedup=clock.speedup,
        told=partial(console.say, Level.WARNING),
    )
    said = partial(build_vehicle_answers, context, facts, found, request.earlier)
    seat = FlightSession(request, console, context, state, links, clock, log, solver, said)
    flown: FlightReport | None = None
    try:
        flown = await supervise(seat, partial(_prepare_launch, seat, proposal, boards, found, fences, lists))
    except PreflightFailed:
        RunDirectory(run).events.unlink(missing_ok=True)  # there is nothing to resume
        raise
    finally:
        if flown is None:
            # Restore everything for a flight that does not take off; a vehicle that flies anyway is armed, and is left
            # alone.
            await restore_board(run, links, clock, console)
    return flown


def _raise_on_stop(found: Sequence[Check]) -> None:
    stops = [check for check in found if check.severity is Severity.STOP]
    if stops:
        raise PreflightFailed(f"{stops[0].subject}: {stops[0].text}")


async def _prepare_launch(
    seat: FlightSession,
    proposal: ParameterProposal,
    boards: Mapping[str, OnboardMission | None],
    found: list[Check],
    fences: Mapping[str, Fence],
    lists: Mapping[str, OnboardLists],
    flight: Flight,
) -> None:
    """Show the flight's changes on board, ask, set them, upload the missions, and ask for the take-off.

    Args:
        seat: The flight session.
        proposal: Parameters to set.
        boards: First missions.
        found: Checklist so far, which grows.
        fences: Fences to upload.
        lists: Fence and rally lists on board each vehicle that was queried.
        flight: The flight.

    Raises:
        PreflightFailed: the operator did not confirm, or an upload failed.
    """
    request, console, context, links, clock = seat.request, seat.console, seat.context, seat.links, seat.clock
    fence_lines = preparation.describe_fence_changes(context, fences, lists)
    if proposal.changes or fence_lines:
        text = preparation.compose_changes_question(proposal, fences=len(fence_lines))
        told = [*fence_lines, *(f"{change.vehicle}: {change.words_set}" for change in proposal.changes)]
        if not await _ask_crew(flight, console, Action.PREPARE, text, told):
            raise PreflightFailed("not confirmed; nothing was changed on board")
    found.extend(await preparation.apply_changes(request.run, proposal, context, links, clock, console))
    # Before the missions: PX4 checks a mission against the fence on board.
    await preparation.upload_wanted_lists(request.run, context, links, clock, fences, lists, console)
    await preparation.upload_first_missions(context, links, clock, boards, console)
    seat.said().write(RunDirectory(request.run).vehicles)
    later = [] if request.day is None else day_plans.describe_later_sorties(request.day)
    text = f"All missions are on board, verified by read-back: {summarise_plan(request.plan)}. Take off?"
    if not await _ask_crew(flight, console, Action.TAKE_OFF, text, (*describe_routes(request.plan), *later)):
        raise PreflightFailed("not confirmed; nothing has moved")


async def _ask_crew(flight: Flight, console: Console, action: Action, text: str, lines: Sequence[str] = ()) -> bool:
    """Ask the crew, in the terminal and on the page; the first answer counts."""
    flight.apply(Asked(action.value, text, tuple(lines)))
    answers = {asyncio.ensure_future(console.ask(text)), asyncio.ensure_future(flight.wait_for_yes(action))}
    try:
        done, _ = await asyncio.wait(answers, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for answer in answers:
            answer.cancel()
    return any(answer.result() for answer in done)


async def supervise(
    seat: FlightSession, begins: Callable[[Flight], Coroutine[None, None, None]] | Reopened
) -> FlightReport:
    """Prepare and launch a flight, or resume an interrupted one; supervise it to its end.

    Raises:
        PreflightFailed: the operator did not confirm.
        ConnectionFailed: in an exception group, if no vehicle answers when a flight is resumed.
    """
    request, console, context, clock, links = seat.request, seat.console, seat.context, seat.clock, seat.links
    publication = Publication(request.mqtt, request.run, clock)
    keeper = FlightRecorder(seat, publication)
    revision = seat.state.replanning.revision
    publication.publish(
        lambda to: to.publish_plan(revision, build_plan_document(read_plan_in_force(request, revision)))
    )
    flight = Flight(context, seat.state, links, clock, seat.log, seat.solver, keeper.build_observer())
    hearing = supervised.watch_internal_errors(
        lambda text: keeper.show_notice(Say(Level.FAULT, text), clock.now_s()), request.run
    )
    try:
        reopened = begins if isinstance(begins, Reopened) else None
        listening = flight.listen_to_vehicles() if reopened is None else nullcontext()
        with hearing, listening, Interrupts(flight, console) as interrupts:
            async with (
                serve_page(request.site.web, flight, clock, console, request),
                _publish_flight(publication, flight, keeper, clock),
            ):
                gc.collect()  # 0.1 s for a hundred vehicles: not between the crew's yes and the take-off
                if not isinstance(begins, Reopened):
                    await interrupts.run_unless_interrupted(begins(flight))
                gc.freeze()  # one collection over all objects from before the flight takes 0.1 s
                async with supervised.run_beside("judging losses", partial(keep_judging, flight, seat.solver.judge)):
                    await flight.run(reopened, request.site.flight.connect_timeout_s)
                    await keeper.settle()
    finally:
        gc.unfreeze()
        console.stop_drawing()
        seat.log.close()
    ended_s = clock.now_s()
    given_back, _ = await restore_board(request.run, links, clock, console)
    frames = {name: link.counts for name, link in links.items()}
    report = build_report(
        context, flight.state, ended_s, request.truths(clock), frames, seat.said(), build_parameter_rows(given_back)
    )
    for line in write_results(request.run, request.ground, context, flight.state, report, clock.began_unix_s):
        console.say(Level.WARNING, line)
    return report


def write_results(
    run: Path, ground: SiteModel, context: Context, state: FleetState, report: FlightReport, began_unix_s: float
) -> list[str]:
    """Write the report of a flight and the files with it; return the write errors in words.

    The report comes last: the resumption of a flight that has one writes nothing more.
    """
    kept, learned = RunDirectory(run), learn_from_flight(context, state, ground.learned, today())
    writes: dict[str, Callable[[], None]] = {"learned.json": partial(learned.write, kept.learned)}
    if context.setup.looks:
        writes["images"] = partial(write_index, run, build_image_index(context, state, began_unix_s))
    if report.sorties:
        writes["packs.json"] = partial(build_flown_packs(state, run.name, began_unix_s).write, kept.packs)
    writes["report.json"] = partial(report.write, kept.report)
    failed = []
    for name, write in writes.items():
        try:
            write()
        except OSError as error:
            failed.append(f"{name} cannot be written: {error.strerror}")
    return failed


def _publish_flight(
    publication: Publication, flight: Flight, keeper: FlightRecorder, clock: SystemClock
) -> AbstractAsyncContextManager[None]:
    context, looks = flight.context, flight.context.setup.looks
    asked = list_asked_pictures(context) if looks else {}
    return publication.run(
        view=lambda: build_fleet_view(flight.context, flight.state, clock.now_s(), flight.describe_links),
        accept=lambda intent: flight.apply(IntentReceived(intent)),
        tell=lambda level, text: keeper.show_notice(Say(level, text), clock.now_s()),
        assets=(lambda: build_asset_views(context, flight.state, asked)) if looks else None,
    )
