"""The same function under other engines, where they are installed."""

import numpy as np
import pytest
from fleets import STEP, curves

from palpate.fleet.running import identify_batch
from palpate.fleet.tasks import Settings

pa = pytest.importorskip("pyarrow")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore"),  # engines have many of their own
]
SETTINGS = Settings(diagnosis="none")


def touches(count=12):
    x, v, f = curves(count)
    time = STEP * np.arange(x.shape[1])
    named = {"source": [f"touch {k}" for k in range(count)], "index": list(range(count))}
    channels = {"penetration": x.tolist(), "velocity": v.tolist(), "force": f.tolist()}
    return pa.table({**named, "time": [time.tolist()] * count, **channels})


def in_order(rows):
    return repr(sorted(rows, key=lambda row: row["index"]))


def test_ray_maps_the_same_function_over_its_batches():
    ray = pytest.importorskip("ray", reason="Ray is not installed")
    pytest.importorskip("ray.data", reason="Ray has no data here")
    batch = touches()
    ray.init(num_cpus=1, include_dashboard=False, _node_ip_address="127.0.0.1")
    try:
        data = ray.data.from_arrow(batch).map_batches(
            identify_batch, batch_format="pyarrow", batch_size=5, fn_kwargs={"settings": SETTINGS}
        )
        found = pa.concat_tables(ray.get(data.to_arrow_refs()))
    finally:
        ray.shutdown()
    assert in_order(found.to_pylist()) == in_order(identify_batch(batch, SETTINGS).to_pylist())


def test_spark_maps_the_same_function_over_its_batches():
    sql = pytest.importorskip("pyspark.sql", reason="Spark is not installed")
    batch = touches()
    expected = identify_batch(batch, SETTINGS)
    try:
        spark = (
            sql.SparkSession.builder.master("local[1]")
            .config("spark.driver.bindAddress", "127.0.0.1")
            .config("spark.driver.host", "127.0.0.1")
            .config("spark.ui.enabled", "false")
            .getOrCreate()
        )
    except Exception as error:  # of a Java that is not there
        pytest.skip(f"Spark does not start: {error}")

    def identified(batches):
        for each in batches:
            yield from identify_batch(each, SETTINGS).to_batches()

    kinds = {"int64": "bigint", "double": "double", "string": "string"}
    kinds |= {"list<item: string>": "array<string>", "list<element: string>": "array<string>"}
    columns = ", ".join(
        f"`{field.name}` {kinds.get(str(field.type), 'array<double>')}" for field in expected.schema
    )
    try:
        frame = spark.createDataFrame(batch.to_pandas())
        found = [row.asDict() for row in frame.mapInArrow(identified, columns).collect()]
    finally:
        spark.stop()
    assert in_order(found) == in_order(expected.to_pylist())


def test_objects_of_a_server_give_the_rows_that_the_disk_gives(tmp_path):
    pytest.importorskip("moto.server", reason="moto, the server, is not installed")
    pytest.importorskip("s3fs", reason="s3fs, the client, is not installed")
    pytest.importorskip("mcap", reason="mcap, which writes the recordings, is not installed")
    from benchmarks.fleets import objects

    found = objects.measure(20, 50, tmp_path)
    assert found.rows[0].value == 0
