"""Object storage: equal rows from an S3 server on this machine and from disk."""

import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from benchmarks.fleets.curves import write_array
from benchmarks.fleets.files import write_files
from benchmarks.report import Limit, Row, Section
from palpate.fleet.files import read_results
from palpate.fleet.running import run_fleet
from palpate.fleet.tasks import Settings

BUCKET = "archive"
SETTINGS = Settings(diagnosis="none")


@contextmanager
def server() -> Iterator[str]:
    """Run a server on loopback, with one empty bucket, and set the environment for clients."""
    import boto3
    from moto.server import ThreadedMotoServer

    running = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    running.start()
    host, port = running.get_host_and_port()
    address = f"http://{host}:{port}"
    wanted = {
        "AWS_ENDPOINT_URL": address,
        "AWS_ACCESS_KEY_ID": "nobody",
        "AWS_SECRET_ACCESS_KEY": "nothing",
        "AWS_DEFAULT_REGION": "us-east-1",
        # On this machine, and without a proxy.
        "NO_PROXY": "127.0.0.1,localhost",
    }
    before = {name: os.environ.get(name) for name in wanted}
    os.environ.update(wanted)
    try:
        boto3.client("s3").create_bucket(Bucket=BUCKET)
        yield address
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
        running.stop()


def upload(folder: Path) -> None:
    """Put all files of a folder into the bucket, by their relative paths."""
    import boto3

    client = boto3.client("s3")
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            client.upload_file(str(path), BUCKET, path.relative_to(folder.parent).as_posix())


def measure(files: int, curves: int, folder: Path | None = None) -> Section:
    """Identify recordings and an array from disk and from the server."""
    with tempfile.TemporaryDirectory(dir=folder) as scratch, server():
        path = Path(scratch)
        write_files(path / "touches", files, files // 10)
        write_array(path / "curves.zarr", curves)
        differing, rows = 0, []
        for name in ("touches", "curves.zarr"):
            upload(path / name)
            disk = run_fleet([path / name], path / f"disk-{name}", SETTINGS, workers=1)
            begun = time.perf_counter()
            run_fleet([f"s3://{BUCKET}/{name}"], path / f"s3-{name}", SETTINGS, workers=1)
            took = time.perf_counter() - begun
            differing += different(path / f"disk-{name}", path / f"s3-{name}", path)
            rows.append(Row(f"{name} from the server", disk.contacts / took, "contacts/s"))
    rows.insert(0, Row("rows that differ from those of the disk", differing, "", limit=Limit(0.0)))
    return Section("Object storage", rows, ["s3fs against moto's server, on loopback"])


def different(one: Path, other: Path, root: Path) -> int:
    """Return how many rows of two folders differ, except in the address of their source."""
    local, remote = f"{root}/", f"s3://{BUCKET}/"
    tables = [read_results(folder).to_pylist() for folder in (one, other)]
    if len(tables[0]) != len(tables[1]):
        return max(map(len, tables))
    rows = [[repr(row).replace(local, remote) for row in table] for table in tables]
    return sum(a != b for a, b in zip(*rows, strict=True))
