"""The sensor channels of a rig, one row each; a new channel begins here."""

import math
from typing import NamedTuple


class Channel(NamedTuple):
    """A column of measured data."""

    name: str  # name on the wire, in logs and in evidence, with the SI unit at its end
    quantity: str  # a quantity of `bridge.tables.unit_words`
    turning: str  # quantity on a rotary rig
    radius_power: int  # power of the radius that converts a value of a rotary rig to a value of a linear rig
    largest: float = math.inf  # larger values have a wrong unit: positions of a bench rig exceed it in mm, never in m
    has_spikes: bool = False  # a slip causes a spike, so a single value far from its neighbours may be right
    positive: str = ""  # direction of a positive value
    is_controlled: bool = False  # the controller needs it
    sensor: str = ""  # start of the channel's keys in [rig.sensors]: noise, resolution, range
    has_lowest: bool = False  # [rig.sensors] has a lower end of its range; otherwise the range is symmetric
    needed: str = ""  # why a rig without it is refused
    guards: str = ""  # protection that a rig without it lacks
    without: str = ""  # consequence of a missing channel for a diagnosis of a rig with a drive spring
    without_force_drive: str = ""  # consequence for a diagnosis of a rig that a given force drives


_FORWARD = "forward"
SENSOR_CHANNELS = {
    channel.name: channel
    for channel in (
        Channel(
            "drive_force_N", "force", "torque", -1,
            positive="pulls the slide forward", is_controlled=True, sensor="force", has_lowest=True,
            guards="sticks show in mass_position_m alone, and a wrong position contradicts no force",
            without="slips are seen in the acceleration only, and no force level or drive stiffness can be judged",
        ),
        Channel(
            "mass_accel_mps2", "acceleration", "angular acceleration", 1, largest=1e5, has_spikes=True,
            positive=_FORWARD, sensor="accel",
            guards="accelerometers that are swapped, or a slide that the base does not move, are not found",
            without="mass, normal-load fluctuation and the fast part of a slip are judged from the force alone",
            without_force_drive="the acceleration is taken from the position, twice differentiated",
        ),
        Channel(
            "base_accel_mps2", "acceleration", "angular acceleration", 1, largest=1e5, has_spikes=True,
            positive=_FORWARD, is_controlled=True, sensor="accel",
            needed="no other channel shows the vibration, so neither the loop check nor LOUD would see the exciter",
            without="the amplitude that the piezo delivers, and a base that gives way, cannot be seen",
        ),
        Channel(
            "mass_position_m", "length", "angle", 1, largest=10.0,
            positive=_FORWARD, is_controlled=True, sensor="position", has_lowest=True,
            guards="a wrong scale of drive_position_m raises DRIVE_RATIO and LOUD, up to DRIVE_FAST and DRIVE_MAX",
            without="position-dependent friction and frame compliance are judged from the drive position only",
            without_force_drive="the motion is taken from the acceleration: effects of place and slow drift cannot be judged",
        ),
        Channel(
            "drive_position_m", "length", "angle", 1, largest=10.0,
            positive=_FORWARD, is_controlled=True, sensor="position", has_lowest=True,
            needed="no other channel shows v_d, to which the vibration and its limits are relative",
            without="the drive counts as perfectly even: no speed ripple can be seen",
        ),
    )
}  # fmt: skip
CHANNELS = tuple(SENSOR_CHANNELS)  # names, in the order of the wire
