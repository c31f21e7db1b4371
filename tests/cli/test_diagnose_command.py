"""The verdict and the law on the command line: what is printed, what mends it, how it ends."""

import importlib.metadata
import json
import re
from email.message import Message
from pathlib import Path

import faults
import pytest
from recordings import text_of, written

import palpate
from palpate.findings import Check, _documentation
from palpate.identification.hold_out import check_prediction
from palpate.output.reports.html import render_sections
from palpate.output.results.view import findings_section


@pytest.fixture
def write(tmp_path):
    def write(contact: palpate.Contact, **changes):
        given = {"penetration_m": contact.penetration, "force_N": contact.force} | changes
        numbers = zip(contact.time, *given.values(), strict=True)
        text = text_of([[f"{x:.12g}" for x in row] for row in numbers], ["time_s", *given])
        return written(tmp_path / "probe.csv", text)

    return write


def result_of(output: str) -> dict:
    [result] = json.loads(output)["results"]
    return result


def test_diagnose_prints_every_finding_with_its_remedy(printed, write):
    path = write(faults.changed(0.2))
    found, words = palpate.diagnose(path), printed("diagnose", path)
    assert all(finding.check.split()[0] in words for finding in found.findings)
    assert "→ identify each segment separately: --changes" in words
    assert f"{found.episodes[0].stop:.4g} s: K = " in words
    out = printed("diagnose", path, "--json")
    assert json.loads(out)["schema_version"] == 4
    printed = result_of(out)
    episodes = [{**episode, "verdict": None} for episode in printed["episodes"]]
    same = {key: printed[key] for key in found.as_dict()} | {"episodes": episodes}
    assert same == found.as_dict()
    assert [each["verdict"]["stiffness"] for each in printed["episodes"]] == ["trust", "trust"]
    assert list(printed["verdict"]) == ["stiffness", "damping"]
    assert list(printed["working_depth"]) == ["depth", "force", "stiffness", "damping", "speed"]
    assert list(printed["findings"][0]) == [
        "check", "message", "remedy", "severity", "z", "stiffness", "damping",
        "moves_stiffness_percent", "moves_damping_percent", "brief",
    ]  # fmt: skip
    assert list(printed["episodes"][0]) == [
        "start", "stop", "kind", "law", "working_depth", "verdict",
    ]  # fmt: skip


@pytest.mark.long
def test_each_segment_between_changes_is_identified_by_itself(run, write):
    path = write(faults.changed(0.5))
    whole = result_of(run("identify", path, "--json")[1])
    parts = result_of(run("identify", path, "--changes", "--json")[1])
    first, second = parts["episodes"]
    assert [e["working_depth"]["damping"]["mark"] for e in parts["episodes"]] == ["trust", "trust"]
    ratio = second["working_depth"]["stiffness"]["value"]
    assert ratio / first["working_depth"]["stiffness"]["value"] == pytest.approx(1.5, rel=0.01)
    assert first["working_depth"]["stiffness"]["standard_error"] > 0.0
    assert parts["law"] == whole["law"]
    assert parts["fit_rmse_percent"] < 0.1 * whole["fit_rmse_percent"]
    words = run("identify", path, "--changes")[1]
    row = next(line for line in words.splitlines() if f" to {first['stop']:.4g} " in line)
    assert row.endswith("  trust")
    assert "--changes" not in words  # which was just done
    assert whole["changes"] == []  # a plain estimator looks for none
    # Half as much stiffness again shows in a sample or two, but the probe has to come to where it
    # was before: within a tenth of the slowest sine, which takes 1.6 s.
    assert parts["changes"] == pytest.approx([3.5], abs=0.16)
    assert "the online change detector raises an alarm at 3.5" in words
    assert "motion" not in words  # which is not to blame for what two materials leave open


FAULTS = {"do not trust": faults.changed(0.5), "late": faults.late(5e-3),
          "trust": faults.clean()}  # fmt: skip


@pytest.mark.parametrize(
    "command, fault, asked, status",
    [
        ("diagnose", "do not trust", "do-not-trust", 3),
        ("diagnose", "late", "with-care", 0),  # the damping, which nobody asked for
        ("diagnose", "trust", "with-care", 0),
        ("identify", "do not trust", "with-care", 3),
    ],
)
def test_a_mark_can_set_the_exit_status(run, write, command, fault, asked, status):
    assert run(command, write(FAULTS[fault]), "--fail-on", asked)[0] == status


def test_an_untrusted_damping_can_set_the_exit_status(run, write):
    """The force is late: the stiffness is trusted, the damping is not."""
    asked = "identify", write(FAULTS["late"]), "--fail-on", "with-care"
    assert run(*asked)[0] == 0
    assert run(*asked, "--impact-speed", "0.1m/s")[0] == 3
    assert run(*asked, "--frequency", "1.5Hz")[0] == 3


REMEDIES = {
    "delay": (faults.late(5e-3), ["--delay", "5ms", "--at", "5mm"]),
    "delay with its error": (faults.late(5e-3), ["--delay", "5ms+-0.1ms"]),
    "delay to be found": (faults.late(5e-3), ["--delay", "find"]),
    "surface": (faults.surface_off(-0.8e-3), ["--surface", "estimate"]),
    "surface as given": (faults.surface_off(-0.8e-3), ["--surface", "-0.8mm"]),
    "millimetres": (faults.scaled(penetration=1e3), ["--unit", "penetration=mm"]),
    "milliseconds": (faults.scaled(time=1e3), ["--unit", "time=ms"]),
    "both": (faults.scaled(penetration=1e3, force=1e3), ["--unit", "penetration=mm,force=mN"]),
    "force": (faults.scaled(force=-1.0), ["--flip-force"]),
    "penetration": (faults.scaled(penetration=-1.0), ["--flip-penetration"]),
}


@pytest.mark.long
@pytest.mark.parametrize("name", REMEDIES)
def test_a_remedy_mends_what_it_is_for(printed, write, name):
    contact, options = REMEDIES[name]
    result = result_of(printed("identify", write(contact), *options, "--json"))
    assert set(result["verdict"].values()) == {"trust"}
    there = result["working_depth"]
    assert ("--at" in options) == (there["depth"] == 5e-3)
    truth = faults.LAW.stiffness_at(there["depth"])
    assert there["stiffness"]["value"] == pytest.approx(truth, rel=0.02)


def test_a_failed_identification_ends_with_its_finding(refused, write):
    contact = faults.scaled(force=-1.0)
    line = refused("identify", write(contact, force_N=contact.force - 1.0))
    assert "the force is negative" in line
    assert "--flip-force" in line


@pytest.mark.long
def test_compare_recommends_nothing_if_nothing_is_trusted(run, write):
    path = write(faults.remembering(0.1, 1.0))
    status, out, _ = run("compare", path, "--json", "--fail-on", "with-care")
    ranking = json.loads(out)["ranking"]
    assert status == 3
    assert sorted(ranking["order"]) == sorted(palpate.ESTIMATORS)
    assert ranking["failing"] == ["double-stage"]
    assert all("exclude each other" in words for words in ranking["exclusions"])
    out = run("compare", write(faults.changed(1.0)))[1]
    assert "recommended method: none" in out


PHANTOM = Path(__file__).parents[2] / "examples" / "recordings" / "phantom.csv"
BALL = PHANTOM.with_name("ball.csv")


def test_a_law_is_chosen_and_reported(run, printed):
    out = printed("identify", PHANTOM, "--law", "auto")
    result = palpate.identify(PHANTOM, law="auto", trace=False)
    assert result.law_verdict.candidate.title in out
    whole = " ".join(run("identify", PHANTOM, "--law", "auto", "-v")[1].split())
    assert f"method {result.method}" in whole
    assert f"effective sample size {result.law_verdict.effective_samples:.0f} of" in whole


def test_dynamic_stiffness_and_model_selection_are_printed(run, printed):
    own = palpate.identify(BALL, trace=False).dynamic_stiffness().frequency
    often = ("--frequency", f"{own:.6f}rad/s")
    out = printed("identify", BALL, *often)
    assert re.search(r"^oscillation +at 1\.58 Hz and 8\.78 mm: K′ = 2000\.7 ", out, re.MULTILINE)
    out = run("identify", BALL, *often, "-v")[1]
    assert "Model selection: Hunt–Crossley, rms error 71 mN, 0.107 N with half-space damping" in out
    _, printed, _ = run("identify", BALL, *often, "--json")
    felt = json.loads(printed)["results"][0]["small_oscillation"]
    assert felt["frequency"] == pytest.approx(own, abs=1e-6)


def test_options_in_a_file_hold_the_law(run, tmp_path):
    options = tmp_path / "options.toml"
    run("identify", BALL, "--law", "half-space", "--save-config", options)
    assert 'law = "half-space"' in options.read_text()
    [result] = json.loads(run("identify", BALL, "--config", options, "--json")[1])["results"]
    assert result["law"]["p"] == result["law"]["n"] - 1.0


def test_a_fleet_takes_the_law_too(printed, tmp_path, threaded):
    out = printed("fleet", BALL, "-o", tmp_path / "out", "--law", "auto", "--json")
    assert json.loads(out)["identified"] == 1


def test_one_half_predicts_the_other_as_well_as_hunt_crossley(run):
    out = " ".join(run("identify", BALL, "--hold-out")[1].split())
    assert "hold-out the law of the first half predicts the second to 0.4 % of the force" in out


def test_a_law_that_predicts_worse_than_hunt_crossley_is_untrusted(ball):
    contact, force = ball.contact, ball.predicted_force(ball.contact)
    for worse, mark in ((1.0, "trust"), (1.5, "do-not-trust")):
        found = check_prediction(
            contact, ball.trace.taken, lambda _, whole, by=worse: by * force, lambda _, whole: force
        )
        assert (found.check, found.stiffness) == ("hold-out", mark)


def test_explain_lists_every_finding_and_prints_what_one_means(printed, refused):
    listed = printed("explain")
    assert [check for check in Check if f"\n{check} " not in f"\n{listed}"] == []
    assert max(map(len, listed.splitlines())) <= 100
    for words in (["clock", "offset"], ["clock-offset"], ["Clock_offset"]):
        assert "→ Record position and force by one clock." in printed("explain", *words)
    options = re.findall(r"--[a-z][a-z-]+", "".join(check.meaning for check in Check))
    known = printed("identify", "--help")
    assert [option for option in options if option not in known] == []
    assert "did you mean delay?" in refused("explain", "delya")
    assert "palpate explain lists all" in refused("explain", "xyzzy")


@pytest.mark.parametrize("site", ["", "https://palpate.example/docs/"])
def test_a_finding_leads_to_its_item_where_the_build_was_told_the_site(site, printed, monkeypatch):
    package = Message()
    package["Project-URL"] = "Issues, https://elsewhere.example"
    if site:
        package["Project-URL"] = f"Documentation, {site}"
    monkeypatch.setattr(importlib.metadata, "metadata", lambda name: package)
    _documentation.cache_clear()
    link = "https://palpate.example/docs/reference/findings.html#dead-band" if site else ""
    assert Check.DEAD_BAND.link == link
    assert ("https://" in printed("explain", "dead band")) == bool(site)
    table = findings_section(palpate.identify(faults.recorded(faults.FORCE)))
    report = "".join(render_sections([table]))
    assert report.count('<a href="https://palpate.example/docs/') == len(table.rows) * bool(site)
    assert palpate.Finding("check of mine", "no link").link == ""
    _documentation.cache_clear()
