"""Bad configuration is one clear line: place, value, rule, remedy."""

import contextlib
import os
import re
from pathlib import Path

import pytest

from bridge.config import Strict, read_toml, validate, with_overrides
from bridge.faults import Fault
from cockpit.run.scenario import load_rig, load_scenario
from cockpit.run.scenario_file import rig_setting
from controller.config import ControllerConfig, candidate_frequencies_Hz
from plant.config import RigConfig
from plant.config_limits import refuse_a_spring_of_another_rig


@pytest.mark.parametrize("line", ["mass_kg = 2,0", "slide = { mass_kg = -2,0e-3 }"])
def test_a_decimal_comma_is_reported(tmp_path: Path, line: str) -> None:
    (tmp_path / "rig.toml").write_text(f"# a rig\n{line}\n")
    number = line.partition("kg = ")[2].rstrip(" }").replace(",", ".")
    with pytest.raises(Fault, match=rf"rig.toml: not valid TOML: .*line 2.*; write a decimal point: {number}$"):
        read_toml(tmp_path / "rig.toml")


def test_a_misspelt_key_is_not_reported_as_missing_too() -> None:
    class Slide(Strict):
        mass_kg: float
        length_m: float

    with pytest.raises(Fault) as raised:
        validate(Slide, {"mas_kg": 1.5}, "mine.toml")
    assert raised.value.line.splitlines() == [
        "mine.toml: length_m: missing; add it",
        "mine.toml: mas_kg = 1.5: unknown key; perhaps mass_kg; known here: length_m, mass_kg",
    ]


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (["rig.slide.mass_kg=-1.0"], ["rig.slide.mass_kg", "-1.0", "greater than 0"]),
        (["rig.slide.mas_kg=1.0"], ["rig.slide.mas_kg", "unknown key", "mass_kg"]),
        (['rig.slide.mass_kg="heavy"'], ["rig.slide.mass_kg", "'heavy'", "number"]),
        (["rig.slide.mass_kg=2,5"], ["rig.slide.mass_kg", "'2,5'", "number", "write a decimal point: 2.5"]),
        (["rig.slide.mass_kg=heavy"], ["rig.slide.mass_kg", "'heavy'", "number", "write digits, such as 1.5"]),
        (['rig.contact.pair="ice"'], ["ice", "unknown friction pair", "C45-C45 @ 0.063"]),
        (["rig.contact.pair=[1]"], ["pair = [1]", "unknown friction pair"]),
        (["rig.solver.step_s=2e-5"], ["step_s", "too coarse", "5000", "1e-05"]),
        (
            ["rig.slide.mass_kg=0.001"],
            ["slide.mass_kg = 0.001", "at least", "0.0078 kg", "shorten solver.step_s to 3.6e-06"],
        ),
        (
            ["rig.drive.stiffness_N_per_m=1e10"],
            [
                "drive.stiffness_N_per_m = 1e+10",
                "at most",
                "1.48e+09 N/m",
                "20 steps",
                "shorten solver.step_s to 3.8e-06 or less",
            ],
        ),
        (
            ["rig.drive.stiffness_N_per_m=1e9", "rig.effects.drive-stiffness.ratio=9.0"],
            ["drive.stiffness_N_per_m = 1e+09 with effects.drive-stiffness.ratio = 9", "1.48e+08 N/m", "to 3.8e-06"],
        ),
        (["rig.contact.static_force_N=1.0"], ["static_force_N", "coulomb_force_N"]),
        (["controller.samples_per_block=25"], ["samples_per_block", "must equal"]),
        (["controller.limits.stale_after_s=20"], ["controller.limits.stale_after_s", "20", "5"]),
        (["controller.limits.stale_after_s=0.0005"], ["limits.stale_after_s = 0.0005", "2 blocks", "raise it"]),
        (["rig.piezo.command_timeout_s=0.0005"], ["piezo.command_timeout_s = 0.0005", "2 blocks", "raise it"]),
        (
            ["controller.limits.frequency_max_Hz=5001.0"],
            ["controller.limits.frequency_max_Hz = 5001: must be at most 5000, the limit of the rig", "leave it out"],
        ),
        (
            ["controller.limits.frequency_min_Hz=500.0", "rig.piezo.frequency_min_Hz=650.0"],
            ["controller.limits.frequency_min_Hz = 500: must be at least 650"],
        ),
        (
            ["controller.limits.amplitude_max_m=1e-7", "rig.guard.stroke_m={alarm=5e-8, abort=1e-7}"],
            ["controller.limits.amplitude_max_m = 1e-07: must be at most 5e-08"],
        ),
        (["duration_s=200.0"], ["duration_s", "50 mm", "shorten"]),
        (["duration_s=1e9"], ["duration_s = 1e+09", "5e+08 mm", "after 100 s", "shorten"]),
        (
            ["rig.guard.forbidden_Hz=[[2600.0, 4600.0]]"],
            ["controller.limits.forbidden_Hz: no frequency is left: every multiple of 100 Hz between 2516.8 Hz"],
        ),
        (["controller.limits.forbidden_Hz=[[0.0, 9000.0]]"], ["forbidden_Hz", "no frequency is left"]),
        (
            ["controller.limits.forbidden_Hz=[[2600.0, 4000.0], [3900.0, 5000.0]]"],
            [
                "forbidden_Hz",
                "every multiple of 100 Hz",
                "2516.8 Hz, 2.2 x contact_resonance_Hz = 1144,",
                "frequency_max_Hz = 5000",
            ],
        ),
        (
            ["controller.contact_resonance_Hz=2300.0"],
            [
                "limits.frequency_max_Hz = 5000: no multiple of 100 Hz lies between",
                "5060 Hz, 2.2 x contact_resonance_Hz = 2300,",
                "2300, and it; lower the other value",
            ],
        ),
        (
            [
                "controller.limits.frequency_min_Hz=2420.0",
                *("controller.limits.frequency_max_Hz=2490.0", "controller.contact_resonance_Hz=0.0"),
            ],
            ["limits.frequency_max_Hz = 2490", "limits.frequency_min_Hz = 2420", "raise it to 2500 or more"],
        ),
        (
            ["controller.estimator.use_force=false", "controller.estimator.use_slide_position=false"],
            ["estimator.use_force = false", "use_slide_position is false as well", "set one to true"],
        ),
        (
            ["rig.slide.mass_kg=0.05"],
            [
                "contact.damping_Ns_per_m = 21500",
                "here 1e+04 N s/m",
                "(2 sqrt(stiffness x mass) is 3.94e+03)",
                "4.7e-06",
            ],
        ),
        (
            ["rig.contact.stribeck_tail=-2.0", "rig.contact.coulomb_force_N=3.0"],
            ["contact.stribeck_tail = -2", "17.4 N and 3 N", "must stay above 0", "raise the tail"],
        ),
        (
            ["rig.effects.drive-speed-ripple={ratio = 0.9, second_cos = 0.3}"],
            ["drive-speed-ripple.ratio = 0.9", "must not stop", "lower the ratio below 0.769"],
        ),
        (["controller.block_s=0.025"], ["block_s = 0.025", "0.02"]),
        (["name=../../x"], ["name: '../../x': must be a plain file name", "runs/NAME.mcap", "leave out every /"]),
        (['name="a\\u001b[31m\\nb"'], [r"name: 'a\x1b[31m\nb': must be a plain file name"]),
        (['name=""'], ["name: '': must be a plain file name"]),
        *(
            (
                [f"rig.solver.step_s={step_s}"],
                [f"solver.step_s = {step_s}: must not make more than 1e+06", "to 1e-09 or more"],
            )
            for step_s in ("9e-10", "1e-12", "1e-300", "4.94066e-324")
        ),
        (["bus.endpoint=here"], ["bus.endpoint", "here"]),
        (["bus.endpoint=udp/127.0.0.1:7447"], ["bus.endpoint", "udp/127.0.0.1:7447", "tcp"]),
        (["bus.endpoint=tcp/127.0.0.1:99999"], ["bus.endpoint", "tcp/127.0.0.1:99999", "from 1 to 65535"]),
        (["bus.endpoint=tcp/127.0.0.1:0"], ["bus.endpoint", "from 1 to 65535"]),
        (["bus.endpoint=tls/127.0.0.1:1,tcp/127.0.0.1:2"], ["bus.endpoint", "must have the form of"]),
        (["bus.endpoint=tcp/127.0.0.1:\uff11\uff17"], ["bus.endpoint", "must have the form of"]),
        (
            ["bus.certificates=keys"],
            ["--set bus.certificates=keys: bus: certificates = 'keys'", "must begin with tls/"],
        ),
        (["rig.drive.profile=[[1.0, 0.1], [0.5, 0.1]]"], ["profile", "must increase"]),
        (
            ["rig.solver.block_s=0.01", "controller.block_s=0.01"],
            [
                "limits.frequency_max_Hz = 5000.0: must be below half the sample rate, 1000 Hz; lower it, or raise",
                "controller.samples_per_block and rig.solver.samples_per_block, both above 100",
            ],
        ),
    ],
)
def test_the_line_names_place_value_rule_and_remedy(settings: list[str], words: list[str]) -> None:
    with pytest.raises(Fault) as caught:
        load_scenario("paper-c45-c45", settings)
    assert caught.value.kind.code == "CONFIG"
    for word in words:
        assert word in caught.value.line
    assert caught.value.line.startswith(f"--set {settings[0]}")
    assert ".toml" not in caught.value.line
    assert "\n" not in caught.value.line


@pytest.mark.parametrize("name", ["nowhere", str(Path(__file__))], ids=["a name", "a file of another kind"])
def test_unknown_scenario_names_the_known_ones(name: str) -> None:
    with pytest.raises(Fault, match=rf"{re.escape(name)}: no such scenario; known: .*paper-c45-c45"):
        load_scenario(name, [])


def test_keys_of_older_files_are_reported_once_and_left_out(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bridge.config._REPORTED", set())
    older = {
        "onset": {"window_s": 0.02},
        "amplitude": {"gain": 0.1},
        "policy": {"too_late_from": 0.85, "gentle_ratio": 1.1},
    }
    for _ in range(2):
        assert validate(ControllerConfig, older, "older.toml") == ControllerConfig()
    reported = sorted(
        line.removeprefix("stickslip: ").partition(":")[0] for line in capsys.readouterr().err.splitlines()
    )
    assert reported == ["gain", "gentle_ratio", "onset", "too_late_from"]


def test_missing_and_broken_files(tmp_path: Path) -> None:
    with pytest.raises(Fault, match="no such file"):
        load_rig(str(tmp_path / "none.toml"), [])
    with pytest.raises(Fault, match="is a folder, must be a file"):
        read_toml(tmp_path)
    broken = tmp_path / "broken.toml"
    broken.write_text("a = = 1")
    with pytest.raises(Fault, match="not valid TOML"):
        load_rig(str(broken), [])


def test_an_error_in_a_rig_file_names_it(tmp_path: Path) -> None:
    rig = tmp_path / "mine.toml"
    rig.write_text("[effects.drive-backlash]\ngap = 1e-4\n")
    with pytest.raises(Fault, match=r"paper-c45-c45.toml with mine.toml: rig: effects.drive-backlash.gap: unknown key"):
        load_scenario("paper-c45-c45", [rig_setting(str(rig))])


def test_a_text_of_the_wrong_form_is_reported_with_an_example_of_the_right_form() -> None:
    with pytest.raises(
        Fault, match=r"bus.endpoint = 'foo': must have the form of 'tcp/127.0.0.1:7447'; change the value"
    ):
        load_scenario("paper-c45-c45", ["bus.endpoint=foo"])


def test_an_error_names_the_setting_or_the_file_that_causes_it(tmp_path: Path) -> None:
    with pytest.raises(Fault) as caught:
        load_scenario("paper-c45-c45", ["rig.slide.mass_kg=-1.0", "duration_s=soon", "seed=3"])
    first, second = sorted(caught.value.line.splitlines())
    assert first.startswith("--set duration_s=soon: duration_s = 'soon': must be a number")
    assert second.startswith("--set rig.slide.mass_kg=-1.0: rig.slide.mass_kg = -1.0: must be greater than 0")
    with pytest.raises(Fault, match=r"CONFIG: --set slide.mass_kg=0: slide.mass_kg = 0: must be greater than 0"):
        load_rig("paper-c45-c45", ["slide.mass_kg=0"])
    mine = tmp_path / "mine.toml"
    mine.write_text('duration_s = -1.0\n[rig]\nfile = "paper-c45-c45"\n')
    with pytest.raises(Fault, match=r"CONFIG: mine.toml with paper-c45-c45.toml: duration_s = -1.0: "):
        load_scenario(str(mine), ["seed=3"])


def test_overrides_leave_the_table_alone() -> None:
    table = {"a": {"b": 1}}
    assert with_overrides(table, ["a.b=2", "a.c=[1, 2]", "d=text"]) == {
        "a": {"b": 2, "c": [1, 2]},
        "d": "text",
    }
    assert table == {"a": {"b": 1}}
    with pytest.raises(Fault, match="expected key=value"):
        with_overrides(table, ["a.b"])
    with pytest.raises(Fault, match="is a value, not a table"):
        with_overrides(table, ["a.b.c=1"])


def test_frequencies_keep_away_from_resonance_and_forbidden_bands() -> None:
    config = validate(ControllerConfig, {"limits": {"forbidden_Hz": [[3000.0, 3500.0]]}}, "test")
    candidates = candidate_frequencies_Hz(config)
    assert min(candidates) >= 2.2 * 1144.0
    assert max(candidates) == 5000.0
    assert not any(3000.0 <= frequency <= 3500.0 for frequency in candidates)


@pytest.mark.parametrize(("peak_mps", "fits"), [(0.0111111, True), (0.0111114, False)])
def test_the_travel_of_a_changing_drive_is_counted(peak_mps: float, fits: bool) -> None:
    """A triangle of 8 s before a stop and one cut off at half its height: 4.5 s of its peak, 1.3 um beyond 50 mm.

    Summed a block at a time it was 2.8 um less.
    """
    profile = f"rig.drive.profile=[[0.0, 0.0], [4.0, {peak_mps}], [8.0, 0.0], [12.0, 0.0], [16.0, {peak_mps}]]"
    with contextlib.nullcontext() if fits else pytest.raises(Fault, match="ends at 50 mm"):
        load_scenario("paper-c45-c45", [profile, "duration_s=14.0"])


def test_the_controller_takes_the_limits_of_its_rig() -> None:
    rig = [
        "rig.guard.stroke_m={alarm=5e-8, abort=1e-7}",
        "rig.guard.velocity_mps={alarm=1e-3, abort=2e-3}",
        "rig.guard.forbidden_Hz=[[4500.0, 4700.0]]",
        "rig.piezo.amplitude_slew_m_per_s=2e-6",
        "rig.piezo.frequency_min_Hz=2650.0",
    ]
    limits = load_scenario("paper-c45-c45", [*rig, "controller.limits.amplitude_max_m=4e-8"]).controller.limits
    assert (limits.amplitude_max_m, limits.velocity_max_mps, limits.slew_m_per_s) == (4e-8, 1e-3, 2e-6)
    assert (limits.frequency_min_Hz, limits.frequency_max_Hz) == (2650.0, 5000.0)
    assert limits.forbidden_Hz == [(4500.0, 5000.0)]  # with the controller's own band, from 4600 Hz on


def test_every_rig_and_scenario_that_comes_along_is_valid() -> None:
    from cockpit.run.scenario_file import deploy_folder

    for path in deploy_folder().glob("rigs/*.toml"):
        assert load_rig(path.stem, []).name == path.stem
    for path in deploy_folder().glob("scenarios/*.toml"):
        assert load_scenario(path.stem, []).description


def test_a_slide_and_a_contact_without_a_stiffness_of_the_drive_are_refused() -> None:
    """The paper's spring was taken in silence; it stretches by 7.7 mm before a slide of 90 N breaks away."""
    contact = {"stiffness_N_per_m": 4.5e8, "damping_Ns_per_m": 2.7e5, "coulomb_force_N": 65.0, "static_force_N": 90.0}
    table = {"contact": contact, "slide": {"mass_kg": 40.0}}
    with pytest.raises(ValueError, match=r"drive\.stiffness_N_per_m: must be given.*7\.7 mm"):
        refuse_a_spring_of_another_rig(validate(RigConfig, table, "test"))
    refuse_a_spring_of_another_rig(validate(RigConfig, table | {"drive": {"stiffness_N_per_m": 1e7}}, "test"))


def test_pair_fills_in_missing_values() -> None:
    rig = validate(RigConfig, {"contact": {"pair": "C45-C45 @ 0.063", "static_force_N": 18.0}}, "test")
    assert rig.contact.static_force_N == 18.0
    assert rig.contact.stiffness_N_per_m == 77.52e6


@pytest.mark.parametrize("text", ["mass_kg = 1" + 5000 * "0", "a = " + 5000 * "["], ids=["digits", "depth"])
def test_a_file_too_deep_for_the_toml_reader_is_reported(tmp_path: Path, text: str) -> None:
    (tmp_path / "rig.toml").write_text(text)
    with pytest.raises(Fault, match=r"CONFIG: .*rig.toml: not valid TOML: "):
        read_toml(tmp_path / "rig.toml")


def test_a_pipe_is_not_read_as_a_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.toml")
    for load in (load_rig, load_scenario):
        with pytest.raises(Fault, match=r"CONFIG: .*pipe.toml: must be a file on a disk; give the path of a TOML file"):
            load(str(tmp_path / "pipe.toml"), [])


@pytest.mark.parametrize("key", ["x", "slide", "slide.mass_kg", "contact.pair", "effects.drive-backlash", "name"])
def test_a_value_that_is_too_much_for_a_line_is_shortened(tmp_path: Path, key: str) -> None:
    path = tmp_path / "deep.toml"
    for value in (f"{key}.{'a.' * 1500}a = 1\n", f'{key} = "{"a" * 100_000}"\n'):
        path.write_text(value)
        for settings in ([], [value.strip()], ["slide.mass_kg=1.5"]):
            with pytest.raises(Fault) as caught:
                load_rig(str(path), settings)
            assert caught.value.kind.code == "CONFIG"
            assert max(len(line) for line in caught.value.line.splitlines()) < 1000 + len("".join(settings))
