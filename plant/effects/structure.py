"""Compliant supports of drive and base: each a mass on a spring."""

from typing import Any, Final

from bridge.kernel import kernel
from plant.effects.row import Effect, Parameter, one_form, ratio


@kernel
def frame_gain_mps(
    dt: float,
    omega: float,
    loss: float,
    frame_m_per_N: float,
    h_d: float,
    force_N: float,
    frame_m: float,
    frame_mps: float,
) -> float:
    """Change of the frame's velocity over a step under the drive's force: m q'' = F_d - q / c - damping, m = 1 / (c omega^2).

    Args:
        dt, omega: step [s]; the frame's natural frequency [rad/s].
        loss: damping ratio times omega dt.
        frame_m_per_N: compliance c.
        h_d: damping of the drive that acts on the frame now [N s/m]. It is taken implicitly, as a light frame on a strong
            damper would blow up.
        force_N, frame_m, frame_mps: the drive's force, displacement and velocity of the frame.

    """
    per_m = dt * omega * omega
    gain_mps = per_m * (force_N * frame_m_per_N - frame_m) - 2.0 * loss * frame_mps
    return gain_mps / (1.0 + loss + per_m * frame_m_per_N * h_d)


@kernel
def base_give(dt: float, omega: float, loss: float, base_m_per_N: float) -> float:
    """Mean velocity of the base over a step per newton of friction [m/(N s)], for a base of mass 1 / (c omega^2)."""
    return 0.5 * dt * base_m_per_N * omega * omega / (1.0 + loss)


@kernel
def base_free_mps(dt: float, omega: float, loss: float, base_m: float, base_mps: float) -> float:
    """Mean velocity of the base over a step in which no friction acts on it."""
    spring_mps2 = omega * omega * (base_m + 0.5 * dt * base_mps)
    return (base_mps - 0.5 * dt * spring_mps2) / (1.0 + loss)


def _set_frame(p: Any, _form: str, value: dict[str, float]) -> None:
    p.frame_m_per_N = value["ratio"] / p.k_d
    p.frame_Hz, p.frame_damping_ratio = value["frequency_Hz"], value["damping_ratio"]


def _set_base(p: Any, _form: str, value: dict[str, float]) -> None:
    p.base_m_per_N = value["compliance_m_per_N"]
    p.base_Hz, p.base_damping_ratio = value["frequency_Hz"], value["damping_ratio"]


_DAMPING_RATIO = Parameter("damping_ratio", 0.0, 2.0, 0.05)
STRUCTURE: Final = {
    "frame-compliance": Effect(
        "structure",
        one_form(
            "the drive's support yields: stiffness k_d / ratio, with a frequency and a damping ratio",
            ratio(0.1, 0.0, 10.0),
            Parameter("frequency_Hz", 5.0, 2000.0, 80.0),
            _DAMPING_RATIO,
        ),
        _set_frame,
        numbers=("frame_m_per_N", "frame_Hz", "frame_damping_ratio"),
        switches=("frame_m_per_N",),
        memory=(("frame_m", "f8"), ("frame_mps", "f8")),
        drives=("spring",),
    ),
    "base-compliance": Effect(
        "structure",
        one_form(
            "the base's support yields under the friction force, with a frequency and a damping ratio",
            Parameter("compliance_m_per_N", 0.0, 1e-3, 1e-6),
            Parameter("frequency_Hz", 5.0, 2000.0, 150.0),
            _DAMPING_RATIO,
        ),
        _set_base,
        numbers=("base_m_per_N", "base_Hz", "base_damping_ratio"),
        switches=("base_m_per_N",),
        memory=(("base_m", "f8"), ("base_mps", "f8")),
    ),
}
