"""The folder of a fleet: finished rigs, rigs that share a gap, and their order."""

import json
import os
import signal
from pathlib import Path

import pytest

from cockpit.fleet import work
from cockpit.fleet.groups import Failed, fleet_of
from cockpit.fleet.work import RESULTS, FleetFolder, digest_of, keep, kept, report_names, write_page
from diagnosis.diagnose_many import FolderFault, FolderResult, find_sources
from diagnosis.result import Diagnosis, Share
from tests import made_up

DIAGNOSIS = made_up.diagnosis()


@pytest.fixture(autouse=True)
def version(monkeypatch):
    monkeypatch.setattr(work, "tool_version", lambda: "1.0+abc")  # reads the whole package, for a second


def named(*effects: str, closes: float | None, verdict="effect") -> Diagnosis:
    return DIAGNOSIS._replace(verdict=verdict, effects=effects, gap=DIAGNOSIS.gap._replace(shrinkage=closes), shares=())


def digest(folder: Path, tool: str = "1.0+abc", budget_s: float | None = None) -> str:
    return digest_of(folder, tool, budget_s)


def test_a_digest_is_of_the_files_the_version_and_the_time_allowed(tmp_path):
    one, other = (made_up.evidence_folder(tmp_path / name / "rig") for name in ("one", "other"))
    os.utime(other / "run-01.csv", (1, 1))
    (other / "notes.txt").write_text("no part of the evidence")
    assert digest(one) == digest(other)
    assert len({digest(one), digest(one, tool="1.0+abd"), digest(one, budget_s=30.0)}) == 3
    with (other / "run-01.csv").open("a") as file:
        file.write("1.0005,15.0\n")
    assert digest(one) != digest(other)


def test_a_kept_result_is_read_back_and_a_partial_result_is_not(tmp_path):
    (tmp_path / "a.html").write_text("report")
    keep(tmp_path, "d", DIAGNOSIS, "a.html")
    diagnosis, report = kept(tmp_path, "d") or (None, "")
    assert (repr(diagnosis), report) == (
        repr(DIAGNOSIS._replace(pictures=())),
        "a.html",
    )  # by repr, as NaN does not equal NaN
    assert kept(tmp_path, "e") is None
    place = tmp_path / RESULTS / "d.json"
    whole = place.read_text()
    for broken in (
        whole[:-40],
        "",
        "[]",
        whole.replace("fleet-result/1", "fleet-result/0"),
        whole.replace("0.95,", '"x",', 1),
    ):
        place.write_text(broken)
        assert kept(tmp_path, "d") is None
    place.write_text(whole)
    (tmp_path / "a.html").write_text("rep")
    assert kept(tmp_path, "d") is None


@pytest.mark.slow
def test_only_changed_or_failed_folders_are_diagnosed_again(tmp_path):
    folders = [made_up.evidence_folder(tmp_path / "all" / name) for name in ("a", "b", "c")]
    sources = find_sources(folders)
    fleet = FleetFolder(tmp_path / "out", sources, None)
    assert fleet.kept() == []
    for source in sources[:2]:
        fleet.add(FolderResult(source, DIAGNOSIS, None))
    fleet.add(FolderResult(sources[2], None, FolderFault("PEER_DIED", "c: its worker process died")))
    assert fleet.refused == []
    assert [failure.evidence for failure in fleet.fleet().failed] == ["c"]
    again = FleetFolder(tmp_path / "out", sources, None)
    assert [result.source.name for result in again.kept()] == ["a", "b"]
    assert again.fleet().left == ("c",)
    assert [rig.report for rig in again.fleet().groups[0].rigs] == ["a.html", "b.html"]
    (folders[1] / "manifest.toml").write_text(made_up.MANIFEST.replace("14.49", "14.5"))
    assert [result.source.name for result in FleetFolder(tmp_path / "out", sources, None).kept()] == ["a"]
    assert FleetFolder(tmp_path / "out", sources, 30.0).kept() == []


@pytest.mark.slow
def test_a_process_killed_while_writing_keeps_finished_results(tmp_path, monkeypatch):
    """A child writes one result and is killed during the next: its report is written, its result is partial."""
    sources = find_sources([made_up.evidence_folder(tmp_path / name) for name in ("a", "b")])

    def half_kept(fleet, digest, diagnosis, report):
        place = fleet / RESULTS / f"{digest}.json"
        place.write_text('{"format": "fleet-result/1", "rep')
        os.kill(os.getpid(), signal.SIGKILL)

    child = os.fork()
    if child == 0:
        fleet = FleetFolder(tmp_path / "out", sources, None)
        fleet.add(FolderResult(sources[0], DIAGNOSIS, None))
        monkeypatch.setattr(work, "keep", half_kept)
        fleet.add(FolderResult(sources[1], DIAGNOSIS, None))
        os._exit(1)
    assert os.WTERMSIG(os.waitpid(child, 0)[1]) == signal.SIGKILL
    assert (tmp_path / "out/b.html").is_file()
    assert json.loads((tmp_path / "out/index.json").read_text())["left"] == ["b"]
    assert [result.source.name for result in FleetFolder(tmp_path / "out", sources, None).kept()] == ["a"]


@pytest.mark.slow
def test_an_evidence_that_changed_under_way_is_not_kept(tmp_path):
    sources = find_sources([made_up.evidence_folder(tmp_path / "a")])
    fleet = FleetFolder(tmp_path / "out", sources, None)
    (tmp_path / "a/manifest.toml").write_text(made_up.MANIFEST.replace("14.49", "14.5"))
    fleet.add(FolderResult(sources[0], DIAGNOSIS, None))
    assert (tmp_path / "out/a.html").is_file()
    assert not (tmp_path / "out" / RESULTS).exists()


def test_where_mending_helps_most_comes_first():
    place = Share("breakaway level", "friction that goes with place", 0.73, (0.61, 0.92), 0.3)
    unexplained = DIAGNOSIS._replace(verdict="unexplained", effects=())
    done = [
        ("fine", DIAGNOSIS._replace(verdict="no-gap", effects=()), "fine.html"),
        ("p", named("drive-backlash", closes=1.2), "p.html"),
        ("q", named("coulomb-level", closes=0.5), "q.html"),
        ("r", named("coulomb-level", closes=0.8, verdict="partly"), "r.html"),
        ("s", unexplained._replace(shares=(place,)), "s.html"),
        ("t", unexplained._replace(shares=()), "t.html"),
        ("u", named("force-sensor-lag", closes=-0.4), "u.html"),
    ]
    fleet = fleet_of(done, [Failed("v", "BAD_EVIDENCE", "too short")], ["w"])
    assert fleet.folders == 9
    assert [(group.what, [rig.evidence for rig in group.rigs]) for group in fleet.groups] == [
        ("coulomb-level", ["r", "q"]),
        ("drive-backlash", ["p"]),
        ("friction that goes with place in the breakaway level", ["s"]),
        ("force-sensor-lag", ["u"]),
        ("something in the spring relation", ["t"]),
        ("", ["fine"]),
    ]
    assert [round(group.helps, 6) for group in fleet.groups] == [1.3, 1.0, 0.73, 0.0, 0.0, 0.0]


def test_wrong_numbers_are_a_shared_cause_and_what_was_not_finished_is_none():
    described = DIAGNOSIS._replace(verdict="described", effects=("drive-stiffness",))
    mass = DIAGNOSIS.numbers[0]._replace(name="mass_kg", share=0.7)
    done = [
        ("a", described, ""),
        ("b", described._replace(effects=(), numbers=(mass,)), ""),
        ("c", DIAGNOSIS._replace(verdict="not-finished", effects=()), ""),
    ]
    groups = fleet_of(done, [], []).groups
    assert [(group.kind, group.what, group.helps) for group in groups] == [
        ("named", "mass", 0.7),
        ("named", "drive-stiffness", 0.43),
        ("not-finished", "", 0.0),
    ]
    assert groups[1].rigs[0].size.endswith("described 11.7 kN/m (2.9 tolerances off), closes 43 % of the gap")


def test_without_a_fit_the_relations_give_the_share():
    diagnosed = DIAGNOSIS._replace(verdict="partly", gap=DIAGNOSIS.gap._replace(shrinkage=None, interval_90=None))
    (group,) = fleet_of([("rig", diagnosed, "")], [], []).groups
    assert (group.helps, group.rigs[0].interval_90) == (0.73, (0.61, 0.92))
    assert group.rigs[0].size.startswith("spring relation: drive-backlash 73 %")


def test_the_page_has_every_rig_and_needs_no_network(tmp_path):
    done = [("<b>rig 1", DIAGNOSIS, "b#1.html"), ("fine", DIAGNOSIS._replace(verdict="no-gap", effects=()), "")]
    write_page(fleet_of(done, [Failed("bad", "BAD_EVIDENCE", "too short")], ["later"]), tmp_path / "index.html")
    text = (tmp_path / "index.html").read_text()
    assert '<a href="b%231.html">&lt;b&gt;rig 1</a>' in text
    assert all(word in text for word in ("fine", "too short", "later", "1 rig with a gap, 1 without"))
    assert "http" not in text.replace("http-equiv", "")


def test_a_report_never_takes_the_place_of_the_index():
    assert report_names(["index", "a", "A", "x/a"]) == {
        "index": "index-2.html", "a": "a.html", "A": "A-2.html", "x/a": "x_a.html",
    }  # fmt: skip


@pytest.mark.slow
def test_the_index_as_json_is_the_same(tmp_path):
    sources = find_sources([made_up.evidence_folder(tmp_path / "a")])
    fleet = FleetFolder(tmp_path / "out", sources, None)
    fleet.add(FolderResult(sources[0], DIAGNOSIS, None))
    index = json.loads((tmp_path / "out/index.json").read_text())
    assert (index["format"], index["folders"], index["left"]) == ("fleet/1", 1, [])
    assert index["groups"][0]["rigs"][0]["report"] == "a.html"
