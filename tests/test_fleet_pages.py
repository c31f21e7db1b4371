"""What a fleet's rows say together: repeats, outliers, maps and the page."""

import numpy as np
import pytest
from fleets import rows

from palpate import InvalidParameterError
from palpate.fleet.files import Results, read_results
from palpate.fleet.maps import kinds_of, map_of, outliers_of, reasons_of, repeats_of, slowest
from palpate.fleet.rows import table_of_rows
from palpate.fleet.tasks import ContactSource, Settings, batches
from palpate.identification.identified import NEGATIVE_STIFFNESS

pa = pytest.importorskip("pyarrow")


def test_repeats_agree_as_often_as_chance_says_and_not_where_their_errors_are_too_small():
    """χ² of normal repeats: z is standard normal, by the cube root to a tenth already for two."""
    random = np.random.default_rng(3)
    error = random.uniform(1.0, 5.0, 4000)
    value = 1000.0 + error * random.normal(size=4000)
    x = np.repeat(np.arange(1000.0), 4)
    zs = [each.z for each in repeats_of(rows(value, error, x=x), "stiffness")]
    assert len(zs) == 1000
    assert abs(np.mean(zs)) < 0.15
    assert 0.9 < np.std(zs) < 1.1
    assert np.mean([z > 3.0 for z in zs]) < 0.01
    found = repeats_of(rows(value, error / 5.0, x=x), "stiffness")
    assert np.mean([each.agree for each in found]) < 0.15
    assert 4.0 < np.median([each.ratio for each in found]) < 5.0  # of three degrees: 0.89 × 5


def test_repeats_are_of_one_folder_where_no_place_is_known():
    [found] = repeats_of(rows([10.0, 11.0, 12.0], [1.0] * 3), "stiffness")
    assert (found.name, found.count, found.mean) == ("this folder", 3, 11.0)
    assert found.error == pytest.approx(3.0**-0.5)
    [found] = repeats_of(rows([10.0, 20.0, 30.0, np.nan], [1.0] * 4), "stiffness")
    assert (found.count, found.total) == (3, 4)
    assert found.error == pytest.approx(10.0 * 3.0**-0.5)  # their scatter is ten times their errors
    assert repeats_of(rows([10.0, 11.0], [1.0, 1.0], index=[0, 1]), "stiffness") == []


def test_outliers_are_named_and_an_uncertain_value_is_none():
    value, error = np.full(40, 1000.0) + np.arange(40.0), np.full(40, 5.0)
    value[7], value[9] = 5000.0, 5000.0
    error[9] = 5000.0
    [found] = outliers_of(rows(value, error))
    assert (found.name, found.quantity, found.value) == ("touch-007.csv", "stiffness", 5000.0)


def test_sentences_are_counted_by_what_they_say_and_the_slowest_sources_come_first():
    found = kinds_of([["only 12 samples", "a"], ["only 7 samples", "only 8 samples"], None])
    assert found[0][:2] == ("only … samples", 2)
    made = [{"source": f"{k}.csv", "error": f"{k}.csv: row {k} is no number"} for k in range(3)]
    [(kind, count, first)] = reasons_of(table_of_rows(made, Settings()))
    assert (kind, count, first) == ("row … is no number", 3, "0.csv")
    times = pa.table({"source": ["a", "b", "a"], "index": [0, None, 1], "seconds": [1.0, 1.5, 1.0]})
    assert slowest(times) == [("a", 2.0, 2), ("b", 1.5, 1)]


def grid(side=6, **others):
    x, y = (each.reshape(-1) for each in np.meshgrid(*[1e-3 * np.arange(side)] * 2))
    value = 1000.0 + 1e5 * x
    value[3] = np.nan
    return rows(value, np.full(side**2, 20.0), x=x.tolist(), y=y.tolist(), **others)


def test_a_map_has_values_and_errors_over_places_or_those_at_one_depth_by_the_law():
    found = map_of(grid(), ["x", "y"])
    assert found.places.shape == (36, 2)
    assert (found.units, found.unit, np.isnan(found.value).sum()) == (("m", "m"), "N/m", 1)
    assert "median 1200 ± 20 N/m" in found.summary
    assert "; 1 place has no number" in found.summary
    law = {"stiffness": 4000.0, "damping": 50.0, "exponent": 1.3}
    row = {"depth": 2e-3, "covariance": [100.0**2, *[0.0] * 8], **law}

    def at_5_mm(*depths):
        made = [{"x": 1e-3 * k, "largest_depth": each, **row} for k, each in enumerate(depths)]
        return map_of(table_of_rows(made, Settings()), ["x"], of="force", depth=5e-3)

    found = at_5_mm(6e-3, 4e-3)
    assert found.value[0] == pytest.approx(4000.0 * 5e-3**1.3)
    assert found.error[0] == pytest.approx(100.0 * 5e-3**1.3)
    assert "at 5 mm" in found.summary
    assert np.isnan(found.value[1])
    assert "1 place was not pressed so deep" in found.summary
    found = at_5_mm(np.nan, np.nan)
    assert "no force at 5 mm at any of 2 places; 2 places were not pressed" in found.summary


def test_a_map_says_of_which_places_the_numbers_are_not_to_be_trusted():
    """By a verdict where there is one, else by what the checks of the data found, or by flags."""
    table = rows(
        [1.0, 2.0, 3.0, 4.0],
        [0.1] * 4,
        x=[0.0, 1.0, 2.0, 2.0],
        y=[0.0, 1.0, 2.0, 2.0],
        findings=[["do-not-trust: signs: ..."], ["with-care: spikes: ..."], ["note: tare: "], None],
        verdict_stiffness=[None, None, "do-not-trust", "trust"],
        flags=[[], ["damping not identifiable: ..."], [], []],
    )
    found = map_of(table, ["x", "y"])
    assert found.mistrusted.tolist() == [True, False, True, False]
    assert map_of(table, ["x"], of="damping").mistrusted.tolist() == [True, True, False, False]
    for words in (
        "do-not-trust, signs: 1 of the places", "with-care, spikes: 1", "1 lies on others",
    ):  # fmt: skip
        assert words in found.summary
    assert "tare" not in found.summary
    pulls = rows([1.0], [0.1], x=[0.0], flags=[[str(NEGATIVE_STIFFNESS)]])
    assert map_of(pulls, ["x"]).mistrusted.all()
    uncertain = rows([1.0, 1.0], [2.0, 0.1], x=[0.0, 1.0])
    assert map_of(uncertain, ["x"]).mistrusted.tolist() == [True, False]
    unchecked = rows([1.0], [0.1], x=[0.0], checked=["none"])
    assert "the data were not checked" in map_of(unchecked, ["x"]).summary


@pytest.mark.parametrize(
    "by, words",
    [
        (["x", "w"], "no column 'w'"),
        (["z"], "no row has a number in z"),
        (["source"], "holds no numbers"),
        (["x", "y", "z"], "one or two columns"),
        (["x", "x"], "one or two columns"),
    ],
)
def test_a_map_over_what_is_not_there_is_refused(by, words, run, tmp_path):
    with pytest.raises(InvalidParameterError, match=words):
        map_of(grid(), by)
    status, _, err = run("map", tmp_path)
    assert (status, err.count("\n")) == (2, 1)
    assert "holds no results of palpate fleet" in err


def written(folder, table):
    """A folder of results that holds these rows."""
    sources = [ContactSource("all", "file")]
    [batch] = batches(sources, [1.0])
    results = Results.begin(folder, Settings(), sources)
    results.write(batch, table, np.ones(table.num_rows))
    return folder


@pytest.mark.parametrize("by", ["x,y", "x"])
def test_maps_are_drawn(run, tmp_path, by):
    pytest.importorskip("matplotlib")
    folder = written(tmp_path / "results", grid())
    figure = tmp_path / "map.svg"
    status, out, err = run("map", folder, "--by", by, "--figure", figure, "--width", "88mm")
    assert (status, err) == (0, "")
    assert "of 35 places" in out
    text = figure.read_text()
    assert "stiffness [kN/m]" in text
    assert "standard error" in text


def test_scattered_places_and_those_without_a_number_are_drawn_as_dots():
    pytest.importorskip("matplotlib")
    from palpate.figures import draw_map

    random = np.random.default_rng(2)
    value = np.r_[random.uniform(100.0, 200.0, 30), np.nan]
    x, y = random.uniform(0.0, 0.05, (2, 31)).tolist()
    for findings, labels in (
        ([[]] * 31, ["no number"]),
        ([["do-not-trust: signs: "]] * 2 + [[]] * 29, ["no number", "not to be trusted"]),
    ):
        table = rows(value, np.full(31, 3.0), x=x, y=y, findings=findings)
        for by in (["x", "y"], ["x"]):
            left = draw_map(map_of(table, by)).axes[0]
            assert sorted(left.get_legend_handles_labels()[1]) == labels
            if len(by) == 2:
                assert len(left.collections[0].get_offsets()) == 30
                assert len(left.lines[0].get_xdata()) == 1
    # A strip, so that its width is seen.
    x, y = np.arange(6.0).tolist(), [0.0, 1.0] * 3
    for length, aspect in ((1.0, 1.0), (1e3, "auto")):
        table = rows([5.0] * 6, [1.0] * 6, x=[length * each for each in x], y=y)
        assert draw_map(map_of(table, ["x", "y"])).axes[0].get_aspect() == aspect


def test_the_page_says_what_there_is_and_leaves_the_rest_out(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    from palpate.fleet.report import fleet_page

    table = grid(flags=[["only 3 samples in contact"]] * 36)
    failed = [{"source": "<b>.csv", "error": "<b>.csv: it is damaged", "error_kind": "X"}]
    folder = written(tmp_path / "r", pa.concat_tables([table, table_of_rows(failed, Settings())]))
    page = fleet_page(folder)
    for words in ("What was identified", "Over the material", "only … samples", "it is damaged"):
        assert words in page
    assert "&lt;b&gt;.csv" in page
    assert "<b>.csv" not in page
    assert "Outliers" not in page
    assert "Findings of the diagnosis" not in page
    assert "not checked" not in page
    monkeypatch.setattr("palpate.fleet.report.drawing", lambda *_: iter(()))
    unchecked = written(tmp_path / "n", rows([1.0] * 6, [0.1] * 6, checked=["none"] * 6))
    assert "Neither the data nor the fits were checked" in fleet_page(unchecked)
    assert read_results(folder).num_rows == 37
