"""Friction along the track: a fixed function of position, so that the same track gives the same force again."""

import numpy as np

STEP_m = 5e-6
LENGTH_m = 0.050


def track_m() -> np.ndarray:
    """Positions of the table's points, (10001,)."""
    return np.arange(round(LENGTH_m / STEP_m) + 1) * STEP_m


def draw_surface(random: np.random.Generator, scale: float) -> np.ndarray:
    """Friction level along the track, (10001,), mean about 1.

    A random field with a power-law spectrum above the corner 1/L, as ground and lapped surfaces have (Persson
    2014): L 0.05 to 0.5 mm, amplitude falling as wavenumber^-0.75 to ^-1.5, 0.1 to 0.6 % rms.
    """
    points = len(track_m())
    corner_m = float(np.exp(random.uniform(np.log(0.05e-3), np.log(0.5e-3))))
    slope = random.uniform(0.75, 1.5)
    rms = float(np.exp(random.uniform(np.log(0.001), np.log(0.006))))
    wavenumber = 2.0 * np.pi * np.fft.rfftfreq(points, STEP_m)
    spectrum = np.fft.rfft(random.standard_normal(points)) * (1.0 + (wavenumber * corner_m) ** 2) ** (-0.5 * slope)
    spectrum[0] = 0.0
    field = np.fft.irfft(spectrum, points)
    return 1.0 + scale * rms * field / field.std()
