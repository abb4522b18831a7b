"""[effects.NAME] in a rig file: every effect is there, and a bad table is one clear line."""

from pathlib import Path

import numpy as np
import pytest

from bridge.faults import Fault
from cockpit.run.scenario import load_rig
from plant.effects.library import EFFECTS, checked
from plant.records import build
from plant.simulate import simulate

# Data written by others names them so: a name is never changed.
NAMES = [
    *("static-friction-ageing", "frictional-lag", "viscous-friction", "position-dependent-friction"),
    *("direction-dependent-friction", "normal-load-fluctuation", "friction-drift"),
    *("coulomb-level", "static-level", "stribeck-velocity"),
    *("drive-damping", "drive-stiffness", "drive-hardening", "drive-backlash", "drive-speed-ripple"),
    *("frame-compliance", "base-compliance"),
    *("piezo-roll-off", "piezo-resonance", "piezo-sag"),
    *("force-sensor-gain", "force-sensor-bias", "force-sensor-drift", "force-sensor-lag", "force-sensor-delay"),
    "accelerometer-gain",
]
CONTACT = '[contact]\npair = "C45-C45 @ 0.063"\n'


def loaded(tmp_path: Path, text: str):
    path = tmp_path / "rig.toml"
    path.write_text(CONTACT + text)
    return load_rig(str(path), [])


def test_every_name_is_there():
    assert len(NAMES) == 26
    assert list(EFFECTS) == NAMES


@pytest.mark.parametrize(
    ("name", "forms"),
    [
        ("static-friction-ageing", ["log", "power", "settling"]),
        ("viscous-friction", ["linear", "quadratic"]),
        ("direction-dependent-friction", ["backward", "both", "kinetic"]),
        ("normal-load-fluctuation", ["sine", "random"]),
        ("friction-drift", ["linear", "settling", "session"]),
        ("drive-hardening", ["cubic", "bilinear"]),
        ("drive-speed-ripple", ["screw", "time", "load"]),
        ("piezo-roll-off", ["first-order", "second-order"]),
        ("piezo-resonance", ["mount", "mode"]),
        ("piezo-sag", ["load", "heat"]),
        ("force-sensor-drift", ["linear", "settling"]),
        ("force-sensor-lag", ["first-order", "second-order", "fourth-order"]),
        ("accelerometer-gain", ["both", "mass", "base"]),
    ],
)
def test_effects_with_more_than_one_formula(name: str, forms: list[str]):
    assert list(EFFECTS[name].forms) == forms
    assert checked(name, {})["form"] == forms[0]


@pytest.mark.parametrize("name", NAMES)
def test_every_form_loads_with_its_defaults_and_at_its_bounds(name: str, tmp_path: Path):
    for form, formula in EFFECTS[name].forms.items():
        named = f'form = "{form}"\n' if form else ""
        rig = loaded(tmp_path, f"[effects.{name}]\n{named}")
        assert rig.effects[name] == {"form": form} | {row.name: row.default for row in formula.parameters}
        build(rig)
        for row in formula.parameters:
            assert row.low <= row.default <= row.high
            for value in (row.low, row.high):
                assert checked(name, {"form": form, row.name: value})[row.name] == value


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[effects.backlash]\n", ["effects.backlash: unknown effect", "known: ", "drive-backlash"]),
        (
            '[effects.static-friction-ageing]\nform = "cubic"\n',
            ["effects.static-friction-ageing.form = 'cubic'", "unknown form", '"log", "power", "settling"'],
        ),
        ("[effects.static-friction-ageing]\nform = 2.0\n", ["form = 2.0", "unknown form"]),
        ('[effects.drive-damping]\nform = ["viscous"]\n', ["form = ['viscous']", "unknown form"]),
        (f"[effects.drive-backlash]\ngap_m = {10**400}\n", ["gap_m = 1000", "must be from 0 to 0.1"]),
        ('[effects.drive-backlash]\nform = "wide"\n', ["form = 'wide'", "none; leave it out"]),
        ("[effects.drive-backlash]\ngap = 1e-4\n", ["effects.drive-backlash.gap: unknown key", "form, gap_m"]),
        ("[effects.drive-backlash]\ngap_m = -1e-4\n", ["gap_m = -0.0001", "must be from 0 to 0.1"]),
        ("[effects.drive-backlash]\ngap_m = 1\n", ["gap_m = 1", "must be from 0 to 0.1"]),
        ('[effects.drive-backlash]\ngap_m = "1e-4"\n', ["gap_m = '1e-4'", "must be a number"]),
        ("[effects.drive-backlash]\ngap_m = true\n", ["gap_m = True", "must be a number"]),
        ("[effects.drive-backlash]\ngap_m = nan\n", ["gap_m = nan", "must be from 0 to 0.1"]),
        ("[effects.drive-backlash]\ngap_m = [1e-4]\n", ["gap_m = [0.0001]", "must be a number"]),
        (
            "[effects]\ndrive-backlash = 1e-4\n",
            ["effects.drive-backlash = 0.0001", "must be a table", "[effects.drive-backlash]"],
        ),
        (
            '[effects.drive-hardening]\nform = "bilinear"\nknee_m = 0.0\n',
            ["effects.drive-hardening.knee_m = 0", "must be from 1e-06 to 1"],
        ),
        ("[effects.base-compliance]\ncompliance_m_per_N = 1e-3\n", ["frequency_Hz = 150", "0.0011 kg", "0.0078 kg"]),
        (
            '[effects.static-friction-ageing]\nform = "power"\nratio = 0.2\nexponent = 0.5\nrested_s = 100\n',
            ["static-friction-ageing.rested_s = 100", "ratio = 0.2", "2 times its static force", "must be below 1"],
        ),
        (
            "[effects.static-friction-ageing]\nratio = 0.1\nage_scale_s = 1e-3\nrested_s = 100\n",
            ["static-friction-ageing.rested_s = 100", "1.15 times"],
        ),
        (
            '[effects.static-friction-ageing]\nform = "settling"\nratio = 1.0\nsettling_s = 1.0\nrested_s = 100\n',
            ["static-friction-ageing.rested_s = 100", "1 times"],
        ),
        (
            "[effects.frame-compliance]\nratio = 10\nfrequency_Hz = 2000\n"
            "[solver]\nstep_s = 5e-5\n[piezo]\nfrequency_max_Hz = 1000\n",
            ["frame-compliance.frequency_Hz = 2000", "ratio = 10", "at most 960 Hz", "step_s = 5e-05", "lower one"],
        ),
        (
            "[effects.frame-compliance]\nratio = 10\nfrequency_Hz = 1000\n"
            '[effects.drive-damping]\nform = "relaxing"\ndamping_Ns_per_m = 1000\nrelaxation_s = 1e-4\n',
            ["frame-compliance.frequency_Hz = 1000", "at most 172 Hz", "step_s = 1e-05"],
        ),
        (
            "[effects.force-sensor-delay]\ndelay_s = 0.012\n[solver]\nsamples_per_block = 100\n",
            ["effects.force-sensor-delay.delay_s = 0.012", "254 samples", "0.00254"],
        ),
    ],
)
def test_a_bad_table_is_one_line_with_place_value_and_rule(text: str, words: list[str], tmp_path: Path):
    with pytest.raises(Fault) as caught:
        loaded(tmp_path, text)
    assert caught.value.kind.code == "CONFIG"
    for word in ["rig.toml", *words]:
        assert word in caught.value.line
    assert "\n" not in caught.value.line


def test_rigs_at_the_edge_of_stable_stepping_are_accepted(tmp_path: Path):
    assert loaded(tmp_path, "[slide]\nmass_kg = 0.0078\n").slide.mass_kg == 0.0078
    stiff = simulate(loaded(tmp_path, "[drive]\nstiffness_N_per_m = 1.48e9\n"), 0.3).drive_force_N
    # it swings about the Coulomb force, undamped, by v_d sqrt(k m) = 23.6 N at first
    assert np.std(stiff[len(stiff) // 2 :]) * np.sqrt(2.0) == pytest.approx(5e-4 * np.sqrt(1.48e9 * 1.5), rel=0.1)
    for text in (
        '[effects.static-friction-ageing]\nform = "power"\nratio = 0.99\nexponent = 0.5\nrested_s = 1.0\n',
        "[effects.frame-compliance]\nratio = 10\nfrequency_Hz = 2000\n",
        "[effects.frame-compliance]\nratio = 10\nfrequency_Hz = 950\n"
        "[solver]\nstep_s = 5e-5\n[piezo]\nfrequency_max_Hz = 1000\n",
        "[effects.frame-compliance]\nratio = 10\nfrequency_Hz = 170\n"
        '[effects.drive-damping]\nform = "relaxing"\ndamping_Ns_per_m = 1000\nrelaxation_s = 1e-4\n',
    ):
        result = simulate(loaded(tmp_path, text), 0.3)
        assert np.all(np.isfinite(result.drive_force_N))
        assert np.abs(result.drive_force_N).max() < 20.0


def test_effects_relative_to_a_level_see_the_level_whatever_the_order(tmp_path: Path):
    level = "[effects.static-level]\nratio = 0.5\n"
    ageing = "[effects.static-friction-ageing]\nratio = 0.1\n"
    for text in (level + ageing, ageing + level):
        params, _ = build(loaded(tmp_path, text))
        assert params[0].age_growth_N == pytest.approx(0.1 * 1.5 * 17.38)
