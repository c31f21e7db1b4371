"""Zarr groups of local files: types, codecs and sizes are checked before a chunk is decoded.

The formats are those of https://zarr-specs.readthedocs.io, versions 2 and 3.
"""

import json
import math
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from zarr.storage import LocalStore, WrapperStore, ZipStore

from palpate.recordings.opening import Request, check_members, excess

# Codecs that only move, pack or scale numbers. Others run code, build objects, or state no size.
_CODECS = frozenset((
    "bytes", "transpose", "sharding_indexed", "crc32c", "crc32", "adler32", "fletcher32", "blosc",
    "zstd", "lz4", "gzip", "zlib", "shuffle", "delta", "fixedscaleoffset", "quantize", "bitround",
    "astype", "packbits",
))  # fmt: skip
_METADATA = (".zarray", ".zgroup", ".zattrs", "zarr.json")
_DEFLATE_RATIO = 1032  # the largest
_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"


def open_group(path: Path, request: Request) -> Any:
    """Open a folder or a ``.zarr.zip`` for reading.

    Reading an array raises ValueError if its type is not numeric, if a codec is not among those
    that only unpack numbers, or if a chunk exceeds the cap on a block.
    """
    if path.is_dir():
        store: Any = LocalStore(path, read_only=True)
    else:
        check_members(path, request, lambda _: request.largest_block)
        store = ZipStore(path, mode="r")
    return zarr.open_group(_CheckedStore(store, request), mode="r", use_consolidated=False)


class _CheckedStore(WrapperStore[Any]):
    """A store that checks what it returns."""

    def __init__(self, store: Any, request: Request | None = None) -> None:
        super().__init__(store)
        self._request = request or Request("")
        self._arrays: dict[str, tuple[list[str], int]] = {}  # codecs, largest size of a chunk

    def _with_store(self, store: Any) -> "_CheckedStore":
        return type(self)(store, self._request)

    async def get(self, key: str, prototype: Any, byte_range: Any = None) -> Any:
        """Return a value of the store.

        Raises
        ------
        ValueError
            It is the description or a chunk of an array that palpate does not read.
        """
        value = await super().get(key, prototype, byte_range)
        if value is None:
            return None
        folder, _, name = key.rpartition("/")
        if name in _METADATA:
            self._request.check_block(64 * len(value))
            about = json.loads(value.to_bytes())
            if name == ".zarray" or about.get("node_type") == "array":
                self._arrays[folder] = self._check_array(about)
        elif byte_range is None:
            array = next((self._arrays[f] for f in _folders(key) if f in self._arrays), None)
            if array is not None:
                _check_chunk(value.to_bytes(), *array)
        return value

    def _check_array(self, about: Mapping[str, Any]) -> tuple[list[str], int]:
        """Return the codecs of an array, and the largest size of a chunk."""
        kind = about.get("dtype", about.get("data_type"))
        if not isinstance(kind, str) or np.dtype(kind).kind not in "iufbcmM":
            raise ValueError(f"holds {kind}, not numbers")
        codecs = list(_codecs(about))
        if wrong := [name for name in codecs if name not in _CODECS]:
            raise ValueError(f"has the codec {wrong[0]!r}, which palpate does not run")
        grid = about.get("chunk_grid", {}).get("configuration", {})
        sides = about.get("chunks", grid.get("chunk_shape", ()))
        chunk = math.prod(map(int, sides)) * np.dtype(kind).itemsize
        return codecs, max(chunk, self._request.largest_block)


def _codecs(about: Mapping[str, Any]) -> Iterator[str]:
    """The names of the codecs of an array, also of those within a shard; the last one unpacks."""
    for codec in (*(about.get("filters") or ()), about.get("compressor")):
        if codec is not None:
            yield str(codec.get("id"))
    inner = about.get("codecs", ())
    for codec in (*inner, *about.get("index_codecs", ())):
        yield str(codec.get("name")).removeprefix("numcodecs.")
        yield from _codecs(codec.get("configuration") or {})


def _folders(key: str) -> Iterator[str]:
    """The folders that contain a key, from the innermost."""
    while key:
        key = key.rpartition("/")[0]
        yield key


def _check_chunk(packed: bytes, codecs: list[str], most: int) -> None:
    """Raise ValueError for a chunk that unpacks to more than the cap."""
    size = next((_SIZES[name](packed, most) for name in codecs if name in _SIZES), 0)
    if size > most:
        raise ValueError(excess("a chunk needs", size, most))


def _size_of_deflate(packed: bytes, most: int) -> int:
    """The unpacked size of zlib or gzip, as far as the cap; they do not state it."""
    size = 0
    while packed and size + len(packed) * _DEFLATE_RATIO > most >= size:
        unpacker = zlib.decompressobj(wbits=47)
        size += len(unpacker.decompress(packed, most + 1 - size))
        packed = unpacker.unused_data
    return size


def _size_of_zstd(packed: bytes, most: int) -> int:
    """The size that the header of a Zstandard frame states (RFC 8878); above the cap if none."""
    if not packed.startswith(_ZSTD_MAGIC):
        return 0  # zstd refuses it
    flags = packed[4]
    single = flags >> 5 & 1
    width = (single, 2, 4, 8)[flags >> 6]
    begin = 6 - single + (0, 1, 2, 4)[flags & 3]
    stated = int.from_bytes(packed[begin : begin + width], "little") + 256 * (width == 2)
    return stated if width else most + 1


_SIZES = {
    "blosc": lambda packed, _: int.from_bytes(packed[4:8], "little"),
    "lz4": lambda packed, _: int.from_bytes(packed[:4], "little"),
    "zstd": _size_of_zstd,
    "gzip": _size_of_deflate,
    "zlib": _size_of_deflate,
}
