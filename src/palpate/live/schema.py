"""What a live run publishes: all messages are made from the definitions in ``messages``.

An estimate, ``ContactEstimate.msg``, goes out for every sample, a status, ``ContactStatus.msg``,
five times a second. Their fields have the same names and units on every wire, in the page's JSON,
in ``ros``, and in ``docs/reference/wires.md``, which ``docs/write_reference.py`` writes.
"""

import json
import math
import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from palpate.digits import parameter
from palpate.errors import PalpateError
from palpate.findings import MARKS, Check, Mark, loop_checks
from palpate.live.choices import State
from palpate.live.ring import MOST_PARAMETERS
from palpate.live.sinks import PLACE, diagnosis_fields, unpack_parameters
from palpate.live.view import LiveVerdict, verdict_on
from palpate.validation import Floats, frozen, or_nan, plain, shown

#: Version of the messages, as in ``ContactEstimate.msg``.
SCHEMA = 4
#: s: numbers whose newest sample is older are not usable.
OLDEST_USABLE = 1.0


@frozen
class PublishedField:
    """A field of a message.

    Attributes
    ----------
    name : str
        Its name on every wire.
    kind : str
        Its type as in a ROS message; of a status ``float64``, ``string`` or ``float64[]``.
    meaning : str
        What it says, with its unit.
    """

    name: str
    kind: str
    meaning: str


@cache
def message_definition(name: str = "ContactEstimate") -> str:
    """Return a definition in the folder ``messages``."""
    return (Path(__file__).parent / "messages" / f"{name}.msg").read_text(encoding="utf-8")


def _read_fields(name: str) -> tuple[PublishedField, ...]:
    lines = re.findall(r"^(\S+) (\w+) +# (.*)$", message_definition(name), re.MULTILINE)
    return tuple(PublishedField(name, kind, meaning) for kind, name, meaning in lines)


#: Fields of an estimate, in the order of the binary message, after ROS's header.
ESTIMATE_FIELDS = _read_fields("ContactEstimate")[1:]
#: Fields that only a status has.
STATUS_FIELDS = _read_fields("ContactStatus")
_COUNTED = ("lost", "repeated", "disordered", "malformed", "unpaired", "refused")
_ARRAY = f"float64[{MOST_PARAMETERS}]"
#: Marks as numbers; -1 without a diagnosis that holds.
MARK_LEVELS: dict[str, int] = {mark: 2 - place for place, mark in enumerate(MARKS)}

# The rows of a run as estimates.

_IN_ORDER = [field.name for field in ESTIMATE_FIELDS]
# Columns of the ring; those of another name than the field's.
_RENAMED = {"time": "arrived", "prepared_time": "time", "learned_time": "learned"}
_FROM_RING = [
    field
    for field in ESTIMATE_FIELDS
    if field.kind != "string" and _RENAMED.get(field.name, field.name) in PLACE
]
_NAMES = [field.name for field in _FROM_RING]
_COLUMNS = [PLACE[_RENAMED.get(name, name)] for name in _NAMES]
_TIMES = [_NAMES.index(name) for name in ("time", "prepared_time", "learned_time")]
_USABLE = [_NAMES.index(name) for name in ("stiffness_usable", "damping_usable")]
_WHOLE = [field.name for field in _FROM_RING if field.kind.startswith("uint")]
_LOOP_FAULTS = {
    Check.STUCK_FORCE: "force or position repeats its value while the other one changes",
    Check.SATURATION: "the force repeats its largest value while the position changes",
    Check.LATE_FORCE: "the damping is negative: the force is later than the position",
}
_NO_CONTACT = f"{Check.LOST_CONTACT}: the numbers are of the last contact"


@frozen
class RunState:
    """What the rows of a run do not contain, from the loop's status and the diagnosis.

    Attributes
    ----------
    generation : int
        Number of the estimator; each change of estimator increases it.
    origin : int
        Zero of the source's times, ns.
    verdict : LiveVerdict, optional
        On the law, if the estimator compares laws.
    texts : mapping
        Method, law, selected law and names of the parameters.
    findings : tuple of str
        What the motion does not identify.
    diagnosis : mapping
        Fields of the last diagnosis: :func:`palpate.live.sinks.diagnosis_fields`.
    """

    generation: int
    origin: int
    verdict: LiveVerdict | None
    texts: Mapping[str, str]
    findings: tuple[str, ...]
    diagnosis: Mapping[str, Any]

    @property
    def parameter_names(self) -> list[str]:
        """Names of the law's parameters, in order."""
        return self.texts["parameter_names"].split()


def read_run(status: Mapping[str, Any], diagnosis: dict[str, Any] | None) -> RunState:
    """Return the state of a run from the loop's status and that of the diagnosis, if there is one.

    While the loop itself finds a fault, both marks are *do not trust*, and the fault is the reason.
    """
    verdict = verdict_on(status)
    law = status["law"]
    texts = {
        "method": status["method"],
        "law": law["kind"],
        "selected_law": str(verdict.law.candidate) if verdict and verdict.learned else "",
        "parameter_names": " ".join(law["names"]),
    }
    fields = diagnosis_fields(diagnosis, dict(status))
    mark, reason = find_loop_fault(status)
    for name in ("stiffness", "damping") if reason else ():
        fields[f"{name}_reason"] = reason
        if mark is not None:
            fields[f"{name}_verdict"] = mark
    findings = tuple(status.get("findings", ()))
    origin = status.get("origin", 0)
    return RunState(status["generation"], origin, verdict, texts, findings, fields)


def find_loop_fault(status: Mapping[str, Any]) -> tuple[Mark | None, str]:
    """Return the mark that a fault in the loop's status gives, if any, and its sentence."""
    age = or_nan(status.get("age"))
    lost = status.get("state") == "lost"
    fault = "no samples arrive" if lost else status.get("fault")
    if fault and (lost or not age <= OLDEST_USABLE):
        known = f": the estimate is {age:.1f} s old" if math.isfinite(age) else ""
        return "do-not-trust", f"{fault}{known}"
    for check in loop_checks(status.get("recent_checks", 0)):
        if check in _LOOP_FAULTS:
            return "do-not-trust", f"{check}: {_LOOP_FAULTS[check]}"
    if Check.LOST_CONTACT in loop_checks(status.get("checks", 0)) and math.isfinite(age):
        return None, f"{_NO_CONTACT}, {age:.1f} s ago"
    return None, ""


def estimates(rows: Floats, run: RunState, first: int) -> Iterator[dict[str, Any]]:
    """Yield the estimates of rows of the ring; ``first`` is the number of the first one."""
    numbers = rows[:, _COLUMNS]
    numbers[:, _TIMES] += 1e-9 * run.origin
    numbers[:, _USABLE] *= rows[:, PLACE["age"], None] <= OLDEST_USABLE
    names = run.parameter_names
    parameters, errors, _ = unpack_parameters(rows, len(names))
    marks = {
        f"{name}_mark": MARK_LEVELS.get(run.diagnosis[f"{name}_verdict"], -1)
        for name in ("stiffness", "damping")
    }
    # The status reports a change of material only a little later.
    unmarked = dict.fromkeys(marks, -1)
    columns = zip(numbers.tolist(), parameters.tolist(), errors.tolist(), strict=True)
    for place, (row, values, deviations) in enumerate(columns):
        found: dict[str, Any] = dict.fromkeys(_IN_ORDER)
        found |= zip(_NAMES, row, strict=True)
        found |= {name: int(found[name]) for name in _WHOLE}
        found |= marks if found["state"] != State.CHANGED else unmarked
        found |= run.texts
        found["schema"] = SCHEMA
        found["number"] = first + place
        found["parameters"] = values
        found["standard_errors"] = deviations
        found["stiffness_usable"] = found["stiffness_usable"] > 0.0
        found["damping_usable"] = found["damping_usable"] > 0.0
        found["flags"] = "; ".join([*run.findings, *loop_checks(found["checks"])])
        yield found


def describe_status(
    status: Mapping[str, Any],
    run: RunState,
    last: Mapping[str, Any],
    covariance: Floats,
) -> dict[str, Any]:
    """Return a status message: numbers in SI units, and a text with units.

    Includes the verdict on the law if the estimator compares laws.

    Parameters
    ----------
    status : mapping
        The loop's status.
    run : RunState
        The state of the run.
    last : mapping
        The last estimate.
    covariance : numpy.ndarray, shape (p, p)
        Covariance of its parameters.
    """
    state = "lost" if status["state"] == "lost" else State(last["state"]).name.lower()
    # It grows while no sample comes.
    age = max(or_nan(status.get("age")), last["age"]) if state == "lost" else last["age"]
    said = {
        name: each for name, each in last.items() if name not in ("parameters", "standard_errors")
    }
    said |= {
        "state": state,
        "age": age,
        "source": status["source"],
        "fault": status.get("fault", ""),
    }
    for name in ("stiffness_usable", "damping_usable"):
        said[name] = last[name] and age <= OLDEST_USABLE
    said |= _describe_parameters(status, run, last)
    said |= run.diagnosis
    said["covariance"] = covariance.ravel().tolist()
    _, reason = find_loop_fault(status)
    said["verdict_time"] = last["time"] if reason else run.diagnosis["diagnosis_time"]
    if verdict := run.verdict:
        origin = 1e-9 * run.origin  # zero of the loop's times
        said |= {f"verdict_{name}": each for name, each in verdict.fields(origin).items()}
    return said | {name: status["counts"].get(name, 0) for name in _COUNTED}


def _describe_parameters(
    status: Mapping[str, Any], run: RunState, last: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the parameters by name with their standard errors, and as a sentence."""
    law = status["law"]
    names = run.parameter_names
    own: Sequence[str] = names
    fixed: Sequence[str] = ()
    if run.verdict is not None:
        fixed = run.verdict.estimate.fixed
        own = run.verdict.law.candidate.own if run.verdict.learned else names
    said: dict[str, Any] = {}
    words = []
    for place in law["shown"]:
        name = names[place]
        value = error = math.nan
        if name in own:
            value = last["parameters"][place]
            error = last["standard_errors"][place]
            unit = law["units"][place]
            words.append(f"{name} {parameter(value, error, unit=unit, fixed=name in fixed)}")
        said |= {name: value, f"{name}_standard_error": error}
    return said | {"words": ", ".join(words)}


# The binary message: the body of a ROS 2 message in CDR, little-endian; and JSON.

_CODES = {"uint32": "I", "uint64": "Q", "float64": "d", "uint8": "B", "int8": "b", "bool": "?",
          _ARRAY: f"{MOST_PARAMETERS}d"}  # fmt: skip
_FIXED = [field for field in ESTIMATE_FIELDS if field.kind != "string"]
_TEXTS = [field.name for field in ESTIMATE_FIELDS if field.kind == "string"]
#: The fields before the texts, to the next multiple of four bytes.
FIXED = struct.Struct("<" + "".join(_CODES[field.kind] for field in _FIXED) + "3x")
_LENGTH = struct.Struct("<I")
#: Longest text, and longest message, bytes.
LONGEST_TEXT = 1000
LONGEST_ESTIMATE = FIXED.size + len(_TEXTS) * (LONGEST_TEXT + 8)


#: Larger numbers, and infinity, are read as NaN.
LARGEST = 1e300


class MessageError(PalpateError):
    """The message is no estimate, or one of another version; the text says why, in one line."""


def pack_estimate(values: Mapping[str, Any]) -> bytes:
    """Return the binary message of an estimate."""
    flat: list[Any] = []
    for field in _FIXED:
        value = values[field.name]
        if field.kind == _ARRAY:
            flat += [*value, *[math.nan] * (MOST_PARAMETERS - len(value))]
        else:
            flat.append(value)
    return FIXED.pack(*flat) + _pack_texts(tuple(values[name] for name in _TEXTS))


@lru_cache(maxsize=16)
def _pack_texts(texts: Sequence[str]) -> bytes:
    """Return texts in CDR: each its length, its bytes, a zero, and zeros to a multiple of four."""
    parts = []
    for text in texts:
        data = text.encode()[:LONGEST_TEXT].decode(errors="ignore").encode() + b"\0"
        parts.append(_LENGTH.pack(len(data)) + data + bytes(-len(data) % 4))
    return b"".join(parts)


def read_estimate(data: bytes) -> dict[str, Any]:
    """Return the fields of an estimate, binary or JSON.

    Raises
    ------
    MessageError
        The message has another schema, or is damaged.
    """
    if data[:1] == b"{" and data[-1:] == b"}":
        return read_json(data)
    if len(data) < _LENGTH.size:
        raise MessageError(f"a message of {len(data)} bytes is no estimate")
    check_version(_LENGTH.unpack_from(data)[0])
    if not FIXED.size <= len(data) <= LONGEST_ESTIMATE:
        raise MessageError(
            f"an estimate of {len(data)} bytes, not {FIXED.size} to {LONGEST_ESTIMATE}"
        )
    numbers = iter(FIXED.unpack_from(data))
    found: dict[str, Any] = {}
    for field in _FIXED:
        if field.kind == _ARRAY:
            found[field.name] = [next(numbers) for _ in range(MOST_PARAMETERS)]
        else:
            found[field.name] = next(numbers)
    place = FIXED.size
    for name in _TEXTS:
        found[name], place = _read_text(data, place, name)
    return _checked(found)


def _read_text(data: bytes, place: int, name: str) -> tuple[str, int]:
    start = place + _LENGTH.size
    size = _LENGTH.unpack_from(data, place)[0] if start <= len(data) else 0
    if not 1 <= size <= LONGEST_TEXT + 1 or start + size > len(data):
        raise MessageError(f"an estimate whose {name} exceeds the message or {LONGEST_TEXT} bytes")
    text = data[start : start + size - 1].decode("utf-8", "replace")
    return text, start + size + -size % 4


def read_json(data: bytes) -> dict[str, Any]:
    """Return the fields of an estimate or a status in JSON; null stays None in a status.

    Raises
    ------
    MessageError
        The message has another schema, or is damaged.
    """
    try:
        found = json.loads(data) if len(data) <= 8 * LONGEST_ESTIMATE else None
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise MessageError(f"a message of {len(data)} bytes, which is no object of JSON")
    check_version(found.get("schema"))
    return _checked(found) if "parameters" in found else found


def check_version(schema: object) -> None:
    """Raise for a message of another version.

    Raises
    ------
    MessageError
        In one line, with both versions.
    """
    if schema == SCHEMA and type(schema) is int:
        return
    newer = type(schema) is int and schema > SCHEMA
    advice = "update the listener" if newer else "update the palpate that publishes"
    raise MessageError(
        f"the message has schema {shown(schema)}, this listener reads schema {SCHEMA}: {advice}"
    )


def _checked(found: dict[str, Any]) -> dict[str, Any]:
    """Return an estimate with all fields, of the right types, and without numbers out of range."""
    for field in ESTIMATE_FIELDS:
        value = found.get(field.name, math.nan)
        if field.kind == "float64":
            value = _real(value, field.name)
        elif field.kind == _ARRAY:
            if not isinstance(value, list) or len(value) > MOST_PARAMETERS:
                raise MessageError(f"{field.name} must be at most {MOST_PARAMETERS} numbers")
            value = [_real(each, field.name) for each in value]
        elif type(value) is not {"string": str, "bool": bool}.get(field.kind, int):
            raise MessageError(f"{field.name} must be a {field.kind}, not {shown(str(value))}")
        found[field.name] = value
    marks = {found["stiffness_mark"], found["damping_mark"]}
    if found["state"] not in set(State) or not marks <= {-1, *MARK_LEVELS.values()}:
        raise MessageError(f"an estimate with state {found['state']} and marks {sorted(marks)}")
    names = found["parameter_names"].split()
    for name in ("parameters", "standard_errors"):
        found[name] = found[name][: len(names)]
    return found


def _real(value: object, name: str) -> float:
    if value is None:
        return math.nan  # JSON has no NaN
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise MessageError(f"{name} must be a number, not {shown(str(value))}")
    return float(value) if abs(value) < LARGEST else math.nan


def as_json(values: Mapping[str, Any]) -> bytes:
    """Encode a message as JSON, with null for NaN, which JSON lacks."""
    return json.dumps(plain(values)).encode()


# The ROS 2 message.

#: Types of the messages of an estimate and a status in ROS 2.
ESTIMATE_TYPE = "palpate_msgs/msg/ContactEstimate"
STATUS_TYPE = "diagnostic_msgs/msg/DiagnosticArray"
