"""Fly many flights on paper at once: on this computer's processors, or on a Dask cluster; the result is the same.

The flights are split into chunks with their own random numbers (``planner.split_flights``), so the result does not
depend on which process flies a chunk, or when. The risk of one flight is one campaign; a sweep over mean times between
failures is several.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, Executor, Future, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

from executor.adapters.extras import Extra, require_extra
from executor.adapters.interrupts import defer_ctrl_c, end_children, start_worker_pool
from executor.errors import ConnectionFailed, ExecutorError
from planner import FlightChunk, RiskCampaign, split_flights

if TYPE_CHECKING:
    import distributed  # an extra; not needed on this computer alone

CONNECT_S = 5.0
"""Seconds to wait for a scheduler or its first worker."""

ProgressCallback = Callable[[int, int], None]
"""Called with the number of flights done and the total."""


CampaignT = TypeVar("CampaignT")
AnswerT = TypeVar("AnswerT")


@dataclass(frozen=True, slots=True)
class CampaignRunner:
    """Run the chunks of a campaign."""

    processes: int
    """Processes on this computer."""
    client: distributed.Client | None = None
    """Client of a Dask cluster to run on instead."""

    def __call__(
        self,
        flown: Callable[[CampaignT, FlightChunk], AnswerT],
        campaign: CampaignT,
        parts: Sequence[FlightChunk],
        told: ProgressCallback,
    ) -> list[AnswerT]:
        """Return the answer of each chunk, in order.

        Args:
            flown: Flies a chunk; a module-level function, so that another process can import it.
            campaign: The campaign.
            parts: Its chunks.
            told: Called after each chunk.

        Raises:
            ExecutorError: a process or a worker was lost.
        """
        total, done = sum(part.flights for part in parts), 0

        def count(part: FlightChunk) -> None:
            nonlocal done
            done += part.flights
            told(done, total)

        processes, jobs = min(self.processes, len(parts)), dict[Future[AnswerT], FlightChunk]()
        if self.client is None and processes == 1:
            answers = []
            for part in parts:
                answers.append(flown(campaign, part))
                count(part)
            return answers
        with start_worker_pool(processes) if self.client is None else _open_cluster(self.client) as pool:
            try:
                # Shared data is sent to each worker of a cluster once, not with each chunk.
                shared = campaign if self.client is None else self.client.scatter(campaign, broadcast=True)
                with defer_ctrl_c():
                    jobs |= {pool.submit(flown, shared, part): part for part in parts}
                for job in as_completed(jobs):
                    job.result()
                    count(jobs[job])
                return [job.result() for job in jobs]
            except KeyboardInterrupt:
                end_children()
                raise
            except BrokenProcessPool as error:
                raise ExecutorError(
                    "a process that flew a part of the flights has died; --jobs 1 needs the least"
                ) from error
            finally:
                for job in jobs:
                    job.cancel()


@contextmanager
def _open_cluster(client: distributed.Client) -> Iterator[Executor]:
    """Open a cluster's workers as if they were processes of this computer."""
    import distributed

    try:
        yield client.get_executor(pure=False)
    except (ImportError, OSError, distributed.KilledWorker, CancelledError) as error:
        raise ExecutorError(f"--dask: a worker failed: {type(error).__name__}: {error}") from error


@contextmanager
def open_campaign_runner(*, jobs: int | None, dask: str | None) -> Iterator[CampaignRunner]:
    """Open a runner of campaigns; it connects to a cluster at once, before anything is computed.

    Args:
        jobs: processes on this computer; None for one per processor.
        dask: address of a Dask scheduler, such as tcp://10.0.0.1:8786; None for this computer.

    Raises:
        ExtraMissing: the cluster's client is not installed.
        ConnectionFailed: the cluster does not answer.
    """
    if dask is None:
        yield CampaignRunner(jobs or os.cpu_count() or 1)
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
        yield CampaignRunner(0, client)


SWEEP = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
"""Factors on the given mean time between failures that a sweep evaluates."""
SWEEP_FLIGHTS = 2_000
"""Flights per factor; short times cause many losses, each with its own re-plan."""
SWEEP_CHUNK = 500


def sweep_mtbf(content: RiskCampaign, seed: int, *, flights: int) -> tuple[RiskCampaign, tuple[FlightChunk, ...]]:
    """Return a campaign over a range of mean times between failures around the given one, and its chunks.

    It shares the table of first losses, so its cost is that of its flights.
    """
    hours = tuple(factor * content.mtbf_h[0] for factor in SWEEP)
    return replace(content, mtbf_h=hours), split_flights(min(flights, SWEEP_FLIGHTS), seed, per_chunk=SWEEP_CHUNK)


def describe_policy(replans: int) -> str:
    """Return in words how many losses are re-planned."""
    if replans == 0:
        return "as planned, without a re-plan"
    return "re-planned after one loss" if replans == 1 else f"re-planned after up to {replans} losses"
