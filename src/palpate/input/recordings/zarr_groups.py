"""Zarr groups of local files: types, codecs and sizes are checked before a chunk is decoded.

The formats are those of https://zarr-specs.readthedocs.io, versions 2 and 3.
"""

import json
import math
import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from zarr.storage import LocalStore, WrapperStore, ZipStore

from palpate.input.recordings.opening import Request, check_members, excess, size_of_deflate
from palpate.validation import frozen

# Codecs that only move, pack or scale numbers. Others run code, build objects, or state no size.
_CODECS = frozenset((
    "bytes", "transpose", "sharding_indexed", "crc32c", "crc32", "adler32", "fletcher32", "blosc",
    "zstd", "lz4", "gzip", "zlib", "shuffle", "delta", "fixedscaleoffset", "quantize", "bitround",
    "astype", "packbits",
))  # fmt: skip
_METADATA = (".zarray", ".zgroup", ".zattrs", "zarr.json")
_MISSING = (1 << 64) - 1  # place of a chunk that a shard does not have
_CHECKSUM = 4  # bytes after the index of a shard
_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"


def open_group(path: Path, request: Request, inside: str = "") -> Any:
    """Open a folder or an archive, or a folder inside it, for reading.

    Reading an array raises ValueError if its type is not numeric, if a codec is not among those
    that only unpack numbers, or if a chunk exceeds the cap on a block.
    """
    if path.is_dir():
        store: Any = LocalStore(path, read_only=True)
    else:
        check_members(path, request, lambda _: request.largest_block)
        store = ZipStore(path, mode="r")
    checked = _CheckedStore(store, request)
    return zarr.open_group(checked, path=inside, mode="r", use_consolidated=False)


class _CheckedStore(WrapperStore[Any]):
    """A store that checks what it returns."""

    def __init__(self, store: Any, request: Request | None = None) -> None:
        super().__init__(store)
        self._request = request or Request("")
        self._arrays: dict[str, _Packing] = {}
        self._checked: set[str] = set()  # keys of shards

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
            return value
        packing = next((self._arrays[f] for f in _folders(key) if f in self._arrays), None)
        if packing is not None and key not in self._checked:
            content = value
            if byte_range is not None:  # a part of a shard
                content = await super().get(key, prototype) or value
                self._checked.add(key)
            packing.check(content.to_bytes())
        return value

    def _check_array(self, about: Mapping[str, Any]) -> "_Packing":
        """Return how the chunks of an array are packed."""
        kind = about.get("dtype", about.get("data_type"))
        if not isinstance(kind, str) or np.dtype(kind).kind not in "iufbcmM":
            raise ValueError(f"holds {kind}, not numbers")
        codecs = list(_codecs(about))
        if wrong := [name for name in codecs if name not in _CODECS]:
            raise ValueError(f"has the codec {wrong[0]!r}, which palpate does not run")
        grid = about.get("chunk_grid", {}).get("configuration", {})
        sides = about.get("chunks", grid.get("chunk_shape", ()))
        packings = [name for name in codecs if name in _SIZES]
        if len(packings) > 1:
            raise ValueError("packs its chunks several times, which palpate does not unpack")
        shard: Mapping[str, Any] = {}
        if "sharding_indexed" in codecs:
            shard = _shard_of(about["codecs"])
        chunk = math.prod(map(int, shard["chunk_shape"] if shard else sides))
        return _Packing(
            next(iter(packings), ""),
            max(chunk * np.dtype(kind).itemsize, self._request.largest_block),
            math.prod(map(int, sides)) // chunk if shard else 0,
            index_first=shard.get("index_location") == "start",
        )


def _shard_of(codecs: Sequence[Mapping[str, Any]]) -> Mapping[str, Any]:
    """Return how shards are laid out; raise ValueError if their index cannot be read."""
    shard: Mapping[str, Any] = codecs[-1].get("configuration") or {}
    index = [codec["name"] for codec in shard.get("index_codecs", ())]
    inner = [codec["name"] for codec in shard.get("codecs", ())]
    if index != ["bytes", "crc32c"] or "sharding_indexed" in inner:
        raise ValueError("has packed or nested shards, which palpate does not unpack")
    return shard


@frozen
class _Packing:
    """How the chunks of an array are packed.

    Attributes
    ----------
    codec : str
        The codec that unpacks, if any.
    most : int
        Largest unpacked size of a chunk, bytes.
    in_shard : int
        Number of chunks in a shard; 0 without shards.
    index_first : bool
        Whether the index of a shard is at its beginning.
    """

    codec: str
    most: int
    in_shard: int
    index_first: bool

    def check(self, packed: bytes) -> None:
        """Raise ValueError for a chunk, or one in a shard, that unpacks to more than the cap."""
        for chunk in self._chunks(packed) if self.codec else ():
            size = _SIZES[self.codec](chunk, self.most)
            if size > self.most:
                raise ValueError(excess("a chunk needs", size, self.most))

    def _chunks(self, packed: bytes) -> Iterator[bytes]:
        if not self.in_shard:
            yield packed
            return
        length = 16 * self.in_shard
        index = packed[:length] if self.index_first else packed[-length - _CHECKSUM : -_CHECKSUM]
        for begin, size in struct.iter_unpack("<QQ", index):
            if begin != _MISSING:
                yield packed[begin : begin + size]


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
    "gzip": size_of_deflate,
    "zlib": size_of_deflate,
}
