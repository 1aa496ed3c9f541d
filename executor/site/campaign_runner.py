"""Many flights on paper at once: on this computer's processors, or on a Dask cluster; the answer is the same.

The flights come in parts with chance of their own (``planner.split_flights``, ``planner.sorties.split_samples``). Who
flies one, and when, changes nothing.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol, TypeVar

from executor.adapters.extras import Extra, require_extra
from executor.adapters.interrupts import defer_ctrl_c, end_children
from executor.adapters.worker_pool import start_worker_pool
from executor.errors import ConnectionFailed, ExecutorError

if TYPE_CHECKING:
    import distributed  # an extra; whoever flies here does without

CONNECT_S = 5.0
"""A scheduler or a first worker that is not there after so long is away."""

ProgressCallback = Callable[[int, int], None]
"""Told how many flights of how many are done."""


class Part(Protocol):
    """Some of a campaign's flights."""

    @property
    def flights(self) -> int:
        """Return how many."""
        ...


CampaignT = TypeVar("CampaignT")
PartT = TypeVar("PartT", bound=Part)
AnswerT = TypeVar("AnswerT")
AnswerT_co = TypeVar("AnswerT_co", covariant=True)


class CampaignRunner(Protocol):
    """Flies the parts of a campaign."""

    def __call__(
        self,
        flown: Callable[[CampaignT, PartT], AnswerT],
        campaign: CampaignT,
        parts: Sequence[PartT],
        told: ProgressCallback,
    ) -> list[AnswerT]:
        """Return the answer to each part, in their order.

        Args:
            flown: flies a part; a function of a module, so that another process finds it.
            campaign: what is flown.
            parts: of it.
            told: called after each part.

        Raises:
            ExecutorError: a process or a worker was lost.
        """
        ...


class _Answer(Protocol[AnswerT_co]):
    """What both kinds of futures can do."""

    def result(self) -> AnswerT_co:
        """Return the answer, or raise what was raised instead."""
        ...

    def __hash__(self) -> int:
        """Return the same for the same future."""
        ...


@contextmanager
def open_campaign_runner(*, jobs: int | None, dask: str | None) -> Iterator[CampaignRunner]:
    """Give what flies campaigns; a cluster is connected to at once, before anything is computed.

    Args:
        jobs: processes on this computer; None for one per processor.
        dask: address of a Dask scheduler, such as tcp://10.0.0.1:8786; None for this computer.

    Raises:
        ExtraMissing: the cluster's client is not installed.
        ConnectionFailed: the cluster is away.
    """
    if dask is None:
        yield _LocalRunner(jobs or os.cpu_count() or 1)
        return
    require_extra(Extra.DASK, "--dask")
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
        yield _DaskRunner(client)


class _LocalRunner:
    """Flies on this computer."""

    def __init__(self, processes: int) -> None:
        self._processes = processes

    def __call__(
        self,
        flown: Callable[[CampaignT, PartT], AnswerT],
        campaign: CampaignT,
        parts: Sequence[PartT],
        told: ProgressCallback,
    ) -> list[AnswerT]:
        """Fly in so many processes, or in this one."""
        processes = min(self._processes, len(parts))
        if processes > 1:
            return _run_in_processes(processes, flown, campaign, parts, told)
        answers, done = [], 0
        for part in parts:
            answers.append(flown(campaign, part))
            done += part.flights
            told(done, sum(one.flights for one in parts))
        return answers


def _run_in_processes(
    processes: int,
    flown: Callable[[CampaignT, PartT], AnswerT],
    campaign: CampaignT,
    parts: Sequence[PartT],
    told: ProgressCallback,
) -> list[AnswerT]:
    with start_worker_pool(processes) as pool:
        try:
            with defer_ctrl_c():
                futures = [pool.submit(flown, campaign, part) for part in parts]
            return _gather_answers(futures, as_completed(futures), parts, told)
        except KeyboardInterrupt:
            end_children()
            raise
        except BrokenProcessPool as error:
            raise ExecutorError(
                "a process that flew a part of the flights has died; --jobs 1 needs the least"
            ) from error
        finally:
            pool.shutdown(cancel_futures=True)


class _DaskRunner:
    """Flies on a Dask cluster."""

    def __init__(self, client: distributed.Client) -> None:
        self._client = client

    def __call__(
        self,
        flown: Callable[[CampaignT, PartT], AnswerT],
        campaign: CampaignT,
        parts: Sequence[PartT],
        told: ProgressCallback,
    ) -> list[AnswerT]:
        """Fly on its workers."""
        import distributed

        client = self._client
        try:
            # What is the same for all goes to each worker once, not with each part.
            shared = client.scatter(campaign, broadcast=True)
            futures = client.map(flown, [shared] * len(parts), list(parts), pure=False)
            return _gather_answers(futures, distributed.as_completed(futures, loop=client.loop), parts, told)
        except (ImportError, OSError, distributed.KilledWorker, distributed.CancelledError) as error:
            raise ExecutorError(f"--dask: a worker failed: {type(error).__name__}: {error}") from error


def _gather_answers(
    futures: Sequence[_Answer[AnswerT]],
    finished: Iterable[_Answer[AnswerT]],
    parts: Sequence[Part],
    told: ProgressCallback,
) -> list[AnswerT]:
    size = {future: part.flights for future, part in zip(futures, parts, strict=True)}
    done = 0
    for future in finished:
        future.result()
        done += size[future]
        told(done, sum(size.values()))
    return [future.result() for future in futures]
