"""Which curves of a page stand together, and what there is to see in them."""

from typing import NamedTuple


class Panel(NamedTuple):
    """Curves with one axis."""

    title: str
    hint: str  # what to look at
    signals: tuple[str, ...]  # names of `cockpit.figures.signals`
    is_open: bool = True  # shown at once; the others on a click


PANELS = (
    Panel(
        "Drive force",
        "Rises while the slide sticks and falls when it slips: a red triangle is a slip. Smooth sliding is a level line.",
        ("drive_force_N",),
    ),
    Panel(
        "Vibration against drive",
        "Stick-slip ends where the vibration v_a is faster than the drive v_d: blue above red.",
        ("vibration_velocity_mps", "drive_velocity_mps", "wanted_velocity_mps"),
    ),
    Panel(
        "Amplitude of the base against its stroke",
        "How far the exciter moves the base, zero to peak. Dashed: the most that it may. A curve at the line has nothing left.",
        ("amplitude_m", "wanted_amplitude_m"),
    ),
    Panel(
        "Predicted time to the next slip",
        "While a stick is seen: how long the controller expects it to last. No curve: no slip is expected.",
        ("time_to_slip_s",),
    ),
    Panel(
        "Positions",
        "The slide stands in a stick and jumps in a slip.",
        ("mass_position_m", "drive_position_m"),
        is_open=False,
    ),
    Panel(
        "Accelerations",
        "The base's is the vibration; the slide's shows a peak at each slip.",
        ("base_accel_mps2", "mass_accel_mps2"),
        is_open=False,
    ),
    Panel("Frequency of the vibration", "As applied by the exciter.", ("frequency_Hz",), is_open=False),
)
