"""Who is told of a vehicle's messages, whichever library carries them."""

from __future__ import annotations

from collections.abc import Callable

from executor.core.interface.messages import Message


class Listeners:
    """Hands a vehicle's messages to everybody who listens."""

    def __init__(self) -> None:
        self._listeners: list[Callable[[Message], None]] = []

    def listen(self, listener: Callable[[Message], None]) -> Callable[[], None]:
        """Call `listener` with every message of the vehicle from now on; returns how to stop that."""
        self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    def hear(self, message: Message) -> None:
        """Hand a message on, be it one that did not come over this link and is about its vehicle."""
        for listener in tuple(self._listeners):
            listener(message)
