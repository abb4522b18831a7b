"""What a real rig does and the nominal one does not: one row an effect, off unless a rig file switches it on.

A name means a mechanism; a form is one formula for it. `[effects.NAME]` in a rig file holds `form` (the first one if left
out) and the form's parameters. Off is bit-identical to the nominal rig: effects that only change a number of the rig are
folded into it by `plant.records.build`, the others run in a kernel of their own (`plant.core.advance_disturbed`).

Literature of the formulas: ageing log: Dieterich 1972, rate and state; power: Rabinowicz 1958; settling: Kato, Sato &
Matsubayashi 1974, with their exponent 1; lag over time and as a dead time:
Hess & Soom 1990; over a distance: Rabinowicz 1958, of a share: Ruina 1983, two state variables; log and power ageing,
hardening and ripple as in Armstrong-Helouvry, Dupont & Canudas de Wit 1994; a mode that takes part by a share: Ewins, Modal
Testing, 2000.
"""

import math
from typing import Any, Final, Literal, NamedTuple


class Parameter(NamedTuple):
    """A number of a form; `low` and `high` are what a rig file may say, ends included."""

    name: str  # carries its unit; `ratio` is relative to the nominal value
    low: float
    high: float
    default: float


class Form(NamedTuple):
    """One formula of an effect."""

    formula: str
    parameters: tuple[Parameter, ...]


class Effect(NamedTuple):
    """A row of the library."""

    acts_on: Literal["friction", "drive", "structure", "piezo", "sensor"]
    forms: dict[str, Form]
    drives: tuple[str, ...] = ("spring", "force")  # kinds of drive that can have it


LONGEST_DELAY = 254  # samples; 12.7 ms at 20 kHz
LAG_ORDERS: Final = {"first-order": 1, "second-order": 2, "fourth-order": 4}  # low-passes of a slow force sensor
LONGEST_LAG_S = 0.025  # of friction behind the velocity, as a dead time

_TAU = 2.0 * math.pi
_SPRING = ("spring",)
# the age at which the static friction is F_s: it was measured after some rest
_RESTED = Parameter("rested_s", 0.0, 1e4, 0.0)
# a wave is w(a) = sin a + second_sin sin 2a + second_cos cos 2a, a with the phase: few real ones are pure
_SHAPE = (
    Parameter("phase_rad", -_TAU, _TAU, 0.0),
    Parameter("second_sin", -1.0, 1.0, 0.0),
    Parameter("second_cos", -1.0, 1.0, 0.0),
)


def _ratio(default: float, low: float = -0.9, high: float = 10.0) -> Parameter:
    return Parameter("ratio", low, high, default)


def _one(formula: str, *parameters: Parameter) -> dict[str, Form]:
    return {"": Form(formula, parameters)}


EFFECTS: Final[dict[str, Effect]] = {
    "static-friction-ageing": Effect(
        "friction",
        {
            "log": Form(
                "F_s grows by ratio F_s ln(1 + age / age_scale_s), less what that is at an age of rested_s",
                (_ratio(0.02, 0.0, 1.0), Parameter("age_scale_s", 1e-4, 100.0, 0.1), _RESTED),
            ),
            "power": Form(
                "F_s grows by ratio F_s (age / 1 s)^exponent, less what that is at an age of rested_s",
                (_ratio(0.04, 0.0, 1.0), Parameter("exponent", 0.05, 1.0, 0.3), _RESTED),
            ),
            "settling": Form(
                "F_s grows by ratio F_s (1 - exp(-age / settling_s)), less what that is at an age of rested_s",
                (_ratio(0.05, 0.0, 1.0), Parameter("settling_s", 1e-4, 1e4, 0.5), _RESTED),
            ),
        },
    ),
    "frictional-lag": Effect(
        "friction",
        {
            "time": Form(
                "the Stribeck curve sees v_r through a first-order lag", (Parameter("lag_s", 0.0, 1.0, 2e-3),)
            ),
            "dead-time": Form(
                "a share of it sees |v_r| as it was delay_s ago",
                (Parameter("delay_s", 0.0, LONGEST_LAG_S, 2e-3), Parameter("share", 0.0, 1.0, 1.0)),
            ),
            "distance": Form(
                "a share of it sees |v_r| through a lag over the path slid, and rests while the contact does",
                (Parameter("distance_m", 0.0, 1.0, 3e-6), Parameter("share", 0.0, 1.0, 1.0)),
            ),
        },
    ),
    "viscous-friction": Effect(
        "friction",
        {
            "linear": Form("F_f grows by damping v_r", (Parameter("damping_Ns_per_m", 0.0, 1e5, 5.0),)),
            "quadratic": Form("F_f grows by damping v_r |v_r|", (Parameter("damping_Ns2_per_m2", 0.0, 1e7, 200.0),)),
        },
    ),
    "position-dependent-friction": Effect(
        "friction",
        {
            "wave": Form(
                "friction times 1 + ratio w(2 pi x / wavelength_m + phase)",
                (_ratio(0.03, 0.0, 0.9), Parameter("wavelength_m", 1e-5, 1.0, 4e-3), *_SHAPE),
            ),
            "two-waves": Form(
                "as wave without its harmonic, and sin(2 pi x / other_wavelength_m + other_phase) beside it, of other_share",
                (
                    *(_ratio(0.03, 0.0, 0.9), Parameter("wavelength_m", 1e-5, 1.0, 4e-3), _SHAPE[0]),
                    *(Parameter("other_share", 0.0, 3.0, 0.5), Parameter("other_wavelength_m", 1e-5, 1.0, 1e-3)),
                    Parameter("other_phase_rad", -_TAU, _TAU, 0.0),
                ),
            ),
            "bumps": Form(
                "friction times 1 + ratio exp(-(d / width)^2 / 2), d of wavelength_m from the nearest of the places where "
                "2 pi x / wavelength_m + phase is a whole turn",
                (
                    *(_ratio(0.05, -0.9, 0.9), Parameter("wavelength_m", 1e-5, 1.0, 4e-3), _SHAPE[0]),
                    Parameter("width", 0.01, 0.5, 0.1),
                ),
            ),
            "random": Form(
                "friction times 1 + ratio n(x), n smooth noise of unit rms, a new value every wavelength_m / 2",
                (_ratio(0.03, 0.0, 0.9), Parameter("wavelength_m", 1e-5, 1.0, 4e-3), Parameter("seed", 0, 1e6, 0)),
            ),
        },
    ),
    "direction-dependent-friction": Effect(
        "friction",
        {
            "backward": Form("friction times 1 + ratio where v_r < 0", (_ratio(0.1),)),
            "both": Form(
                "friction times 1 + ratio / 2 where v_r > 0, 1 - ratio / 2 where v_r < 0", (_ratio(0.1, -0.9, 0.9),)
            ),
            "kinetic": Form("F_c alone times 1 + ratio where v_r < 0, F_s kept", (_ratio(0.1, -0.9, 0.9),)),
        },
    ),
    "normal-load-fluctuation": Effect(
        "friction",
        {
            "sine": Form(
                "friction times 1 + ratio w(2 pi frequency_Hz t + phase)",
                (_ratio(0.03, 0.0, 0.9), Parameter("frequency_Hz", 1e-3, 1e3, 3.0), *_SHAPE),
            ),
            "random": Form(
                "friction times 1 + ratio n(t), n smooth noise of unit rms, a new value every 1 / (2 frequency_Hz)",
                (_ratio(0.03, 0.0, 0.9), Parameter("frequency_Hz", 1e-3, 1e3, 3.0), Parameter("seed", 0, 1e6, 0)),
            ),
        },
    ),
    "friction-drift": Effect(
        "friction",
        {
            "linear": Form("friction times 1 + rate_per_s t", (Parameter("rate_per_s", -0.1, 0.1, 2e-3),)),
            "settling": Form(
                "friction times 1 + ratio (1 - exp(-t / settling_s))",
                (_ratio(0.05, -0.9, 0.9), Parameter("settling_s", 0.1, 1e4, 5.0)),
            ),
            "session": Form(
                "as settling, on from earlier runs: t + before_s for t",
                (
                    _ratio(0.05, -0.9, 0.9),
                    Parameter("settling_s", 0.1, 1e4, 15.0),
                    Parameter("before_s", 0.0, 1e6, 0.0),
                ),
            ),
        },
    ),
    "coulomb-level": Effect("friction", _one("F_c times 1 + ratio", _ratio(0.1))),
    "static-level": Effect("friction", _one("F_s times 1 + ratio", _ratio(0.1))),
    "stribeck-velocity": Effect("friction", _one("v_s times 1 + ratio", _ratio(0.5))),
    "drive-damping": Effect(
        "drive",
        {
            "viscous": Form("h_d grows by damping", (Parameter("damping_Ns_per_m", 0.0, 1e6, 10.0),)),
            "relaxing": Form(
                "a damper beside the spring that hangs on a spring of its own, damping / relaxation_s (Maxwell)",
                (Parameter("damping_Ns_per_m", 0.0, 1e6, 10.0), Parameter("relaxation_s", 1e-4, 100.0, 4e-3)),
            ),
        },
        _SPRING,
    ),
    "drive-stiffness": Effect("drive", _one("k_d times 1 + ratio", _ratio(0.1)), _SPRING),
    "drive-hardening": Effect(
        "drive",
        {
            "cubic": Form(
                "k_d e (1 + ratio (e / 1 mm)^2); a softening one yields at its largest force",
                (_ratio(0.05, -0.2, 10.0),),
            ),
            "bilinear": Form(
                "k_d e, beyond |e| = knee_m with the stiffness k_d (1 + ratio)",
                (_ratio(0.2), Parameter("knee_m", 1e-6, 1.0, 1e-3)),
            ),
        },
        _SPRING,
    ),
    "drive-backlash": Effect(
        "drive", _one("no force over a gap of gap_m around e = 0", Parameter("gap_m", 0.0, 0.1, 1e-4)), _SPRING
    ),
    "drive-speed-ripple": Effect(
        "drive",
        {
            "screw": Form(
                "drive velocity times 1 + ratio w(2 pi s_e / wavelength_m + phase): the motor turns evenly",
                (_ratio(0.05, 0.0, 0.95), Parameter("wavelength_m", 1e-5, 1.0, 1e-3), *_SHAPE),
            ),
            "time": Form(
                "drive velocity times 1 + ratio w(2 pi frequency_Hz t + phase)",
                (_ratio(0.05, 0.0, 0.95), Parameter("frequency_Hz", 1e-3, 1e3, 1.0), *_SHAPE),
            ),
        },
        _SPRING,
    ),
    "frame-compliance": Effect(
        "structure",
        _one(
            "what holds the drive yields: stiffness k_d / ratio, its own frequency and damping ratio",
            _ratio(0.1, 0.0, 10.0),
            Parameter("frequency_Hz", 5.0, 2000.0, 80.0),
            Parameter("damping_ratio", 0.0, 2.0, 0.05),
        ),
        _SPRING,
    ),
    "base-compliance": Effect(
        "structure",
        _one(
            "what holds the base yields under the friction force, with its own frequency and damping ratio",
            Parameter("compliance_m_per_N", 0.0, 1e-3, 1e-6),
            Parameter("frequency_Hz", 5.0, 2000.0, 150.0),
            Parameter("damping_ratio", 0.0, 2.0, 0.05),
        ),
    ),
    "piezo-roll-off": Effect(
        "piezo",
        {
            "first-order": Form(
                "amplitude / sqrt(1 + (f / corner_Hz)^2)", (Parameter("corner_Hz", 50.0, 1e7, 3000.0),)
            ),
            "second-order": Form("amplitude / (1 + (f / corner_Hz)^2)", (Parameter("corner_Hz", 50.0, 1e7, 5000.0),)),
        },
    ),
    "piezo-resonance": Effect(
        "piezo",
        {
            "mount": Form(
                "amplitude times the gain of a mass on a spring, instead of what the rig's own mount does",
                (Parameter("resonance_Hz", 100.0, 1e6, 8000.0), Parameter("damping_ratio", 0.005, 2.0, 0.05)),
            ),
            "mode": Form(
                "amplitude times |1 + ratio r^2 / (1 - r^2 + 2 i damping_ratio r)|, r = f / resonance_Hz, likewise instead",
                (
                    _ratio(0.3, 0.0, 10.0),
                    Parameter("resonance_Hz", 100.0, 1e6, 8000.0),
                    Parameter("damping_ratio", 0.005, 2.0, 0.05),
                ),
            ),
        },
    ),
    "piezo-sag": Effect(
        "piezo",
        {
            "load": Form("amplitude times 1 - ratio |F_d| / F_s", (_ratio(0.2, -0.9, 0.9),)),
            "heat": Form(
                "amplitude times 1 - ratio (1 - exp(-t / settling_s)), t since the piezo was switched on",
                (_ratio(0.2, -0.9, 0.9), Parameter("settling_s", 0.05, 1e4, 3.0)),
            ),
        },
    ),
    "force-sensor-gain": Effect("sensor", _one("reading times 1 + ratio", _ratio(0.05))),
    "force-sensor-bias": Effect("sensor", _one("reading plus bias_N", Parameter("bias_N", -1e5, 1e5, 0.5))),
    "force-sensor-drift": Effect(
        "sensor",
        {
            "linear": Form("reading plus rate t", (Parameter("rate_N_per_s", -1e3, 1e3, 0.05),)),
            "settling": Form(
                "reading plus drift_N (1 - exp(-t / settling_s))",
                (Parameter("drift_N", -1e5, 1e5, 0.5), Parameter("settling_s", 0.1, 1e4, 5.0)),
            ),
        },
    ),
    "force-sensor-lag": Effect(
        "sensor",
        {
            "first-order": Form("reading through a first-order low-pass", (Parameter("lag_s", 0.0, 1.0, 1e-3),)),
            "second-order": Form("reading through two equal low-passes", (Parameter("lag_s", 0.0, 1.0, 5e-4),)),
            "fourth-order": Form("reading through four equal low-passes", (Parameter("lag_s", 0.0, 1.0, 2.5e-4),)),
        },
    ),
    "force-sensor-delay": Effect("sensor", _one("reading comes delay_s later", Parameter("delay_s", 0.0, 0.012, 1e-3))),
    "accelerometer-gain": Effect(
        "sensor",
        {
            "both": Form("both accelerations times 1 + ratio", (_ratio(0.05),)),
            "mass": Form("acceleration of the mass times 1 + ratio", (_ratio(0.05),)),
            "base": Form("acceleration of the base times 1 + ratio", (_ratio(0.05),)),
        },
    ),
}


def first_form(name: str) -> str:
    """The form that is meant when a rig file names none."""
    return next(iter(EFFECTS[name].forms))


def checked(name: str, table: Any) -> dict[str, float | str]:
    """One `[effects.NAME]` table with its form and every parameter filled in. Raises ValueError: key, value, rule, remedy."""
    if name not in EFFECTS:
        raise ValueError(f"effects.{name}: unknown effect; known: {', '.join(EFFECTS)}")
    if not isinstance(table, dict):
        raise ValueError(f"effects.{name} = {table!r}: must be a table; write [effects.{name}] and its keys below it")
    forms = EFFECTS[name].forms
    form = table.get("form", first_form(name))
    if not isinstance(form, str) or form not in forms:
        known = ", ".join(f'"{known}"' for known in forms if known) or "none; leave it out"
        raise ValueError(f"effects.{name}.form = {form!r}: unknown form; known: {known}")
    rows = {row.name: row for row in forms[form].parameters}
    filled: dict[str, float | str] = {"form": form}
    for key, value in table.items():
        if key != "form" and key not in rows:
            raise ValueError(f"effects.{name}.{key}: unknown key; known here: form, {', '.join(rows)}")
        if key != "form" and (isinstance(value, bool) or not isinstance(value, int | float)):
            raise ValueError(f"effects.{name}.{key} = {value!r}: must be a number")
    for row in rows.values():
        value = table.get(row.name, row.default)
        if not row.low <= value <= row.high:
            raise ValueError(f"effects.{name}.{row.name} = {value}: must be from {row.low:g} to {row.high:g}")
        filled[row.name] = float(value)
    return filled
