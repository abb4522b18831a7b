"""The unit of a column, read from its name."""

# longest suffix first: `_mps2` before `_mps` before `_s`
_UNITS = (
    ("_Ns_per_m", "N s/m"),
    ("_N_per_m", "N/m"),
    ("_mps2", "m/s^2"),
    ("_mps", "m/s"),
    ("_Hz", "Hz"),
    ("_ns", "ns"),
    ("_kg", "kg"),
    ("_N", "N"),
    ("_m", "m"),
    ("_s", "s"),
)


def unit_of(name: str) -> str:
    """Unit of `name`, as `N` for `drive_force_N`; `1` for a number without a unit, as a count or a code."""
    return next((unit for suffix, unit in _UNITS if name.endswith(suffix)), "1")
