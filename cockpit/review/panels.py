"""Which curves share a panel, and the hint above each panel."""

from typing import NamedTuple


class Panel(NamedTuple):
    """Curves with one axis."""

    title: str
    hint: str  # text above the curves
    signals: tuple[str, ...]  # names of `cockpit.figures.signals`
    is_open: bool = True  # unfolded at first


PANELS = (
    Panel(
        "Drive force",
        "Rises while the slide sticks and falls when it slips (red triangle). Smooth sliding is a level line.",
        ("drive_force_N",),
    ),
    Panel(
        "Vibration against drive",
        "Stick-slip ends where the vibration v_a is faster than the drive v_d: blue above red.",
        ("vibration_velocity_mps", "drive_velocity_mps", "wanted_velocity_mps"),
    ),
    Panel(
        "Amplitude of the base against its stroke",
        "Amplitude of the base, zero to peak. Dashed: its limit. A curve at the limit has no reserve.",
        ("amplitude_m", "wanted_amplitude_m"),
    ),
    Panel(
        "Predicted time to the next slip",
        "Expected rest of a detected stick. No curve: the controller expects no slip.",
        ("time_to_slip_s",),
    ),
    Panel(
        "Positions",
        "The slide rests in a stick and jumps in a slip.",
        ("mass_position_m", "drive_position_m"),
        is_open=False,
    ),
    Panel(
        "Accelerations",
        "The base shows the vibration; the slide shows a peak at each slip.",
        ("base_accel_mps2", "mass_accel_mps2"),
        is_open=False,
    ),
    Panel("Frequency of the vibration", "As applied by the exciter.", ("frequency_Hz",), is_open=False),
)
