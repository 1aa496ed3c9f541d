"""How an operator, or the computer, ends the supervision of a flight."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Callable, Coroutine
from contextlib import suppress
from types import FrameType

from executor.adapters.interrupts import ENDS, SignalDebouncer, forget_terminal
from executor.core.interface.commands import Level
from executor.core.interface.events import ReturnAllOrdered
from executor.errors import PreflightFailed
from executor.flight.run_start import Console
from executor.runtime.flight_loop import Flight

LEAVE_AFTER_S = 5.0
"""Real seconds after the first Ctrl-C in which a second one still means 'send them home'."""
STAYS = "the vehicles go on with what they do, unless a GCS failsafe that is set on them acts"
LEFT = f"supervision ends; {STAYS}"


class Interrupts:
    """Ctrl-C: before the take-off it ends everything.

    Then once leaves the vehicles on their missions, twice sends them home, three times ends the supervision at once.
    SIGTERM, and a terminal that closes, are one Ctrl-C however often they come: nobody asks for a return with them.
    """

    def __init__(self, flight: Flight, console: Console) -> None:
        """Listen for the end of this flight's supervision, inside the block."""
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
                continue  # as nohup has it
            with suppress(NotImplementedError):
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
                signal.signal(number, before)  # what is done after the flight is interrupted as it was before

    async def run_unless_interrupted(self, work: Coroutine[None, None, None]) -> None:
        """Do what comes before the take-off.

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
        """Take a signal to end; several of them are one."""
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
            text = f"{self._how}: the vehicles stay on their missions; {self._repeat_hint} sends them home"
            self._console.say(Level.WARNING, text)
            self._timer = self._loop.call_later(LEAVE_AFTER_S, self._leave)
        else:
            self._timer.cancel()
            self._recalled = True
            self._flight.apply(ReturnAllOrdered())
            self._console.say(Level.WARNING, "once more ends the supervision; the vehicles come home by themselves")

    @property
    def _repeat_hint(self) -> str:
        within = f"within {LEAVE_AFTER_S:g} s"
        return f"once more {within}" if self._how == "Ctrl-C" else f"Ctrl-C {within}"

    def _leave(self) -> None:
        waits_for = self._flight.stop_supervising(at_once=self.left or self._recalled)
        self.left = True
        uploads = f"the upload to {' and '.join(waits_for)} has ended"
        text = f"supervision ends once {uploads}, Ctrl-C ends it at once; {STAYS}" if waits_for else LEFT
        self._console.say(Level.WARNING, text)
