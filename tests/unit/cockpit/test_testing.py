"""`stickslip test`: results, exit status, kept logs, JUnit XML, mutants and old logs."""

import json
import multiprocessing
from pathlib import Path
from xml.etree import ElementTree as Xml

import jsonschema
import pytest
from typer.testing import CliRunner

from bridge.faults import Fault
from bridge.log.logfile import read_run
from bridge.pages import STYLE
from cockpit.cli import app
from cockpit.commands.as_json.schemas import FORMATS
from cockpit.expect.judge import FAILED, UNTESTED
from cockpit.run.scenario import load_scenario
from cockpit.run.scenario_file import deploy_folder
from cockpit.testing.suite import cases_of, mutants_of, run_tests

HEAD = 'duration_s = 0.6\narm = true\nrig = { file = "paper-c45-c45" }\n'
GOOD = '[[expect]]\nname = "stroke"\nrequirement = "R-7"\nsignal = "amplitude_m"\nat_most = "28 nm"\n'
BAD = '[[expect]]\nsignal = "amplitude_m"\nat_least = "28 nm"\nfrom_s = 0.3\n'
DOUBTFUL = '[[expect]]\nsignal = "time_to_slip_s"\nat_least = 1.0\n'
MUTANT = '[[must_fail]]\nabout = "more vibration"\nsettings = ["controller.limits.v_ratio={}"]\n'


def call(*words: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["test", *words, "--jobs", "1"])
    return result.exit_code, result.stdout


def folder_of(tmp_path: Path, **texts: str) -> str:
    folder = tmp_path / "tests"
    folder.mkdir()
    for name, text in texts.items():
        (folder / f"{name}.toml").write_text(HEAD + text)
    return str(folder)


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_results_exit_status_and_logs(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, good=GOOD, bad=GOOD + BAD, doubtful=GOOD + DOUBTFUL, other="", broken="[[expect]]\n")
    status, text = call(folder, "--junit", "r.xml", "--json", "r.json", "--html", "r.html")
    assert status == 1
    assert "PASSED   good: 1 expectation" in text
    assert "FAILED   bad: 1 FAILED, 1 PASSED" in text
    assert "FAILED   amplitude_m at least 28 nm: 21." in text
    assert "replay   stickslip replay runs/tests/bad.mcap" in text
    assert "UNTESTED doubtful: 1 UNTESTED, 1 PASSED" in text
    assert "ERROR    broken: CONFIG: broken.toml" in text
    assert "skipped  1 .toml file without [[expect]]" in text
    assert sorted(path.name for path in Path("runs/tests").iterdir()) == ["bad.mcap", "doubtful.mcap"]
    suite = json.loads(Path("r.json").read_text())
    jsonschema.validate(suite, FORMATS["test-result"].schema())
    assert suite["counts"] == {"PASSED": 1, "FAILED": 1, "UNTESTED": 1, "ERROR": 1}
    root = Xml.parse("r.xml").getroot()  # noqa: S314
    assert (root.get("tests"), root.get("failures"), root.get("errors")) == ("4", "1", "2")
    html = Path("r.html").read_text()
    assert html.index('class="verdict bad"') < html.index("ERROR broken") < html.index("PASSED good")
    assert html.count("<svg") == 2  # time_to_slip_s has no sample
    assert "http" not in html.replace("http://www.w3.org/2000/svg", "")
    assert (len(html) - len(STYLE.read_text())) / 4 < 10_000
    assert all("picture" not in test for test in suite["tests"])
    properties = {row.get("name"): row.get("value") for row in root.iterfind("testcase[@name='good']/properties/*")}
    assert properties["requirement"] == "R-7"
    assert properties["rig"] == "paper-c45-c45"


def test_a_misspelt_table_in_a_folder_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text("mass_kg = 1.0\n")
    (tmp_path / "misspelt.toml").write_text(HEAD + GOOD.replace("expect", "expct"))
    status, text = call(str(tmp_path))
    assert status == 2
    assert "ERROR    misspelt: CONFIG: misspelt.toml" in text
    assert "skipped  1 .toml file without [[expect]]" in text


def test_a_test_without_evidence_ends_with_14(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, doubtful=DOUBTFUL)
    assert call(folder)[0] == 14
    status, text = call(f"{folder}/doubtful.toml", "--set", "expect=[]")
    assert (status, "UNTESTED doubtful: no [[expect]]" in text) == (14, True)


def test_a_test_that_cannot_run_ends_with_2(tmp_path: Path) -> None:
    assert call(folder_of(tmp_path, good=GOOD, broken="[[expect]]\n"))[0] == 2


def test_an_old_log_is_judged_without_a_run(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, bad=BAD)
    call(folder)
    before = read_run(Path("runs/tests/bad.mcap")).checksums
    status, text = call(f"{folder}/bad.toml", "--log", "runs/tests/bad.mcap", "--set", "expect=[{ slips = 0 }]")
    assert (status, "PASSED   bad" in text) == (0, True)
    assert read_run(Path("runs/tests/bad.mcap")).checksums == before
    status, text = call(
        f"{folder}/bad.toml",
        "--log",
        "runs/tests/bad.mcap",
        "--set",
        "duration_s=5.0",
        "--set",
        "expect=[{ slips = 0, to_s = 5.0 }]",
    )
    assert (status, UNTESTED in text) == (14, True)


def test_an_expectation_that_no_defect_breaks_is_listed(tmp_path: Path) -> None:
    status, text = call(folder_of(tmp_path, two=GOOD + "[[expect]]\nslips = 0\n" + MUTANT.format(1.7)), "--mutants")
    assert status == 0
    assert "unshown  two: slips 0: no defect made it fail" in text
    assert "unshown  two: stroke" not in text


def test_a_mutant_must_make_a_test_fail(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, found=GOOD + MUTANT.format(1.7), missed=GOOD + MUTANT.format(1.25), without=GOOD)
    status, text = call(folder, "--mutants")
    assert status == 1
    assert "mutants  1 of 2 defects made a test fail" in text
    assert "MISSED   missed with more vibration" in text
    assert "UNTESTED without: no [[must_fail]]" in text
    assert not Path("runs").exists()
    assert call(f"{folder}/without.toml", "--mutants")[0] == 14


def test_a_folder_without_tests_is_refused(tmp_path: Path) -> None:
    assert CliRunner().invoke(app, ["test", folder_of(tmp_path, other="")]).exit_code == 2
    assert CliRunner().invoke(app, ["test", "nowhere"]).exit_code == 2


@pytest.mark.slow
def test_the_shipped_tests_pass_and_each_of_their_defects_is_found() -> None:
    """Three of them; `make nightly` has all."""
    cases, _ = cases_of([deploy_folder() / "tests"], [])
    few = [case for case in cases if case.name in {"limits", "stop", "reverse"}]
    assert [test.result for test in run_tests(few, 1, None, lambda _share: None)] == ["PASSED"] * 3
    mutants, without = mutants_of(cases)
    assert not without
    few = [case for case in mutants if case.name == "limits"]
    assert {test.result for test in run_tests(few, 1, None, lambda _share: None)} == {FAILED}


@pytest.mark.nightly
def test_all_shipped_tests_and_defects() -> None:
    assert call()[0] == 0
    status, text = call("--mutants")
    assert (status, "unshown" in text) == (0, False)


@pytest.mark.slow
def test_a_killed_process_ends_the_tests_with_a_fault(tmp_path: Path) -> None:
    cases, _ = cases_of([Path(folder_of(tmp_path, one=GOOD + SWEEP))], [])
    others = set(multiprocessing.active_children())  # workers that earlier tests keep

    def kill(_share: float) -> None:
        for process in set(multiprocessing.active_children()) - others:
            process.kill()

    with pytest.raises(Fault, match="a process of the tests was killed"):
        run_tests(cases, 2, None, kill)
    assert set(multiprocessing.active_children()) <= others


SWEEP = """
[[sweep]]
key = "seed"
values = [1, 2]

[[sweep]]
common = { duration_s = 0.4 }
[sweep.values]
tight = { "expect.0.at_most" = "1 nm" }
more = { "expect.1" = { slips = 0 }, controller.limits.v_ratio = 1.3 }
"""


def test_each_value_of_a_sweep_is_a_test(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, one=GOOD + SWEEP)
    status, text = call(folder)
    assert status == 1
    assert [line[:24].strip() for line in text.splitlines() if line[0] != " "] == [
        "PASSED   one-seed=1: 1 e",
        "PASSED   one-seed=2: 1 e",
        "FAILED   one-tight: 1 FA",
        "PASSED   one-more: 2 exp",
        "tests    4 tests: 3 PASS",
    ]
    assert call(f"{folder}/one.toml:seed=2")[0] == 0
    made = load_scenario(f"{folder}/one.toml:more", [])
    assert (made.name, made.duration_s, made.controller.limits.v_ratio, len(made.expect)) == ("more", 0.4, 1.3, 2)


@pytest.mark.parametrize(
    ("sweep", "error"),
    [
        ('key = "seed"\nvalues = [1, 1]', "seed=1: is used twice"),
        ("values = [1]", "key: missing"),
        ('key = "expect.3.at_most"\nvalues = [1]', "expect is a list: must be expect.0 to expect.1"),
        ('key = "sed"\nvalues = [1, 2, 3]', "sed = 1: unknown key; perhaps seed"),
    ],
)
def test_a_wrong_sweep_is_an_error(tmp_path: Path, sweep: str, error: str) -> None:
    status, text = call(folder_of(tmp_path, one=f"{GOOD}[[sweep]]\n{sweep}\n"))
    assert (status, error in text) == (2, True), text
    assert text.count("ERROR    one") == 1  # for all cases of a sweep


def test_an_unknown_case_names_a_similar_one(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, one=GOOD + SWEEP)
    status, text = call(f"{folder}/one.toml:tigt")
    assert (status, "no such case; perhaps tight" in text) == (2, True), text


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ('[[expect]]\nname = "stroke"\nslips = 0\n', "expect: name = stroke: is used twice"),
        ('[[sweep]]\nkey = "seed"\nvalues = []\n', "values: is empty"),
        (
            '[[fault]]\nkind = "stuck"\ntarget = "mass_accel_mps2"\n[rig.channels.mass_accel_mps2]\nabsent = true\n',
            "fault.0: mass_accel_mps2: is absent in this rig",
        ),
    ],
)
def test_a_test_of_nothing_is_refused(tmp_path: Path, text: str, line: str) -> None:
    folder = Path(folder_of(tmp_path, one=GOOD + text))
    test = folder / "one.toml"
    test.write_text(test.read_text().replace('rig = { file = "paper-c45-c45" }', 'rig.file = "paper-c45-c45"'))
    status, output = call(str(folder))
    assert (status, line in output) == (2, True), output


@pytest.mark.parametrize(
    ("rig", "text", "why"),
    [
        (
            "rig.channels.mass_accel_mps2.absent = true",
            'signal = "mass_accel_mps2"\nwithin = [-50.0, 50.0]',
            "mass_accel_mps2 is not in the log",
        ),
        ("rig.drive.profile = [[0.0, 0.0]]", "slips = 0", "the drive rests in the whole window"),
        ("", "slips = [0, 1000]", "is one a block or more, and cannot fail"),
        ("", 'signal = "drive_velocity_mps"\nwithin = [-1.0, 1.0]', "perhaps in another unit"),
    ],
)
def test_an_expectation_that_cannot_fail_is_untested(tmp_path: Path, rig: str, text: str, why: str) -> None:
    head = HEAD.replace('rig = { file = "paper-c45-c45" }', f'rig.file = "paper-c45-c45"\n{rig}')
    (tmp_path / "one.toml").write_text(f"{head}[[expect]]\n{text}\n")
    status, output = call("one.toml")
    assert (status, why in output) == (14, True), output
