"""How large a step of each parameter is worth trying."""

import math
from typing import NamedTuple

from diagnosis.evidence.manifest import RigTable
from diagnosis.features.grid import BLOCK_S
from diagnosis.gap.prepare import Prepared


class Scale(NamedTuple):
    """How a parameter becomes a coordinate; `logarithmic` ones stay positive."""

    scale: float
    logarithmic: bool
    prior: float = 1.0


def longest_run_s(runs: list[Prepared]) -> float:
    """Duration of the longest run."""
    return max(len(run.commands.drive) for run in runs) * BLOCK_S


def scales(name: str, form: str, rig: RigTable, runs: list[Prepared], highest_Hz: float) -> dict[str, Scale]:
    """Free parameters of a form and their scales; what is left out stays at its default."""
    stiffness = rig.drive_stiffness_N_per_m or rig.contact_stiffness_N_per_m
    static_N = rig.static_force_N
    reach_m = static_N / stiffness
    critical = 2.0 * math.sqrt(stiffness * rig.mass_kg)
    slip_s = math.pi * math.sqrt(rig.mass_kg / stiffness)
    slip_mps = 0.3 * static_N / math.sqrt(stiffness * rig.mass_kg)
    if rig.drive == "force":  # no spring: speeds and times are those of the motion
        slip_mps = max(20.0 * rig.stribeck_velocity_mps, 0.05)
        critical = static_N / slip_mps
        slip_s = 0.05
    length_s = longest_run_s(runs)
    # wide, so that the rig's number of the same name, which holds a part of it, goes back to where it was
    level = {"ratio": Scale(0.1, False, 3.0)}
    rested = {"rested_s": Scale(0.3, True, 1.5)}
    wave = {"ratio": Scale(0.02, True, 1.5), "phase_rad": Scale(1.0, False, 3.0)}
    mode = {"resonance_Hz": Scale(1.0, True, 0.7), "damping_ratio": Scale(0.05, True, 0.7)}
    table: dict[tuple[str, str], dict[str, Scale]] = {
        ("static-friction-ageing", "log"): {"ratio": Scale(0.02, True, 1.5), "age_scale_s": Scale(0.1, True, 1.5)}
        | rested,
        ("static-friction-ageing", "power"): {"ratio": Scale(0.04, True, 1.5), "exponent": Scale(0.3, True, 0.5)}
        | rested,
        ("static-friction-ageing", "settling"): {
            "ratio": Scale(0.05, True, 1.5),
            "settling_s": Scale(0.5, True, 1.0),
        }
        | rested,
        ("frictional-lag", "time"): {"lag_s": Scale(0.06 * slip_s, True, 1.5)},
        ("frictional-lag", "dead-time"): {
            "delay_s": Scale(0.03 * slip_s, True, 1.5),
            "share": Scale(0.7, True, 0.5),
        },
        ("frictional-lag", "distance"): {
            "distance_m": Scale(0.005 * reach_m, True, 1.5),
            "share": Scale(0.5, True, 0.7),
        },
        ("viscous-friction", "linear"): {"damping_Ns_per_m": Scale(0.02 * critical, True, 1.5)},
        ("viscous-friction", "quadratic"): {"damping_Ns2_per_m2": Scale(0.02 * critical / slip_mps, True, 1.5)},
        ("position-dependent-friction", "wave"): wave | {"wavelength_m": Scale(1.0, True, 0.2)},
        ("normal-load-fluctuation", "sine"): wave | {"frequency_Hz": Scale(1.0, True, 0.2)},
        ("drive-speed-ripple", "screw"): wave | {"wavelength_m": Scale(1.0, True, 0.2)},
        ("drive-speed-ripple", "time"): wave | {"frequency_Hz": Scale(1.0, True, 0.2)},
        ("friction-drift", "linear"): {"rate_per_s": Scale(0.03 / length_s, False)},
        ("friction-drift", "settling"): {
            "ratio": Scale(0.04, False),
            "settling_s": Scale(0.3 * length_s, True, 0.7),
        },
        ("friction-drift", "session"): {
            "ratio": Scale(0.04, False),
            "settling_s": Scale(length_s, True, 1.0),
        },
        ("stribeck-velocity", ""): {"ratio": Scale(0.5, False)},
        ("drive-damping", "viscous"): {"damping_Ns_per_m": Scale(0.03 * critical, True, 1.5)},
        ("drive-damping", "relaxing"): {
            "damping_Ns_per_m": Scale(0.1 * critical, True, 1.5),
            "relaxation_s": Scale(0.1 * slip_s, True, 1.0),
        },
        ("drive-hardening", "cubic"): {"ratio": Scale(0.1 * (1e-3 / reach_m) ** 2, False)},
        ("drive-hardening", "bilinear"): {"ratio": Scale(0.2, False), "knee_m": Scale(0.75 * reach_m, True, 0.3)},
        ("drive-backlash", ""): {"gap_m": Scale(0.05 * reach_m, True, 1.5)},
        ("frame-compliance", ""): {
            "ratio": Scale(0.05, True, 1.5),
            "frequency_Hz": Scale(80.0, True, 0.5),
            "damping_ratio": Scale(0.05, True, 0.7),
        },
        ("base-compliance", ""): {
            "compliance_m_per_N": Scale(1e-3 / stiffness, True, 2.0),
            "frequency_Hz": Scale(150.0, True, 0.5),
            "damping_ratio": Scale(0.05, True, 0.7),
        },
        ("piezo-roll-off", "first-order"): {"corner_Hz": Scale(2.0 * max(highest_Hz, 1.0), True, 1.5)},
        ("piezo-roll-off", "second-order"): {"corner_Hz": Scale(3.0 * max(highest_Hz, 1.0), True, 1.5)},
        ("piezo-resonance", "mount"): mode,
        ("piezo-resonance", "mode"): {"ratio": Scale(0.3, True, 1.5)} | mode,
        ("piezo-sag", "load"): {"ratio": Scale(0.2, False)},
        ("piezo-sag", "heat"): {"ratio": Scale(0.2, False), "settling_s": Scale(0.2 * length_s, True, 0.7)},
        ("force-sensor-gain", ""): {"ratio": Scale(0.05, False)},
        ("force-sensor-bias", ""): {"bias_N": Scale(0.03 * static_N, False)},
        ("force-sensor-drift", "linear"): {"rate_N_per_s": Scale(0.03 * static_N / length_s, False)},
        ("force-sensor-drift", "settling"): {
            "drift_N": Scale(0.03 * static_N, False),
            "settling_s": Scale(0.3 * length_s, True, 0.7),
        },
        ("force-sensor-lag", "first-order"): {"lag_s": Scale(0.02 * slip_s, True, 1.5)},
        ("force-sensor-lag", "second-order"): {"lag_s": Scale(0.01 * slip_s, True, 1.5)},
        ("force-sensor-lag", "fourth-order"): {"lag_s": Scale(0.005 * slip_s, True, 1.5)},
        ("force-sensor-delay", ""): {"delay_s": Scale(0.02 * slip_s, True, 1.5)},
        ("accelerometer-gain", "both"): {"ratio": Scale(0.05, False)},
        ("accelerometer-gain", "mass"): {"ratio": Scale(0.05, False)},
        ("accelerometer-gain", "base"): {"ratio": Scale(0.05, False)},
    }
    return table.get((name, form), level)
