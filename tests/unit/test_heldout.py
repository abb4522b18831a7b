"""Which names a run kept aside may refute: those that say what it will show."""

from types import SimpleNamespace

import pytest

from diagnosis.heldout import HeldOut, foretells
from diagnosis.refit import Axis, Form


def form(name: str, form: str, *parameters: str) -> Form:
    return Form({name: form}, tuple(Axis(name, one, 0.1, False, 1.0, -1.0, 1.0) for one in parameters))


WAVE = ("ratio", "phase_rad", "second_sin", "second_cos")
FORETELLS = [
    (form("static-level", "", "ratio"), True),
    (form("position-dependent-friction", "wave", "wavelength_m", *WAVE), True),  # the track is the same
    (form("drive-speed-ripple", "screw", "wavelength_m", *WAVE), True),
    (form("base-compliance", "", "compliance_m_per_N", "frequency_Hz"), True),
    (form("normal-load-fluctuation", "sine", "frequency_Hz", *WAVE), False),
    (form("drive-speed-ripple", "time", "frequency_Hz", *WAVE), False),
    (form("position-dependent-friction", "random", "ratio", "wavelength_m"), False),
]


@pytest.mark.parametrize(("effect", "does"), FORETELLS)
def test_what_says_nothing_of_another_run_is_not_refuted(effect, does):
    """Held-out runs of which the fit leaves all that there was."""
    held_out = SimpleNamespace(
        _chi2_retuned=500.0, _chi2=lambda _fit: 500.0, floor=SimpleNamespace(whitening=range(100))
    )
    assert foretells(effect) is does
    assert HeldOut.refutes(held_out, SimpleNamespace(form=effect), 0.4) is does  # pyright: ignore[reportArgumentType]
