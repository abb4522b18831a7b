"""Effects of these rigs. Sizes are relative to the rig's numbers, so that one formula suits a turntable and a gantry."""

import numpy as np
from scipy.signal import lfilter

from tests.blind.generator.effect import Formula, Numbers, Signals, either, noise_of, noise_seed

Random = np.random.Generator
FORCE, PLACE = "drive_force_N", "mass_position_m"


def _uneven(r: Random, low: float, high: float) -> float:
    return float(np.exp(r.uniform(np.log(low), np.log(high))))


def _turn(r: Random) -> float:
    return float(r.uniform(0.0, 2.0 * np.pi))


def _set(numbers):
    """A hook that sets numbers of the rig; `numbers` gets (rig, strength, numbers of the effect)."""

    def rig(p: np.ndarray, s: float, n: Numbers) -> None:
        for name, value in numbers(p, s, n).items():
            p[name] = value
        p["static"] = np.maximum(p["static"], 1.005 * p["coulomb"])

    return rig


def _factor(field: str):
    return _set(lambda p, s, n: {field: p[field] * np.exp(s * n["log"])})


def _share(field: str, power: int = 0):
    """A share of the Coulomb force at a speed that the mass reaches, to a power; with power 0 the share alone."""

    def numbers(p: np.ndarray, s: float, n: Numbers) -> dict[str, np.ndarray]:
        swing = (p["static"] - p["coulomb"]) / np.sqrt(np.maximum(p["stiffness"], 1e-9) * p["mass"])
        fast = np.where(p["stiffness"] > 0.0, swing, 10.0 * p["stribeck"])  # in a slip, or by the motor
        return {field: p[field] + s * n["share"] * (p["coulomb"] / fast**power if power else 1.0)}

    return _set(numbers)


def _lag_s(p: np.ndarray) -> np.ndarray:
    return np.where(p["stiffness"] > 0, np.sqrt(p["mass"] / np.maximum(p["stiffness"], 1e-9)), 0.03)


def _stretch(p: np.ndarray) -> np.ndarray:
    return p["coulomb"] / p["stiffness"]


def _waves(x: np.ndarray, level: np.ndarray, s: float, n: Numbers) -> None:
    level += s * n["share"] * np.sin(2.0 * np.pi * x / n["pitch"] + n["phase_rad"])
    level += 0.4 * s * n["share"] * np.sin(4.0 * np.pi * x / n["pitch"] + n["phase_2_rad"])


def _load(tracks, s: float, n: Numbers) -> None:
    angle = 2.0 * np.pi * n["frequency_Hz"] * tracks.t_s + n["phase_rad"] + 1.7 * tracks.number
    tracks.load *= 1.0 + s * n["share"] * (np.sin(angle) + 0.3 * np.sin(2.0 * angle))


def _drift(tracks, s: float, n: Numbers) -> None:
    tracks.load *= 1.0 + s * n["share"] * (1.0 - np.exp(-(tracks.t_s + 12.0 * tracks.number) / n["time_s"]))


def _ripple(tracks, s: float, n: Numbers) -> None:
    wave = np.sin(2.0 * np.pi * tracks.command / n["pitch"] + n["phase_rad"])
    extra = s * n["share"] * n["pitch"] / (2.0 * np.pi) * wave
    tracks.command += extra - extra[0]
    tracks.speed += np.gradient(extra, tracks.t_s)


def _payload(tracks, s: float, n: Numbers) -> None:
    """The slide is loaded between two runs: mass and friction grow together."""
    factor = 1.0 + s * n["share"] * (noise_of(n, tracks.number).random() if tracks.number else 0.0)
    tracks.mass_factor *= factor
    tracks.load *= factor


def _gain(signals: Signals, s: float, n: Numbers) -> None:
    signals[FORCE] *= 1.0 + s * n["share"]


def _bias(signals: Signals, s: float, n: Numbers) -> None:
    signals[FORCE] += s * n["share"] * n["force"]


def _creep(signals: Signals, s: float, n: Numbers) -> None:
    signals[FORCE] += s * n["share"] * n["force"] * (signals["t_s"] / 10.0) ** n["exponent"]


def _low_pass(signals: Signals, s: float, n: Numbers) -> None:
    keep = np.exp(-(signals["t_s"][1] - signals["t_s"][0]) / (s * n["lag_s"]))
    first = signals[FORCE][0]
    signals[FORCE] = lfilter([1.0 - keep], [1.0, -keep], signals[FORCE] - first) + first


def _late(signals: Signals, s: float, n: Numbers) -> None:
    signals[FORCE] = np.interp(signals["t_s"] - s * n["lag_s"], signals["t_s"], signals[FORCE])


def _hysteresis(signals: Signals, s: float, n: Numbers) -> None:
    """A load cell whose glue gives: it shows less on the way up than on the way down."""
    force, width = signals[FORCE], n["force"] * s * n["share"]
    steps = np.diff(force, prepend=force[0])
    state = 0.0
    shown = np.empty_like(force)
    for i, step in enumerate(steps):
        state = min(max(state + step, -width), width)
        shown[i] = force[i] - 0.5 * state
    signals[FORCE] = shown


def _eccentric(signals: Signals, s: float, n: Numbers) -> None:
    """The encoder's disc is off its axis, or the scale is stuck on askew: a long wave in the position."""
    x = signals[PLACE]
    signals[PLACE] = x + s * n["size"] * (
        np.sin(2.0 * np.pi * x / n["pitch"] + n["phase_rad"]) - np.sin(n["phase_rad"])
    )


def _named(effect: str, draw, **hooks) -> Formula:
    return Formula(effect, "relative", draw, **hooks)


def library(travel: float, force: float, drive: str) -> tuple[Formula, ...]:
    """Effects of the library on a rig of this travel, Coulomb force and drive."""

    def wave(r: Random, low: float, high: float) -> dict[str, float]:
        turns = {"phase_rad": _turn(r), "phase_2_rad": _turn(r)}
        return {"share": r.uniform(low, high), "pitch": _uneven(r, 0.03, 0.3) * travel} | turns

    def level(r: Random, down: float, up: float) -> dict[str, float]:
        return {"log": float(r.choice((-down, up))) * r.uniform(0.8, 1.2)}

    def sized(r: Random, low: float, high: float) -> dict[str, float]:
        return {"share": either(r) * r.uniform(low, high), "force": force, "exponent": r.uniform(0.6, 1.4)}

    everywhere = (
        _named("viscous-friction", lambda r: {"share": r.uniform(0.3, 0.5)}, rig=_share("quadratic", 2)),
        _named("position-dependent-friction", lambda r: wave(r, 0.1, 0.2), surface=_waves),
        _named("direction-dependent-friction", lambda r: sized(r, 0.06, 0.12), rig=_share("direction")),
        _named("normal-load-fluctuation", lambda r: wave(r, 0.08, 0.15) | {"frequency_Hz": _uneven(r, 0.5, 6.0)}, run=_load),
        _named("friction-drift", lambda r: sized(r, 0.15, 0.25) | {"time_s": r.uniform(8.0, 20.0)}, run=_drift),
        _named("coulomb-level", lambda r: level(r, 0.2, 0.12), rig=_factor("coulomb")),
        _named("static-level", lambda r: level(r, 0.1, 0.2), rig=_factor("static")),
        _named("stribeck-velocity", lambda r: level(r, 1.0, 1.0), rig=_factor("stribeck")),
        _named("frictional-lag", lambda r: {"share": r.uniform(0.3, 0.6)},
               rig=_set(lambda p, s, n: {"lag_s": s * n["share"] * _lag_s(p)})),
        _named("force-sensor-gain", lambda r: sized(r, 0.12, 0.2), sense=_gain),
        _named("force-sensor-bias", lambda r: sized(r, 0.08, 0.15), sense=_bias),
        _named("force-sensor-drift", lambda r: sized(r, 0.1, 0.2), sense=_creep),
    )  # fmt: skip
    pulled = (
        _named("static-friction-ageing", lambda r: {"growth": r.uniform(0.03, 0.05), "scale_s": r.uniform(0.02, 0.2)},
               rig=_set(lambda _, s, n: {"ageing": s * n["growth"], "ageing_scale_s": n["scale_s"]})),
        _named("force-sensor-lag", lambda r: {"lag_s": r.uniform(4e-3, 8e-3)}, sense=_low_pass),
        _named("force-sensor-delay", lambda r: {"lag_s": r.uniform(4e-3, 8e-3)}, sense=_late),
        _named("drive-damping", lambda r: {"share": r.uniform(0.25, 0.4)}, rig=_share("damping", 1)),
        _named("drive-stiffness", lambda r: level(r, 0.2, 0.2), rig=_factor("stiffness")),
        _named("drive-hardening", lambda r: {"share": r.uniform(0.15, 0.3), "knee": r.uniform(0.5, 0.8)},
               rig=_set(lambda p, s, n: {"hardening": s * n["share"], "knee": n["knee"] * _stretch(p)})),
        _named("drive-backlash", lambda r: {"share": r.uniform(0.15, 0.3)},
               rig=_set(lambda p, s, n: {"backlash": s * n["share"] * _stretch(p)})),
        _named("drive-speed-ripple", lambda r: wave(r, 0.25, 0.4), run=_ripple),
        _named("frame-compliance", lambda r: {"share": r.uniform(0.15, 0.3), "time_s": r.uniform(2e-3, 1e-2)},
               rig=_set(lambda p, s, n: {"frame_stiffness": p["stiffness"] / (s * n["share"]),
                                        "frame_damping": p["stiffness"] / (s * n["share"]) * n["time_s"]})),
    )  # fmt: skip
    return everywhere if drive == "force" else (*everywhere, *pulled)


def outside(travel: float, force: float) -> tuple[Formula, ...]:
    """Effects outside the library."""

    return (
        _named("cable-chain", lambda r: {"share": either(r) * r.uniform(0.3, 0.5), "travel": travel},
               rig=_set(lambda p, s, n: {"cable": s * n["share"] * p["coulomb"] / n["travel"]})),
        _named("cogging", lambda r: {"share": r.uniform(0.08, 0.15), "pitch": _uneven(r, 0.03, 0.2) * travel},
               rig=_set(lambda p, s, n: {"cogging": s * n["share"] * p["coulomb"], "cogging_per_m": 2.0 * np.pi / n["pitch"]})),
        _named("inner-swing", lambda r: {"share": r.uniform(0.3, 0.5), "frequency_Hz": r.uniform(3.0, 12.0)},
               rig=_set(lambda _, s, n: {"inner_share": s * n["share"], "inner_radps": 2.0 * np.pi * n["frequency_Hz"]})),
        _named("payload", lambda r: {"share": r.uniform(0.3, 0.6), "seed": noise_seed(r)}, run=_payload),
        _named("load-cell-hysteresis", lambda r: {"share": r.uniform(0.1, 0.2), "force": force}, sense=_hysteresis),
        _named("eccentric-encoder", lambda r: {
            "size": r.uniform(0.004, 0.01) * travel, "pitch": r.uniform(0.2, 0.6) * travel, "phase_rad": _turn(r)},
            sense=_eccentric),
    )  # fmt: skip
