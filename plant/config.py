"""The rig file; the contact must be given, all other values default to the paper's rig."""

import math
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from bridge.config import Strict, in_short
from bridge.guard.absent import ChannelName, PresentOrAbsent
from bridge.guard.config import ExciterConfig, GuardConfig, VibrationLimits
from plant.drive_config import DriveConfig, NotNegative, Positive
from plant.effects.library import checked
from plant.effects.sensors import LONGEST_DELAY
from plant.loop_delay import LONGEST_DELAY_S, LONGEST_JITTER_S, whole_blocks
from plant.pairs import PAIRS

NotPositive = Annotated[float, Field(le=0)]
# Fewest solver steps in a period of the vibration, and of the slide on its spring. Smaller: false slips and wrong peaks of the
# force. Larger: sound rigs are refused. Counted: docs/method/rig.md.
_FEWEST_STEPS_A_PERIOD = 20
MOST_BLOCKS_AHEAD = 63  # longest lead of an announcement: with the present block it fills the controller's ring of 64
# Most solver steps in a block. A step takes 0.04 to 0.06 us (measured with steps of 0.1 us, two rigs): this many take 50 ms, 50
# times a block of 1 ms. Larger: a run seems to hang, in a kernel that Ctrl-C does not interrupt.
_MOST_STEPS_A_BLOCK = 1_000_000


class ContactConfig(Strict):
    """The friction pair. `pair` fills in the numbers of a known pair; each number may be overridden."""

    pair: str = Field("", description="A known friction pair, which gives the numbers that this table leaves out.")
    stiffness_N_per_m: Positive
    damping_Ns_per_m: NotNegative
    viscous_damping_Ns_per_m: NotNegative = 0.0
    coulomb_force_N: Positive
    static_force_N: Positive
    stribeck_velocity_mps: Positive = 0.0005  # source [15] of the paper; the same for every pair
    stribeck_tail: Annotated[float, Field(ge=-2, le=2)] = Field(  # Hess and Soom 1990
        0.0,
        description="Share of the Stribeck curve that falls with 1 / (1 + q^2), q = v / v_s; the rest with exp(-q^2).",
    )
    backbone: Literal["lugre", "elasto-plastic"] = "lugre"
    elastic_ratio: Annotated[float, Field(ge=0, lt=1)] = Field(
        0.7, description="Elasto-plastic backbone: purely elastic up to this share of its largest deflection."
    )
    roughness_ratio: Annotated[float, Field(ge=0, le=0.3)] = Field(
        0.0, description="Rough surface: rms scatter of friction along the track, over the mean."
    )
    roughness_length_m: Positive = Field(
        2e-4, description="Rough surface: distance between two values of the friction."
    )
    roughness_seed: Annotated[int, Field(ge=0, le=1_000_000)] = Field(
        0, description="Rough surface: seed of the random track."
    )

    @model_validator(mode="before")
    @classmethod
    def _fill_in_the_pair(cls, table: Any) -> Any:
        if not isinstance(table, dict) or "pair" not in table or table["pair"] == "":
            return table
        if not isinstance(table["pair"], str) or table["pair"] not in PAIRS:
            raise ValueError(f"pair = {in_short(table['pair'])}: unknown friction pair; known: {', '.join(PAIRS)}")
        return PAIRS[table["pair"]] | table

    @model_validator(mode="after")
    def _static_is_not_below_coulomb(self) -> "ContactConfig":
        if self.static_force_N < self.coulomb_force_N:
            raise ValueError(
                f"static_force_N = {self.static_force_N}: must not be below coulomb_force_N = {self.coulomb_force_N}; "
                "the paper's steel pair has 17.38 and 14.49"
            )
        return self


class SlideConfig(Strict):
    """The body that is dragged."""

    mass_kg: Positive = 1.5


class PiezoConfig(ExciterConfig):
    """The simulated exciter: its limits, and its mount."""

    delivered_ratio: Positive = 1.0
    mount_resonance_Hz: NotNegative = Field(default=0.0, description="Resonance of the mount; 0: rigid.")
    mount_damping_ratio: Positive = 0.05


class SensorsConfig(Strict):
    """The measuring chain of the paper's test rig; noise is rms, a resolution of 0 means no quantisation."""

    force_range_N: Positive = Field(default=50.0, description="Highest force that is measured.")
    force_lowest_N: NotPositive = Field(
        default=0.0, description="Lowest force that is measured; a drive that goes back needs one below 0."
    )
    force_noise_N: NotNegative = 0.02
    force_bandwidth_Hz: Positive = 2000.0
    force_gain: Positive = 1.0
    force_resolution_N: NotNegative = 50.0 / 2**16
    accel_range_mps2: Positive = 490.3325  # +-50 g, PCB M352C65
    accel_noise_mps2: NotNegative = 0.0015  # 0.00015 g rms broadband
    accel_lowest_Hz: Positive = 0.5
    accel_bandwidth_Hz: Positive = 10000.0
    accel_resolution_mps2: NotNegative = 2 * 490.3325 / 2**20
    position_range_m: Positive = Field(
        default=0.05, description="Highest position that is measured; slide and drive begin at 0."
    )
    position_lowest_m: NotPositive = Field(default=0.0, description="Lowest position that is measured.")
    position_noise_m: NotNegative = 5e-7
    position_bandwidth_Hz: Positive = 800.0  # HBM WA on a carrier amplifier: below 1 kHz
    position_linearity: NotNegative = 0.002
    position_resolution_m: NotNegative = 0.05 / 2**18


class SolverConfig(Strict):
    """Time steps. Each block of `block_s` is one message with `samples_per_block` samples per channel."""

    step_s: Positive = 1e-5
    # Shorter: at 20 kHz a message has more fields than samples of a channel. Longer: a slip of the paper's rig, 36 ms, is over
    # within two blocks.
    block_s: Annotated[float, Field(ge=0.25e-3, le=20e-3)] = Field(
        default=1e-3,
        description="Length of a block. In real time 0.001 or more; shorter in lockstep and in one process.",
    )
    samples_per_block: Annotated[int, Field(ge=4, le=400)] = 20


class LoopConfig(Strict):
    """Delays between sensors and exciter in addition to the controller's: converters, drivers, a slow bus."""

    delay_s: Annotated[float, Field(ge=0, le=LONGEST_DELAY_S)] = Field(
        default=0.0,
        description="Additional delay of each command, rounded up to whole blocks; 0: it acts in the next block.",
    )
    jitter_s: Annotated[float, Field(ge=0, le=LONGEST_JITTER_S)] = Field(
        default=0.0, description="Largest random addition to delay_s, uniform; commands do not overtake each other."
    )

    def longest_s(self, block_s: float) -> float:
        """Longest time from a block of samples to the block in which its command acts [s]."""
        return block_s * (1 + whole_blocks(self.delay_s + self.jitter_s, block_s))


class RigConfig(Strict):
    """One rig file."""

    name: str = "unnamed"
    adapter: Literal["sim"] = Field(
        "sim", description="A rig of this file is simulated; any other adapter is a real rig."
    )
    contact: ContactConfig
    slide: SlideConfig = SlideConfig()
    drive: DriveConfig = DriveConfig()
    piezo: PiezoConfig = PiezoConfig()
    sensors: SensorsConfig = SensorsConfig()
    solver: SolverConfig = SolverConfig()
    loop: LoopConfig = LoopConfig()
    guard: GuardConfig = GuardConfig()
    channels: dict[ChannelName, PresentOrAbsent] = Field(
        {}, description="[channels.NAME]; without any: all are present."
    )
    effects: dict[str, dict[str, float | str]] = Field({}, description="[effects.NAME]; without any: the ideal rig.")

    @property
    def vibration_limits(self) -> VibrationLimits:
        """The limits that the header states and a controller must keep."""
        return self.guard.vibration_limits(self.piezo)

    # checked before pydantic, which gives two errors for a value that is neither a number nor a string
    @model_validator(mode="before")
    @classmethod
    def _effects_are_known(cls, table: Any) -> Any:
        if not isinstance(table, dict) or not isinstance(table.get("effects"), dict):
            return table
        return table | {"effects": {name: checked(name, values) for name, values in table["effects"].items()}}

    @model_validator(mode="after")
    def _steps_fit(self) -> "RigConfig":
        solver, piezo = self.solver, self.piezo
        if piezo.frequency_max_Hz <= piezo.frequency_min_Hz:
            raise ValueError(
                f"piezo.frequency_max_Hz = {piezo.frequency_max_Hz}: must be above "
                f"piezo.frequency_min_Hz = {piezo.frequency_min_Hz}"
            )
        # a loop check without allowed tones is refused here
        self.guard.tones_Hz(piezo.frequency_min_Hz, piezo.frequency_max_Hz)
        coarsest_s = 1.0 / (_FEWEST_STEPS_A_PERIOD * piezo.frequency_max_Hz)
        if solver.step_s > coarsest_s * (1.0 + 1e-9):
            raise ValueError(
                f"solver.step_s = {solver.step_s:g}: too coarse for piezo.frequency_max_Hz = {piezo.frequency_max_Hz:g}: "
                f"below {_FEWEST_STEPS_A_PERIOD} steps a period the contact shows slips that are not real; "
                f"use {coarsest_s:g} or less, or lower the frequency"
            )
        if solver.block_s / solver.step_s > _MOST_STEPS_A_BLOCK:
            raise ValueError(
                f"solver.step_s = {solver.step_s:g}: must not make more than {_MOST_STEPS_A_BLOCK:g} steps in solver.block_s = "
                f"{solver.block_s:g}, which takes 50 ms or so; lengthen it to {solver.block_s / _MOST_STEPS_A_BLOCK:g} or more"
            )
        steps = solver.block_s / (solver.step_s * solver.samples_per_block)
        if abs(steps - round(steps)) > 1e-6 or round(steps) < 1:
            raise ValueError(
                f"solver.block_s = {solver.block_s:g}: must hold a whole number of steps between its "
                f"{solver.samples_per_block} samples; with step_s = {solver.step_s:g} there are {steps:g}"
            )
        if piezo.command_timeout_s < 2.0 * solver.block_s:
            raise ValueError(
                f"piezo.command_timeout_s = {piezo.command_timeout_s:g}: must hold 2 blocks of solver.block_s = "
                f"{solver.block_s:g}, or no command is ever fresh; raise it"
            )
        least_s = self.loop.longest_s(solver.block_s) + solver.block_s
        if self.loop != LoopConfig() and piezo.command_timeout_s < least_s * (1.0 - 1e-9):
            raise ValueError(
                f"piezo.command_timeout_s = {piezo.command_timeout_s:g}: must be longer than the loop's delay: with "
                f"loop.delay_s = {self.loop.delay_s:g} and loop.jitter_s = {self.loop.jitter_s:g} a command is up to "
                f"{self.loop.longest_s(solver.block_s):g} s old when it acts, and would count as lost; raise it to "
                f"{least_s:g} or more"
            )
        # k_t dt^2 / m must be at most 1: at 1.9 friction oscillates by itself (docs/method/rig.md)
        lightest_kg = self.contact.stiffness_N_per_m * solver.step_s**2
        if self.slide.mass_kg < lightest_kg:
            longest_s = math.sqrt(self.slide.mass_kg / self.contact.stiffness_N_per_m)
            raise ValueError(
                f"slide.mass_kg = {self.slide.mass_kg:g}: must be at least contact.stiffness_N_per_m x solver.step_s^2, here "
                f"{lightest_kg:.2g} kg; shorten solver.step_s to {longest_s:.2g} or less"
            )
        return self

    @model_validator(mode="after")
    def _announcements_are_kept(self) -> "RigConfig":
        ahead_s, block_s = self.drive.announce_ahead_s, self.solver.block_s
        if whole_blocks(ahead_s, block_s) > MOST_BLOCKS_AHEAD:
            raise ValueError(
                f"drive.announce_ahead_s = {ahead_s:g}: must be at most {MOST_BLOCKS_AHEAD} blocks of solver.block_s = "
                f"{block_s:g}, as a controller keeps the {MOST_BLOCKS_AHEAD + 1} newest announcements; shorten it to "
                f"{MOST_BLOCKS_AHEAD * block_s:g}"
            )
        return self

    @model_validator(mode="after")
    def _drive_is_not_too_stiff(self) -> "RigConfig":
        # Nothing damps the slide on its spring, so too few steps a period change the peaks of the force (docs/method/rig.md).
        k_d, ratio = self.drive.stiffness_N_per_m, self._value("drive-stiffness", "ratio")
        per_step = 2.0 * math.pi / _FEWEST_STEPS_A_PERIOD
        stiffest = self.slide.mass_kg * (per_step / self.solver.step_s) ** 2 / (1.0 + ratio)
        if k_d > stiffest:
            longest_s = per_step * math.sqrt(self.slide.mass_kg / (k_d * (1.0 + ratio)))
            with_effect = f" with effects.drive-stiffness.ratio = {ratio:g}" if ratio else ""
            raise ValueError(
                f"drive.stiffness_N_per_m = {k_d:g}{with_effect}: must be at most {stiffest:.3g} N/m on slide.mass_kg = "
                f"{self.slide.mass_kg:g}: a period of the slide on its spring needs {_FEWEST_STEPS_A_PERIOD} steps; "
                f"lower it or shorten solver.step_s to {longest_s:.2g} or less"
            )
        return self

    def _value(self, effect: str, key: str) -> float:
        """A parameter of an effect; 0 for a rig without the effect."""
        return float(self.effects.get(effect, {}).get(key, 0.0))

    @model_validator(mode="after")
    def _friction_is_left(self) -> "RigConfig":
        ageing = self.effects.get("static-friction-ageing")
        if ageing is None:
            return self
        ratio, rested_s = float(ageing["ratio"]), float(ageing["rested_s"])
        if ageing["form"] == "log":
            growth = math.log1p(rested_s / float(ageing["age_scale_s"]))
        elif ageing["form"] == "power":
            growth = rested_s ** float(ageing["exponent"])
        else:
            growth = 1.0 - math.exp(-rested_s / float(ageing["settling_s"]))
        if ratio * growth >= 1.0:
            raise ValueError(
                f"effects.static-friction-ageing.rested_s = {rested_s:g}: with ratio = {ratio:g} the contact would have gained "
                f"{ratio * growth:.3g} times its static force by then; must be below 1, or no static force is left at age 0; "
                "lower one of the two"
            )
        return self

    @model_validator(mode="after")
    def _effects_fit(self) -> "RigConfig":
        solver = self.solver
        longest_s = LONGEST_DELAY * solver.block_s / solver.samples_per_block
        delay_s = self._value("force-sensor-delay", "delay_s")
        if delay_s > longest_s * (1.0 + 1e-9):
            raise ValueError(
                f"effects.force-sensor-delay.delay_s = {delay_s:g}: must not be above {LONGEST_DELAY} samples, here "
                f"{longest_s:g}; shorten it or lower solver.samples_per_block"
            )
        base = "base-compliance"
        compliance_m_per_N = self._value(base, "compliance_m_per_N")
        frequency_Hz = self._value(base, "frequency_Hz")
        per_kg = compliance_m_per_N * (2.0 * math.pi * frequency_Hz) ** 2
        # the bristle between base and slide is stable down to a quarter of this mass of the base
        lightest_kg = self.contact.stiffness_N_per_m * solver.step_s**2
        if per_kg * lightest_kg > 1.0:
            raise ValueError(
                f"effects.base-compliance.frequency_Hz = {frequency_Hz:g}: with compliance_m_per_N = "
                f"{compliance_m_per_N:g} the base weighs {1.0 / per_kg:.2g} kg, 1 / (compliance (2 pi f)^2); must be at least "
                f"{lightest_kg:.2g} kg with solver.step_s = {solver.step_s:g}; lower one of the three"
            )
        ratio = self._value("frame-compliance", "ratio")
        frequency_Hz = self._value("frame-compliance", "frequency_Hz")
        # sum of two stiffnesses over the frame's stiffness: the drive's spring, and the spring in series with a relaxing damper
        stiffer = ratio
        if relaxation_s := self._value("drive-damping", "relaxation_s"):
            k_d = self.drive.stiffness_N_per_m * (1.0 + self._value("drive-stiffness", "ratio"))
            stiffer += ratio * self._value("drive-damping", "damping_Ns_per_m") / (relaxation_s * k_d)
        highest_Hz = 1.0 / (2.0 * math.pi * solver.step_s * math.sqrt(1.0 + stiffer))
        if frequency_Hz > highest_Hz:  # half of the frequency at which the frame's leapfrog becomes unstable
            raise ValueError(
                f"effects.frame-compliance.frequency_Hz = {frequency_Hz:g}: with ratio = {ratio:g} between the frame and "
                f"the drive's springs must be at most {highest_Hz:.3g} Hz with solver.step_s = {solver.step_s:g}; lower one"
            )
        return self
