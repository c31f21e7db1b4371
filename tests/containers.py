"""Recordings in files of groups and columns, written by the tests themselves."""

import zipfile
from collections.abc import Mapping
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.feather
import pyarrow.parquet
import scipy.io
from recordings import SIGNALS

COLUMNS = {"time_s": SIGNALS.time, "penetration_m": SIGNALS.penetration, "force_N": SIGNALS.force}


def write_parquet(path: Path, columns: Mapping = COLUMNS, **more) -> Path:
    pa.parquet.write_table(pa.table(dict(columns)), path, **more)
    return path


def write_feather(path: Path, columns: Mapping = COLUMNS, **more) -> Path:
    pa.feather.write_feather(pa.table(dict(columns)), path, **more)
    return path


def write_hdf5(path: Path, columns: Mapping = COLUMNS, **more) -> Path:
    """A dataset each; of names with a slash in groups."""
    with h5py.File(path, "w") as file:
        for name, values in columns.items():
            file.create_dataset(name, data=values, **more)
    return path


def write_mat5(path: Path, columns: Mapping = COLUMNS, **more) -> Path:
    scipy.io.savemat(path, dict(columns), **more)
    return path


HEAD = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Sat Nov 21 10:00:00 2026 HDF5 schema"


def write_mat73(path: Path, variables: Mapping = COLUMNS) -> Path:
    """As MATLAB lays it out: a head of 512 bytes, classes as attributes, arrays turned over."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in variables.items():
            write_variable(file, name, value)
    head = HEAD.ljust(116) + bytes(8) + b"\x00\x02IM"
    with path.open("r+b") as file:
        file.write(head.ljust(512, b"\0"))
    return path


def write_variable(group: h5py.Group, name: str, value) -> None:
    if isinstance(value, Mapping):
        made = group.create_group(name)
        made.attrs["MATLAB_class"] = np.bytes_("struct")
        for field, inner in value.items():
            write_variable(made, field, inner)
    elif isinstance(value, list):  # an array of structs: references, field by field
        write_structs(group, name, value)
    elif isinstance(value, str):
        codes = np.array([[ord(sign)] for sign in value], dtype=np.uint16)
        made = group.create_dataset(name, data=codes)
        made.attrs["MATLAB_class"] = np.bytes_("char")
        made.attrs["MATLAB_int_decode"] = np.int32(2)
    else:
        array = np.atleast_2d(np.asarray(value))
        kind = {"float64": "double", "float32": "single", "bool": "logical"}
        plain = array.astype(np.uint8) if array.dtype == bool else array
        made = group.create_dataset(name, data=plain.T)
        made.attrs["MATLAB_class"] = np.bytes_(kind.get(str(array.dtype), str(array.dtype)))


def write_structs(group: h5py.Group, name: str, value: list[Mapping]) -> None:
    made = group.create_group(name)
    made.attrs["MATLAB_class"] = np.bytes_("struct")
    apart = group.file.require_group("#refs#")
    for field in value[0]:
        references = []
        for item in value:
            place = f"r{len(apart)}"
            write_variable(apart, place, item[field])
            references.append([apart[place].ref])
        made.create_dataset(field, data=np.array(references, dtype=h5py.ref_dtype))


# What a force curve of a JPK instrument is scaled by, from volts.
SENSITIVITY, SPRING_CONSTANT, HEIGHT_SCALE, VOLTS = 6e-8, 0.02, 7e-6, 3e-4
SEGMENT_SECONDS = 0.5

_CHANNEL = """channel.{name}.data.encoder.type=signedshort
channel.{name}.data.encoder.scaling.offset=0.0
channel.{name}.data.encoder.scaling.multiplier={volts}
channel.{name}.data.encoder.scaling.unit.unit=V
channel.{name}.conversion-set.conversions.base=volts
"""
_CONVERSION = """channel.{name}.conversion-set.conversion.{slot}.name={slot}
channel.{name}.conversion-set.conversion.{slot}.base-calibration-slot={base}
channel.{name}.conversion-set.conversion.{slot}.scaling.offset=0.0
channel.{name}.conversion-set.conversion.{slot}.scaling.multiplier={factor}
channel.{name}.conversion-set.conversion.{slot}.scaling.unit.unit={unit}
"""
_SEGMENT = """force-segment-header.num-points={points}
force-segment-header.duration={seconds}
force-segment-header.approach-id=made
force-segment-header.time-stamp=2026-11-21 10\\:00\\:00.000 +0000
force-segment-header.settings.style={style}
force-segment-header.settings.segment-settings.duration={seconds}
force-segment-header.settings.segment-settings.z-start=3.0E-5
force-segment-header.settings.segment-settings.z-end=0.0
"""


def write_jpk(path: Path, curves: list[tuple[np.ndarray, np.ndarray]]) -> Path:
    """A force map of a JPK instrument: of each curve the height and the deflection, in counts."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        head = "type=force-scan-map\nforce-scan-map.position-pattern.grid.ilength=2\n"
        archive.writestr("header.properties", head)
        archive.writestr("index/", "")
        for k, (height, deflection) in enumerate(curves):
            top = f"index/{k}/"
            archive.writestr(top, "")
            place = f"force-scan-series.header.position-index={k}\n"
            archive.writestr(top + "header.properties", place)
            half = len(height) // 2
            for j, (style, part) in enumerate(
                (("extend", slice(half)), ("retract", slice(half, None)))
            ):
                below = f"{top}segments/{j}/"
                _write_segment(archive, below, style, height[part], deflection[part])
    return path


def _write_segment(archive, place: str, style: str, height, deflection) -> None:
    words = _SEGMENT.format(points=len(height), seconds=SEGMENT_SECONDS, style=style)
    for name in ("vDeflection", "measuredHeight"):
        words += _CHANNEL.format(name=name, volts=VOLTS)
    for name, slot, base, factor, unit in (
        ("vDeflection", "distance", "volts", SENSITIVITY, "m"),
        ("vDeflection", "force", "distance", SPRING_CONSTANT, "N"),
        ("measuredHeight", "nominal", "volts", HEIGHT_SCALE, "m"),
    ):
        words += _CONVERSION.format(name=name, slot=slot, base=base, factor=factor, unit=unit)
    archive.writestr(place, "")
    archive.writestr(place + "segment-header.properties", words)
    for name, counts in (("vDeflection", deflection), ("measuredHeight", height)):
        archive.writestr(f"{place}channels/{name}.dat", np.asarray(counts, dtype=">i2").tobytes())
