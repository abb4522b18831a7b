"""The bank's files, the table, and the command."""

import json
from pathlib import Path

import jsonschema
import pytest
from typer.testing import CliRunner

from bench.app import app
from bench.control import rules
from bench.control.bars import bars
from bench.control.figures import Figures, refused
from bench.control.oracle import Least
from bench.control.scenario import chosen, load_bank
from bench.schemas import FORMATS
from bridge.faults import Fault
from tests.bank import BANK

OWN = rules.NAMES[rules.CONTROLLER]


def test_the_bank_has_the_required_number_and_length_of_scenarios() -> None:
    assert len(BANK) >= 100
    assert len({entry.name for entry in BANK}) == len(BANK)
    false = [entry for entry in BANK if entry.family == "false"]
    assert sum(entry.duration_s for entry in false) >= 10 * 3600
    assert all(entry.duration_s >= 0.8 * 3600 for entry in false)
    assert all(entry.description for entry in BANK)
    needless = [entry for entry in BANK if entry.family == "not-needed"]
    assert all(entry.duration_s >= 170 for entry in needless)
    assert sum(entry.duration_s >= 60 and entry.bank.expect == "helped" for entry in BANK) >= 12


def test_the_controller_gets_the_stiffness_of_the_rig_or_of_the_scenario() -> None:
    by_name = {entry.name: entry.table["controller"]["drive_stiffness_N_per_m"] for entry in BANK}
    assert by_name["pair-c45-0.5"] == pytest.approx(11700.0)
    assert by_name["told-10"] == pytest.approx(117000.0)
    assert by_name["told-0.1-belt"] == pytest.approx(1e5)


def test_only_takes_a_family_or_the_begin_of_a_name() -> None:
    assert {entry.family for entry in chosen(BANK, ["late"], small=False)} == {"late"}
    assert [entry.name for entry in chosen(BANK, ["pair-c45-1"], small=False)][:1] == ["pair-c45-1"]
    assert all(entry.bank.small for entry in chosen(BANK, [], small=True))
    with pytest.raises(Fault, match="no such family"):
        chosen(BANK, ["ghost"], small=False)


def test_a_file_without_scenarios_and_a_misspelt_key_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "one.toml"
    path.write_text('description = "x"\n')
    with pytest.raises(Fault, match="scenario"):
        load_bank(tmp_path)
    path.write_text(
        '[rig]\nfile = "paper-c45-c45"\n[[sweep]]\n[sweep.values.a]\ndescription = "b"\nbank.expects = "blind"\n'
    )
    with pytest.raises(Fault, match="expects"):
        load_bank(tmp_path)


def made(subject: str, scenario: str = "a", **values: object) -> Figures:
    empty = refused(BANK[0], subject, "nothing")
    return empty._replace(scenario=scenario, expect="helped", failures=[], **values)


def holds(name: str, *measured: Figures, least: dict[str, Least] | None = None, cost: float = 0.05) -> bool | None:
    return next(bar.holds for bar in bars(measured, least or {}, cost, OWN) if bar.name.startswith(name))


@pytest.mark.parametrize(
    ("name", "good", "bad"),
    [
        ("sticks", {"sticks": 1000, "recalled": 995}, {"sticks": 1000, "recalled": 994}),
        ("re-stick", {"late_ratios": [0.2, 1.0, 3.0]}, {"late_ratios": [0.2, 1.1, 3.0]}),
        ("false", {"duration_s": 7200.0, "false_claims": 1}, {"duration_s": 7200.0, "false_claims": 2}),
        ("runs without", {"slips": 0}, {"surges": 1}),
        ("v_a >= v_d", {"covered": 1e5, "uncovered": 49.0}, {"covered": 1e5, "uncovered": 51.0}),
        ("v_a above", {"above_s": 0.006, "above_limit_s": 0.006}, {"above_s": 0.007, "above_limit_s": 0.006}),
        ("probing", {"moving_s": 60.0, "probe_share": 0.02}, {"moving_s": 60.0, "probe_share": 0.021}),
        ("axes where", {"expect": "blind"}, {"expect": "blind", "failures": ["BLIND never reported; within 1.00 s"]}),
        ("scenarios refused", {}, {"failures": ["refused: why"]}),
    ],
)
def test_a_bar_holds_up_to_its_limit(name: str, good: dict[str, object], bad: dict[str, object]) -> None:
    one = made(OWN)
    assert holds(name, one._replace(**({"delays_s": good.get("late_ratios", [])} | good))) is True  # pyright: ignore[reportArgumentType]
    assert holds(name, one._replace(**({"delays_s": bad.get("late_ratios", [])} | bad))) is False  # pyright: ignore[reportArgumentType]


def test_the_energy_is_compared_with_the_energy_of_the_least_constant_ratio() -> None:
    least = {"a": Least(1.0, 0.5)}
    assert holds("energy over", made(OWN, settled_ratio=1.15), least=least) is True
    assert holds("energy over", made(OWN, settled_ratio=1.16), least=least) is False
    assert holds("energy over", made(OWN, settled_ratio=1.44), least={"a": Least(1.2, 1.2)}) is True
    assert holds("energy over", made(OWN)) is None


def test_the_cost_of_a_step_is_reported() -> None:
    assert holds("cost", made(OWN), cost=0.5) is None


def test_a_rival_with_fewer_slips_for_less_energy_beats_the_controller() -> None:
    moving, other = rules.NAMES[rules.MOVING], rules.NAMES[rules.BURST]
    mine = made(OWN, slips=1, energy_ratio=1.1)
    rival = made(moving, slips=2, energy_ratio=1.4)
    assert holds("slips", mine, rival, made(other, slips=2, energy_ratio=1.0)) is True
    assert holds("slips", mine, rival, made(other, slips=1, energy_ratio=1.0)) is False
    assert holds("slips", mine._replace(slips=3), rival) is False


@pytest.mark.slow
@pytest.mark.parametrize(
    ("only", "small"), [(("stiff-20",), False), pytest.param((), True, marks=pytest.mark.nightly)], ids=["one", "small"]
)
def test_bench_control_writes_table_page_and_json(tmp_path: Path, only: tuple[str, ...], small: bool) -> None:
    page, table = tmp_path / "control.html", tmp_path / "control.json"
    which = [word for name in only for word in ("--only", name)] + ["--small"] * small
    words = ["control", *which, "--jobs", "1", "--report", str(page), "--json", str(table)]
    result = CliRunner().invoke(app, words)
    assert result.exit_code in {0, 1}
    report = json.loads(table.read_text())
    assert (result.exit_code == 0) == report["passed"]
    jsonschema.validate(report, FORMATS["bench-control-result"].schema(), jsonschema.Draft202012Validator)
    runs = {(run["scenario"], run["subject"]): run for run in report["runs"]}
    assert len(runs) == 6 * len({name for name, _ in runs})
    none, moving = (
        [one for (_, subject), one in runs.items() if subject == rules.NAMES[rule] and one["expect"] == "helped"]
        for rule in (rules.NONE, rules.MOVING)
    )
    assert (
        len(none)
        == len(moving)
        == sum(entry.bank.expect == "helped" for entry in chosen(BANK, list(only), small=small))
    )
    assert all(entry["slips"] > 5 for entry in none)
    assert all(entry["slips"] + entry["surges"] == 0 for entry in moving)
    text = page.read_text()
    assert text.index("asked for") < text.index("Failures and their causes")
    for run in report["runs"]:
        assert run["scenario"] in text
    assert "scenarios" in result.stdout.splitlines()[-2]
