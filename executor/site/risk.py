"""Many flights of one plan at once: on this computer's processors, or on a Dask cluster; the answer is the same.

The flights come in chunks with chance of their own (``planner.flight_chunks``). Who flies one, and when, changes
nothing.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Protocol

from executor.adapters.extras import Extra, need
from executor.adapters.interrupts import end_children, held_back
from executor.errors import ConnectionFailed, ExecutorError
from planner import Campaign, Chunk, Risk, Tally, flight_chunks, fly_chunk, risks_of

if TYPE_CHECKING:
    import distributed  # an extra; whoever flies here does without

CONNECT_S = 5.0
"""A scheduler or a first worker that is not there after so long is away."""
SWEEP = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
"""Times the given mean time between failures: where a sweep looks."""
SWEEP_FLIGHTS = 2_000
"""For each of them: short times mean many losses each, and so many different re-plans."""
SWEEP_CHUNK = 500

Done = Callable[[int, int], None]
"""Told how many flights of how many are done."""


Crew = Callable[[Campaign, Sequence[Chunk], Done], tuple[Risk, ...]]
"""Flies chunks and gives the answers for each of the campaign's ``mtbf_h``; it calls the last after each chunk.

It raises ExecutorError where a process or a worker was lost.
"""


class _Answer(Protocol):
    """What both kinds of futures can do."""

    def result(self) -> tuple[Tally, ...]:
        """Return the answer, or raise what was raised instead."""
        ...

    def __hash__(self) -> int:
        """Return the same for the same future."""
        ...


@contextmanager
def crew(*, jobs: int | None, dask: str | None) -> Iterator[Crew]:
    """Give what flies campaigns; a cluster is connected to at once, before anything is computed.

    Args:
        jobs: processes on this computer; None for one per processor.
        dask: address of a Dask scheduler, such as tcp://10.0.0.1:8786; None for this computer.

    Raises:
        ExtraMissing: the cluster's client is not installed.
        ConnectionFailed: the cluster is away.
    """
    if dask is None:
        yield partial(_here, jobs or os.cpu_count() or 1)
        return
    need(Extra.DASK, "--dask")
    import distributed

    try:
        client = distributed.Client(dask, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ConnectionFailed(f"--dask: no scheduler at {dask}; expected one such as tcp://10.0.0.1:8786") from error
    with client:
        try:
            client.wait_for_workers(1, timeout=CONNECT_S)
        except TimeoutError as error:
            raise ConnectionFailed(f"--dask: {dask} has no workers, expected one or more") from error
        yield partial(_on_cluster, client)


def sweep_mtbf(content: Campaign, seed: int, *, flights: int) -> tuple[Campaign, tuple[Chunk, ...]]:
    """Return a campaign over a range of times between failures around the given one, and its chunks.

    It shares the table of first losses, so what it costs are its flights.
    """
    hours = tuple(factor * content.mtbf_h[0] for factor in SWEEP)
    return replace(content, mtbf_h=hours), flight_chunks(min(flights, SWEEP_FLIGHTS), seed, per_chunk=SWEEP_CHUNK)


def _here(workers: int, content: Campaign, parts: Sequence[Chunk], on_done: Done) -> tuple[Risk, ...]:
    if min(workers, len(parts)) > 1:
        return _in_processes(workers, content, parts, on_done)
    tallies = []
    for part in parts:
        tallies.append(fly_chunk(content, part))
        on_done(sum(one.flights for one in parts[: len(tallies)]), sum(one.flights for one in parts))
    return risks_of(content, tallies)


def _in_processes(workers: int, content: Campaign, parts: Sequence[Chunk], on_done: Done) -> tuple[Risk, ...]:
    # Spawned: a process that numba's threads have been started in must not be forked.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(workers, len(parts)), mp_context=context) as pool:
        try:
            with held_back():
                futures = [pool.submit(fly_chunk, content, part) for part in parts]
            return risks_of(content, _gathered(futures, as_completed(futures), parts, on_done))
        except KeyboardInterrupt:
            end_children()
            raise
        except BrokenProcessPool as error:
            raise ExecutorError(
                "a process that flew a part of the flights has died; --jobs 1 needs the least"
            ) from error
        finally:
            pool.shutdown(cancel_futures=True)


def _on_cluster(
    client: distributed.Client, content: Campaign, parts: Sequence[Chunk], on_done: Done
) -> tuple[Risk, ...]:
    import distributed

    try:
        # The tables go to each worker once, not with each chunk.
        shared = client.scatter(content, broadcast=True)
        futures = client.map(fly_chunk, [shared] * len(parts), list(parts), pure=False)
        return risks_of(
            content, _gathered(futures, distributed.as_completed(futures, loop=client.loop), parts, on_done)
        )
    except (ImportError, OSError, distributed.KilledWorker, distributed.CancelledError) as error:
        raise ExecutorError(f"--dask: a worker failed: {type(error).__name__}: {error}") from error


def _gathered(
    futures: Sequence[_Answer], finished: Iterable[_Answer], parts: Sequence[Chunk], on_done: Done
) -> list[tuple[Tally, ...]]:
    size = {future: part.flights for future, part in zip(futures, parts, strict=True)}
    done = 0
    for future in finished:
        future.result()
        done += size[future]
        on_done(done, sum(size.values()))
    return [future.result() for future in futures]
