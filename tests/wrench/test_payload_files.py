"""A payload survives its file bit for bit, and a file that is none is refused in one line."""

import re
from dataclasses import fields, replace

import numpy as np
import pytest
from payloads import PAYLOAD, turn
from ruamel.yaml import YAML

from palpate import Columns, Payload, Recording, RecordingError, prepare
from palpate.exports.ros_parameters import ros_parameters
from palpate.findings import Check
from palpate.input.channels.frames import rotate
from palpate.input.wrench.payload import LARGEST

FULL = replace(
    PAYLOAD,
    delay=-0.0123,
    sign=-1.0,
    bias_times=np.array([0.0, 20.0]),
    bias_changes=np.arange(12.0).reshape(2, 6) / 7.0,
    mass_error=1e-3,
    centre_error=np.array([1e-4, np.nan, 3e-4]),
    inertia_error=np.full(6, np.inf),
    turn=0.7,
    axes=2,
    free_share=0.4,
    free_time=20.0,
    mount_mark="with-care",
    findings=(Check.PAYLOAD.finding('one "word"', "turn it", 3.5, mark="with-care"),),
)


@pytest.mark.parametrize("payload", [PAYLOAD, FULL, replace(PAYLOAD, inertia=None)])
def test_a_payload_is_loaded_as_it_was_saved(payload, tmp_path):
    path = tmp_path / "tool.toml"
    payload.save(path)
    loaded = Payload.load(path)
    for field in fields(Payload):
        found, expected = (getattr(each, field.name) for each in (loaded, payload))
        if isinstance(expected, np.ndarray):
            np.testing.assert_array_equal(found, expected, err_msg=field.name)
            assert found.shape == expected.shape
        else:
            assert found == expected or (found != found and expected != expected), field.name
        assert type(found) is type(expected)
    before = path.read_bytes()
    loaded.save(path)
    assert path.read_bytes() == before


def test_a_payload_file_has_comments_and_replaces_no_input(tmp_path):
    path = tmp_path / "tool.toml"
    PAYLOAD.save(path, ["turns 43°\nenough"])
    assert "# turns 43° enough" in path.read_text("utf-8")
    log = tmp_path / "log.csv"
    log.write_text("precious")
    with pytest.raises(RecordingError, match="input file"):
        PAYLOAD.save(log, inputs=[log])
    assert log.read_text() == "precious"
    with pytest.raises(RecordingError, match="does not exist"):
        PAYLOAD.save(tmp_path / "no" / "tool.toml")


def edited(text, name, value):
    return re.sub(rf"^{name} = .*$", f"{name} = {value}" if value else "", text, flags=re.M)


BROKEN = {
    "mass is '-1.0'": ("mass", "-1.0"),
    "mass is 'nan'": ("mass", "nan"),
    "mass is '[1.0]'": ("mass", "[1.0]"),
    "mass is 'heavy'": ("mass", '"heavy"'),
    "centre is": ("centre", "[1.0, 2.0]"),
    "mount is": ("mount", "[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]"),
    "bias is": ("bias", "[1.0, 2.0, 3.0, inf, 0.0, 0.0]"),
    "sign is '0.5'": ("sign", "0.5"),
    "mass_mark is 'good'": ("mass_mark", '"good"'),
    "bias_times is": ("bias_times", "[1.0, 0.0]"),
    "version 2 is not 1": ("version", "2"),
    "mass is '1000": ("mass", "1" + "0" * 400),
    "field 'mount' is missing": ("mount", ""),
    "field 'version' is missing": ("version", ""),
    "unknown field 'surface'": ("mass", "0.7\nsurface = 1"),
    "findings is": ("findings", "[{message = 1}]"),
    "not a payload in TOML": ("mass", "="),
}


@pytest.mark.parametrize("words", BROKEN)
def test_an_invalid_payload_file_is_refused_by_field(words, tmp_path):
    path = tmp_path / "tool.toml"
    FULL.save(path)
    path.write_text(edited(path.read_text("utf-8"), *BROKEN[words]), "utf-8")
    with pytest.raises(RecordingError, match=re.escape(words)) as caught:
        Payload.load(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_missing_binary_or_huge_is_one_line(tmp_path):
    path = tmp_path / "tool.toml"
    with pytest.raises(RecordingError, match="No such file"):
        Payload.load(path)
    for content in (b"\xff\x00", b"#" * (LARGEST + 1), b"a = " + b"[" * 100_000):
        path.write_bytes(content)
        with pytest.raises(RecordingError, match="not a payload in TOML"):
            Payload.load(path)


def test_the_parameters_of_ros_give_the_weight_of_the_payload():
    """To the filter and to the plugin of MuJoCo; the sign turns the weight."""
    mount = rotate(np.eye(3), turn([0.0, 0.0, 1.0], 0.5)[None]).T
    for sign in (1.0, -1.0):
        payload = replace(PAYLOAD, mount=mount, sign=sign)
        text = ros_parameters(payload, world_frame="base", sensor_frame="wrist")
        whole = YAML(typ="safe").load(text)["/**"]["ros__parameters"]
        own = whole["sensor_filter_chain"]["filter1"]["params"]
        assert (own["world_frame"], own["sensor_frame"]) == ("base", "wrist")
        weight = [0.0, 0.0, -sign * 0.7 * 9.80665]
        tool = own["tool"]
        np.testing.assert_allclose(np.multiply(tool["gravity_field"], tool["mass"]), weight)
        plugin = whole["mujoco_plugins"]["fts_grav_comp_plugin"]["wrist"]
        for centre in (tool["CoG"], plugin["CoG"]["pos"]):
            np.testing.assert_array_equal(centre, PAYLOAD.centre)
        assert plugin["CoG"]["mass"] == 0.7
        assert 'rpy="0 0 0.5"' in text.replace("-0 ", "0 ")


def test_a_payload_is_refused_for_a_log_whose_clock_restarts():
    time = np.tile(np.arange(0.0, 5.0, 2e-3), 2)
    press = np.clip(np.sin(2.0 * time), 0.0, 1.0)
    channels = {
        "time_s": time,
        "z": 0.2 - 1e-3 * press,
        "Fz": 8.0 - 2.0 * press,
        "qx": 0.0 * time + 1.0,
    }
    channels |= dict.fromkeys(("x", "y", "Fx", "Fy", "qy", "qz", "qw"), 0.0 * time)
    columns = Columns(position="x,y,z", force="Fx,Fy,Fz", orientation="qx,qy,qz,qw")
    with pytest.raises(RecordingError, match="clocks that do not restart"):
        prepare(Recording(channels), columns=columns, payload=PAYLOAD)
