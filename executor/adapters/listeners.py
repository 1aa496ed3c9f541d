"""Pass a vehicle's messages to listeners, whichever library carries them."""

from __future__ import annotations

from collections.abc import Callable

from executor.core.interface.messages import Message


class Listeners:
    """Listeners to a vehicle's messages."""

    def __init__(self) -> None:
        self._listeners: list[Callable[[Message], None]] = []

    def listen(self, listener: Callable[[Message], None]) -> Callable[[], None]:
        """Call `listener` with every further message of the vehicle; return a function that stops it."""
        self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    def hear(self, message: Message) -> None:
        """Pass a message to the listeners, even one about the vehicle that came over another link."""
        for listener in tuple(self._listeners):
            listener(message)
