"""Messages in JSON: objects of numbers, in any order and number."""

import json
from collections import defaultdict
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.recordings.bounds import first_line
from palpate.recordings.formats import Request
from palpate.recordings.messages.fields import LONGEST_LIST, UndecodableError
from palpate.recordings.messages.layout import Starts
from palpate.recordings.messages.topic import LOG_TIME, Found, ObjectTopic, stamp_of

_DEEPEST = 32
_SECONDS = ("sec", "secs", "seconds")
_NANOSECONDS = ("nsec", "nsecs", "nanosec", "nanos", "nanoseconds")
_LARGEST = 1 << 63


class JsonTopic(ObjectTopic):
    """A topic of JSON objects.

    Parameters
    ----------
    request : Request
        What is asked for.
    """

    def __init__(self, request: Request) -> None:
        super().__init__(request)
        self._wanted: dict[str, bool] = {}

    def decoded(self, message: bytes) -> Any:
        """Return a message as an object; raise UndecodableError where it is none."""
        try:
            found = json.loads(message)
        except (ValueError, RecursionError) as error:
            raise UndecodableError(f"it is no JSON: {first_line(error)[:60]}") from None
        if not isinstance(found, dict):
            raise UndecodableError(f"a JSON object was expected, not {type(found).__name__}")
        return found

    def take_objects(self, messages: list[Any], times: Starts) -> None:
        """Read decoded messages; and when each was logged."""
        values: dict[str, list[Any]] = defaultdict(list)
        rows: dict[str, list[int]] = defaultdict(list)
        found = self.found.get("", Found())
        for row, message in enumerate(messages, start=found.count):
            for path, value in self._numbers(message, "", found, 0):
                if self._asked(path):
                    values[path].append(value)
                    rows[path].append(row)
        if set(values) <= {stamp_of(values)}:
            return
        self.found[""] = found
        for path, numbers in values.items():
            found.extend({path: _column(numbers)}, np.array(rows[path]))
        found.extend({LOG_TIME: times}, slice(found.count, found.count + len(times)))
        found.count += len(times)

    def _asked(self, path: str) -> bool:
        if path not in self._wanted:
            self._wanted[path] = path == stamp_of((path,)) or self.request.wants(
                f"{self.name}.{path}"
            )
        return self._wanted[path]

    def _numbers(
        self, value: Any, path: str, found: Found, depth: int
    ) -> Iterator[tuple[str, int | float | bool]]:
        """Every number in a value, with its path."""
        if isinstance(value, int | float):
            yield path, value
        elif isinstance(value, dict):
            time = _time(value)
            if time is not None and path:
                found.times.add(path)
                yield path, time
            elif depth < _DEEPEST:
                for name, inner in value.items():
                    below = f"{path}.{name}" if path else name
                    yield from self._numbers(inner, below, found, depth + 1)
        elif isinstance(value, list):
            if len(value) > LONGEST_LIST:
                self.skipped.add(path)
            elif depth < _DEEPEST:
                for k, inner in enumerate(value):
                    yield from self._numbers(inner, f"{path}[{k}]", found, depth + 1)
        elif isinstance(value, str) and path.rpartition(".")[2] in ("frame_id", "parent_frame_id"):
            found.meet_frame(path, value[:200])


def _time(value: dict[str, Any]) -> int | None:
    """The nanoseconds of an object of seconds and nanoseconds; None where it is something else."""
    if len(value) != 2:
        return None
    seconds = next((value[name] for name in _SECONDS if name in value), None)
    rest = next((value[name] for name in _NANOSECONDS if name in value), None)
    if not isinstance(seconds, int) or not isinstance(rest, int):
        return None
    time = seconds * 1_000_000_000 + rest
    return time if abs(time) < _LARGEST else None


def _column(numbers: list[Any]) -> NDArray[Any]:
    kinds = set(map(type, numbers))
    if kinds == {bool}:
        return np.array(numbers, bool)
    if kinds == {int} and all(-_LARGEST <= number < _LARGEST for number in numbers):
        return np.array(numbers, np.int64)
    return np.array([_float(number) for number in numbers])


def _float(number: Any) -> float:
    try:
        return float(number)
    except OverflowError:
        return float("inf") if number > 0 else float("-inf")
