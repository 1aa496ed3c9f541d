"""PX4's ULog (.ulg) to our messages, on the vehicle's own clock (microseconds since its boot).

pyulog reads the file; only the topics that are used are kept, and of them only the rows that may say something new.
"""

from __future__ import annotations

import heapq
import io
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from typing import Any

from pyulog import ULog

from executor.adapters.logs.px4_vehicle import TOPICS, Px4Messages, Px4State, TopicReader, build_status_text
from executor.core.interface.messages import VehicleSetting
from executor.core.interface.recorded_log import Record, RecordedFile, is_wanted_setting
from executor.core.telemetry.plausibility import filter_implausible
from executor.errors import LogError

OF_EACH = frozenset({"sensor_gps"})
"""Topics of which each receiver has one: the first is read."""
LONGEST_USEC = 3 * 86400 * 1_000_000
"""No flight lasts longer: a time farther from the log's beginning is damaged. A simulated PX4 has the world's clock."""


@dataclass(slots=True)
class UlogFile(RecordedFile):
    """A .ulg being read."""

    def read_records(self) -> Iterator[Record]:
        """Yield what the log says, in the order of its time.

        Raises:
            LogError: not such a log at all.
        """
        try:
            # pyulog prints what it does not understand, which is no output of ours.
            with self.path.open("rb") as file, redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
                log = ULog(file, list(TOPICS))
        except Exception as error:
            raise LogError(f"{self.path}: expected a ULog of PX4: {error}") from error
        self.skipped.unreadable += bool(log.file_corruption)
        self.skipped.dropouts += len(log.dropouts)
        if not any(one.name == "vehicle_status" for one in log.data_list):
            self.notes.append("no vehicle_status in it: nobody knows in which mode it flew, or whether it was armed")
        system, vehicle, began_usec = _find_system(log), Px4State(), int(log.start_timestamp)
        streams = [
            self._read_rows(dataset, TOPICS[dataset.name], began_usec)
            for dataset in log.data_list
            if dataset.name not in OF_EACH or dataset.multi_id == 0
        ]
        for t_usec, read, row in heapq.merge(
            _read_settings(log, began_usec), _read_texts(log, began_usec), *streams, key=lambda one: one[0]
        ):
            try:
                told = read(vehicle, t_usec, row)
            except (KeyError, ValueError, TypeError, OverflowError):
                self.skipped.unreadable += 1
                continue
            for one in told if isinstance(told, tuple) else () if told is None else (told,):
                if (known := filter_implausible(one)) is not one:
                    self.skipped.impossible += 1
                if known is not None:
                    yield t_usec, system, known

    def _read_rows(self, dataset: Any, topic: TopicReader, began_usec: int) -> Iterator[_Turn]:  # noqa: ANN401 - pyulog is untyped
        """Yield the rows of a topic that may say something new."""
        data, times = dataset.data, dataset.data["timestamp"]
        changing = [data[name] for name in topic.changing if name in data]
        if topic.changing and not changing:
            return  # of a version in which another topic says it
        last_usec, last = -LONGEST_USEC, None
        for index in times.argsort(kind="stable"):  # in damaged files they are in any order
            t_usec = int(times[index])
            if not _is_near(t_usec, began_usec):
                self.skipped.impossible += 1
                continue
            if t_usec - last_usec < topic.every_usec and not self.every_record:
                continue
            if changing:
                state = tuple(column[index] for column in changing)
                if state == last:
                    continue
                last = state
            last_usec = t_usec
            yield t_usec, topic.read, _UlogRow(data, index)


@dataclass(frozen=True, slots=True)
class _UlogRow:
    """One row of a topic, whose fields are looked up when they are asked for."""

    columns: Mapping[str, Any]
    index: int

    def __getitem__(self, name: str) -> float:
        value: float = self.columns[name][self.index]
        return value

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def get(self, name: str, default: float) -> float:
        return self[name] if name in self.columns else default


_Turn = tuple[int, Callable[[Px4State, int, Any], Px4Messages], Any]
"""When it is whose turn to be read."""


def _is_near(t_usec: int, began_usec: int) -> bool:
    return t_usec > 0 and abs(t_usec - began_usec) <= LONGEST_USEC


def _find_system(log: ULog) -> int:
    for dataset in log.data_list:
        if dataset.name == "vehicle_status" and len(dataset.data.get("system_id", ())):
            return int(dataset.data["system_id"][-1]) or 1
    return int(log.initial_parameters.get("MAV_SYS_ID", 1))


def _read_texts(log: ULog, began_usec: int) -> Iterator[_Turn]:
    for text in sorted(log.logged_messages, key=lambda one: one.timestamp):
        if _is_near(text.timestamp, began_usec):
            yield int(text.timestamp), _convert_text, text


def _convert_text(_: Px4State, __: int, text: Any) -> Px4Messages:  # noqa: ANN401 - pyulog is untyped
    return build_status_text(text.log_level, str(text.message))


def _read_settings(log: ULog, began_usec: int) -> Iterator[_Turn]:
    told = [(began_usec, *one) for one in log.initial_parameters.items()]
    told += [(int(t_usec), name, value) for t_usec, name, value in log.changed_parameters]
    for t_usec, name, value in sorted(told, key=lambda one: one[0]):
        if is_wanted_setting(name) and _is_near(t_usec, began_usec) and math.isfinite(value):
            yield t_usec, _convert_setting, (name, float(value))


def _convert_setting(_: Px4State, __: int, named: tuple[str, float]) -> Px4Messages:
    return VehicleSetting(*named)
