"""The table `[drive]` of a rig file: the spring, and how the drive moves."""

from itertools import pairwise
from typing import Annotated

from pydantic import Field, model_validator

from bridge.config import Strict, Two
from plant.drive_motion import DriveMotion, Move, again_and_again, of_moves, of_profile, peak_mps

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]


class MoveConfig(Strict):
    """A jerk-limited move from standstill to standstill, then a stop."""

    distance_m: float | None = Field(None, description="Distance; below 0: backwards. Give this or to_m.")
    to_m: float | None = Field(None, description="Target position; the drive begins the run at 0.")
    velocity_mps: Positive = Field(description="Highest speed; a short move stays below it.")
    acceleration_mps2: Positive = Field(description="Highest acceleration, and deceleration.")
    jerk_mps3: Positive = Field(description="Highest rate of the acceleration.")
    dwell_s: NotNegative = Field(0.0, description="Time at rest after the move.")

    @model_validator(mode="after")
    def _goes_somewhere(self) -> "MoveConfig":
        if (self.distance_m is None) == (self.to_m is None):
            given = "neither" if self.distance_m is None else "both"
            raise ValueError(f"distance_m, to_m: {given} given: must be one of them; give a distance or a target")
        return self


class DriveConfig(Strict):
    """The drive that moves the slide through a spring. `profile` is [[time_s, velocity_mps], ...], linear in between."""

    stiffness_N_per_m: Positive = 11700.0
    damping_Ns_per_m: NotNegative = 0.0
    profile: Annotated[list[Two], Field(min_length=1)] = Field(
        default=[(0.0, 0.0005)], description="[[time_s, velocity_mps], ...], linear in between; below 0: backwards."
    )
    moves: Annotated[list[MoveConfig], Field(max_length=10_000)] = Field(
        default=[], description="Jerk-limited moves, one after the other, in place of the profile."
    )
    repeat_every_s: NotNegative = Field(
        default=0.0, description="Profile or moves repeat after this time; 0: they run once."
    )
    announce_ahead_s: NotNegative = Field(
        default=0.0,
        description="The rig announces the drive velocity to the controller this long ahead, in whole blocks; 0: never.",
    )

    @model_validator(mode="after")
    def _time_goes_forward(self) -> "DriveConfig":
        times_s = [time_s for time_s, _ in self.profile]
        if any(later <= earlier for earlier, later in pairwise(times_s)):
            raise ValueError(f"profile: the times {times_s} must increase; use 8.0 and 8.001 for a step at 8 s")
        if self.repeat_every_s == 0.0:
            return self
        name = "moves" if self.moves else "profile"
        needed_s = float(self._once().start_s[-1])
        if self.repeat_every_s < needed_s * (1.0 - 1e-9):
            raise ValueError(
                f"repeat_every_s = {self.repeat_every_s:g}: must hold the whole of {name}, {needed_s:.6g} s; raise it"
            )
        if any(move.to_m is not None for move in self.moves) and self.motion().drift_m != 0.0:
            raise ValueError(
                f"repeat_every_s = {self.repeat_every_s:g}: the moves end at {self.motion().drift_m:g} m, and to_m would be "
                "another place in every cycle: must end at 0; add a move with to_m = 0.0"
            )
        return self

    def motion(self) -> DriveMotion:
        """Position and velocity of the drive over the time of a run."""
        once = self._once()
        return again_and_again(once, self.repeat_every_s) if self.repeat_every_s > 0.0 else once

    def speeds_mps(self) -> list[float]:
        """Peak speeds of the moves, or the speeds at the points of the profile [m/s], lowest first."""
        of_moves = {peak_mps(move) for move in self._moves() if move.distance_m != 0.0}
        of_profile = {abs(velocity_mps) for _, velocity_mps in self.profile if velocity_mps != 0.0}
        return sorted(of_moves if self.moves else of_profile)

    def _once(self) -> DriveMotion:
        return of_moves(self._moves()) if self.moves else of_profile(self.profile)

    def _moves(self) -> list[Move]:
        made: list[Move] = []
        at_m = 0.0
        for move in self.moves:
            distance_m = move.to_m - at_m if move.to_m is not None else move.distance_m or 0.0
            made.append(Move(distance_m, move.velocity_mps, move.acceleration_mps2, move.jerk_mps3, move.dwell_s))
            at_m = at_m + distance_m if move.to_m is None else move.to_m
        return made
