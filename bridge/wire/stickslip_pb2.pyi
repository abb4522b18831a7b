from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Mode(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    DISABLED: _ClassVar[Mode]
    WATCH: _ClassVar[Mode]
    EXCITE: _ClassVar[Mode]
    WAIT: _ClassVar[Mode]
    PROBE: _ClassVar[Mode]
    STOPPED: _ClassVar[Mode]

class ContactState(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    UNKNOWN: _ClassVar[ContactState]
    STANDSTILL: _ClassVar[ContactState]
    STICK: _ClassVar[ContactState]
    SLIP: _ClassVar[ContactState]
    SMOOTH: _ClassVar[ContactState]

class GuardState(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    NO_GUARD: _ClassVar[GuardState]
    DISARMED: _ClassVar[GuardState]
    CHECKING: _ClassVar[GuardState]
    READY: _ClassVar[GuardState]
    ARMED: _ClassVar[GuardState]
    ACTIVE: _ClassVar[GuardState]
    FAULT: _ClassVar[GuardState]

class Cause(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    NO_CAUSE: _ClassVar[Cause]
    POWER_UP: _ClassVar[Cause]
    ARMED_BY_SCENARIO: _ClassVar[Cause]
    ARMED_BY_PERSON: _ClassVar[Cause]
    DISARMED_BY_PERSON: _ClassVar[Cause]
    RESET_BY_PERSON: _ClassVar[Cause]
    CHECK_PASSED: _ClassVar[Cause]
    VIBRATION_BEGAN: _ClassVar[Cause]
    VIBRATION_ENDED: _ClassVar[Cause]
    RUN_ENDED: _ClassVar[Cause]
    STOP_BY_PERSON: _ClassVar[Cause]
    STOP_KEPT: _ClassVar[Cause]
    COMMAND_LOST: _ClassVar[Cause]
    OVERTRAVEL: _ClassVar[Cause]
    DRIVE_MAX: _ClassVar[Cause]
    DRIVE_RATIO: _ClassVar[Cause]
    LOUD: _ClassVar[Cause]
    BAND: _ClassVar[Cause]
    HEAT: _ClassVar[Cause]
    DUTY: _ClassVar[Cause]
    SLEW_RATE: _ClassVar[Cause]
    SENSOR_FROZEN: _ClassVar[Cause]
    SENSOR_NOT_FINITE: _ClassVar[Cause]
    EXCITER_SILENT: _ClassVar[Cause]
    EXCITER_WILD: _ClassVar[Cause]
    FIRST_CHECK: _ClassVar[Cause]
    GAIN_CHANGED: _ClassVar[Cause]
    GAIN_ACCEPTED: _ClassVar[Cause]
    GAIN_UNEXPECTED: _ClassVar[Cause]
    ENABLE_DEAD: _ClassVar[Cause]
    DRIVE_FAST: _ClassVar[Cause]

class Limit(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    NO_LIMIT: _ClassVar[Limit]
    RANGE: _ClassVar[Limit]
    SLEW: _ClassVar[Limit]
    FREQUENCY_BAND: _ClassVar[Limit]
    STALE_INPUT: _ClassVar[Limit]
    OPERATOR_STOP: _ClassVar[Limit]
    NOT_FINITE: _ClassVar[Limit]
    GAIN_LIMIT: _ClassVar[Limit]
    HELD_OPEN_LOOP: _ClassVar[Limit]
    NO_DRIVE: _ClassVar[Limit]

class Reason(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    NO_REASON: _ClassVar[Reason]
    NOT_ENABLED: _ClassVar[Reason]
    NOTHING_TO_DO: _ClassVar[Reason]
    STICK_SEEN: _ClassVar[Reason]
    HELD: _ClassVar[Reason]
    LATE_SO_GENTLE: _ClassVar[Reason]
    TOO_LATE: _ClassVar[Reason]
    STILL_NEEDED: _ClassVar[Reason]
    NOT_NEEDED: _ClassVar[Reason]
    DRIVE_STANDS: _ClassVar[Reason]
    PIEZO_WEAK: _ClassVar[Reason]
    BLIND: _ClassVar[Reason]
    CANNOT_HELP: _ClassVar[Reason]
    HARMFUL: _ClassVar[Reason]
    MOVING: _ClassVar[Reason]
    START_OF_MOVE: _ClassVar[Reason]
    SETTLING: _ClassVar[Reason]
    NEEDED_BEFORE: _ClassVar[Reason]
    NOT_ARMED: _ClassVar[Reason]
    OPEN_LOOP: _ClassVar[Reason]
    CLIPPED: _ClassVar[Reason]
    SWAPPED: _ClassVar[Reason]
    FROZEN: _ClassVar[Reason]
    RESONANCE: _ClassVar[Reason]
    FORCE_DOUBTED: _ClassVar[Reason]
    DRIVE_DOUBTED: _ClassVar[Reason]
    TRAVEL_END: _ClassVar[Reason]
    NOISE: _ClassVar[Reason]
    SLIDE_DOUBTED: _ClassVar[Reason]
    POSITIONS_APART: _ClassVar[Reason]
    JUMPED: _ClassVar[Reason]
    LOOSE: _ClassVar[Reason]
    GAIN_OTHER: _ClassVar[Reason]
    EXCITER_END: _ClassVar[Reason]
    TRIAL: _ClassVar[Reason]
    DRIVE_UNSEEN: _ClassVar[Reason]
DISABLED: Mode
WATCH: Mode
EXCITE: Mode
WAIT: Mode
PROBE: Mode
STOPPED: Mode
UNKNOWN: ContactState
STANDSTILL: ContactState
STICK: ContactState
SLIP: ContactState
SMOOTH: ContactState
NO_GUARD: GuardState
DISARMED: GuardState
CHECKING: GuardState
READY: GuardState
ARMED: GuardState
ACTIVE: GuardState
FAULT: GuardState
NO_CAUSE: Cause
POWER_UP: Cause
ARMED_BY_SCENARIO: Cause
ARMED_BY_PERSON: Cause
DISARMED_BY_PERSON: Cause
RESET_BY_PERSON: Cause
CHECK_PASSED: Cause
VIBRATION_BEGAN: Cause
VIBRATION_ENDED: Cause
RUN_ENDED: Cause
STOP_BY_PERSON: Cause
STOP_KEPT: Cause
COMMAND_LOST: Cause
OVERTRAVEL: Cause
DRIVE_MAX: Cause
DRIVE_RATIO: Cause
LOUD: Cause
BAND: Cause
HEAT: Cause
DUTY: Cause
SLEW_RATE: Cause
SENSOR_FROZEN: Cause
SENSOR_NOT_FINITE: Cause
EXCITER_SILENT: Cause
EXCITER_WILD: Cause
FIRST_CHECK: Cause
GAIN_CHANGED: Cause
GAIN_ACCEPTED: Cause
GAIN_UNEXPECTED: Cause
ENABLE_DEAD: Cause
DRIVE_FAST: Cause
NO_LIMIT: Limit
RANGE: Limit
SLEW: Limit
FREQUENCY_BAND: Limit
STALE_INPUT: Limit
OPERATOR_STOP: Limit
NOT_FINITE: Limit
GAIN_LIMIT: Limit
HELD_OPEN_LOOP: Limit
NO_DRIVE: Limit
NO_REASON: Reason
NOT_ENABLED: Reason
NOTHING_TO_DO: Reason
STICK_SEEN: Reason
HELD: Reason
LATE_SO_GENTLE: Reason
TOO_LATE: Reason
STILL_NEEDED: Reason
NOT_NEEDED: Reason
DRIVE_STANDS: Reason
PIEZO_WEAK: Reason
BLIND: Reason
CANNOT_HELP: Reason
HARMFUL: Reason
MOVING: Reason
START_OF_MOVE: Reason
SETTLING: Reason
NEEDED_BEFORE: Reason
NOT_ARMED: Reason
OPEN_LOOP: Reason
CLIPPED: Reason
SWAPPED: Reason
FROZEN: Reason
RESONANCE: Reason
FORCE_DOUBTED: Reason
DRIVE_DOUBTED: Reason
TRAVEL_END: Reason
NOISE: Reason
SLIDE_DOUBTED: Reason
POSITIONS_APART: Reason
JUMPED: Reason
LOOSE: Reason
GAIN_OTHER: Reason
EXCITER_END: Reason
TRIAL: Reason
DRIVE_UNSEEN: Reason

class SensorBlock(_message.Message):
    __slots__ = ("sequence", "t_ns", "drive_force_N", "mass_accel_mps2", "base_accel_mps2", "mass_position_m", "drive_position_m", "run", "guard_state", "check_Hz", "check_gain", "checksum", "applied_Hz", "applied_m", "applied_block", "fallback", "guard_limit")
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    T_NS_FIELD_NUMBER: _ClassVar[int]
    DRIVE_FORCE_N_FIELD_NUMBER: _ClassVar[int]
    MASS_ACCEL_MPS2_FIELD_NUMBER: _ClassVar[int]
    BASE_ACCEL_MPS2_FIELD_NUMBER: _ClassVar[int]
    MASS_POSITION_M_FIELD_NUMBER: _ClassVar[int]
    DRIVE_POSITION_M_FIELD_NUMBER: _ClassVar[int]
    RUN_FIELD_NUMBER: _ClassVar[int]
    GUARD_STATE_FIELD_NUMBER: _ClassVar[int]
    CHECK_HZ_FIELD_NUMBER: _ClassVar[int]
    CHECK_GAIN_FIELD_NUMBER: _ClassVar[int]
    CHECKSUM_FIELD_NUMBER: _ClassVar[int]
    APPLIED_HZ_FIELD_NUMBER: _ClassVar[int]
    APPLIED_M_FIELD_NUMBER: _ClassVar[int]
    APPLIED_BLOCK_FIELD_NUMBER: _ClassVar[int]
    FALLBACK_FIELD_NUMBER: _ClassVar[int]
    GUARD_LIMIT_FIELD_NUMBER: _ClassVar[int]
    sequence: int
    t_ns: int
    drive_force_N: _containers.RepeatedScalarFieldContainer[float]
    mass_accel_mps2: _containers.RepeatedScalarFieldContainer[float]
    base_accel_mps2: _containers.RepeatedScalarFieldContainer[float]
    mass_position_m: _containers.RepeatedScalarFieldContainer[float]
    drive_position_m: _containers.RepeatedScalarFieldContainer[float]
    run: int
    guard_state: int
    check_Hz: float
    check_gain: float
    checksum: int
    applied_Hz: float
    applied_m: float
    applied_block: int
    fallback: int
    guard_limit: int
    def __init__(self, sequence: _Optional[int] = ..., t_ns: _Optional[int] = ..., drive_force_N: _Optional[_Iterable[float]] = ..., mass_accel_mps2: _Optional[_Iterable[float]] = ..., base_accel_mps2: _Optional[_Iterable[float]] = ..., mass_position_m: _Optional[_Iterable[float]] = ..., drive_position_m: _Optional[_Iterable[float]] = ..., run: _Optional[int] = ..., guard_state: _Optional[int] = ..., check_Hz: _Optional[float] = ..., check_gain: _Optional[float] = ..., checksum: _Optional[int] = ..., applied_Hz: _Optional[float] = ..., applied_m: _Optional[float] = ..., applied_block: _Optional[int] = ..., fallback: _Optional[int] = ..., guard_limit: _Optional[int] = ...) -> None: ...

class Command(_message.Message):
    __slots__ = ("sequence", "t_ns", "block", "frequency_Hz", "amplitude_m", "mode", "limit", "reason", "run")
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    T_NS_FIELD_NUMBER: _ClassVar[int]
    BLOCK_FIELD_NUMBER: _ClassVar[int]
    FREQUENCY_HZ_FIELD_NUMBER: _ClassVar[int]
    AMPLITUDE_M_FIELD_NUMBER: _ClassVar[int]
    MODE_FIELD_NUMBER: _ClassVar[int]
    LIMIT_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    RUN_FIELD_NUMBER: _ClassVar[int]
    sequence: int
    t_ns: int
    block: int
    frequency_Hz: float
    amplitude_m: float
    mode: int
    limit: int
    reason: int
    run: int
    def __init__(self, sequence: _Optional[int] = ..., t_ns: _Optional[int] = ..., block: _Optional[int] = ..., frequency_Hz: _Optional[float] = ..., amplitude_m: _Optional[float] = ..., mode: _Optional[int] = ..., limit: _Optional[int] = ..., reason: _Optional[int] = ..., run: _Optional[int] = ...) -> None: ...

class Applied(_message.Message):
    __slots__ = ("sequence", "t_ns", "frequency_Hz", "amplitude_m", "command_block", "commands", "fallback", "round_trip_ns", "late_ns", "commands_late", "guard_state", "cause", "guard_limit", "commands_refused", "heat_share", "toggle", "answer_ns", "sample_rate_Hz")
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    T_NS_FIELD_NUMBER: _ClassVar[int]
    FREQUENCY_HZ_FIELD_NUMBER: _ClassVar[int]
    AMPLITUDE_M_FIELD_NUMBER: _ClassVar[int]
    COMMAND_BLOCK_FIELD_NUMBER: _ClassVar[int]
    COMMANDS_FIELD_NUMBER: _ClassVar[int]
    FALLBACK_FIELD_NUMBER: _ClassVar[int]
    ROUND_TRIP_NS_FIELD_NUMBER: _ClassVar[int]
    LATE_NS_FIELD_NUMBER: _ClassVar[int]
    COMMANDS_LATE_FIELD_NUMBER: _ClassVar[int]
    GUARD_STATE_FIELD_NUMBER: _ClassVar[int]
    CAUSE_FIELD_NUMBER: _ClassVar[int]
    GUARD_LIMIT_FIELD_NUMBER: _ClassVar[int]
    COMMANDS_REFUSED_FIELD_NUMBER: _ClassVar[int]
    HEAT_SHARE_FIELD_NUMBER: _ClassVar[int]
    TOGGLE_FIELD_NUMBER: _ClassVar[int]
    ANSWER_NS_FIELD_NUMBER: _ClassVar[int]
    SAMPLE_RATE_HZ_FIELD_NUMBER: _ClassVar[int]
    sequence: int
    t_ns: int
    frequency_Hz: float
    amplitude_m: float
    command_block: int
    commands: int
    fallback: int
    round_trip_ns: int
    late_ns: int
    commands_late: int
    guard_state: int
    cause: int
    guard_limit: int
    commands_refused: int
    heat_share: float
    toggle: int
    answer_ns: int
    sample_rate_Hz: float
    def __init__(self, sequence: _Optional[int] = ..., t_ns: _Optional[int] = ..., frequency_Hz: _Optional[float] = ..., amplitude_m: _Optional[float] = ..., command_block: _Optional[int] = ..., commands: _Optional[int] = ..., fallback: _Optional[int] = ..., round_trip_ns: _Optional[int] = ..., late_ns: _Optional[int] = ..., commands_late: _Optional[int] = ..., guard_state: _Optional[int] = ..., cause: _Optional[int] = ..., guard_limit: _Optional[int] = ..., commands_refused: _Optional[int] = ..., heat_share: _Optional[float] = ..., toggle: _Optional[int] = ..., answer_ns: _Optional[int] = ..., sample_rate_Hz: _Optional[float] = ...) -> None: ...

class Trace(_message.Message):
    __slots__ = ("sequence", "t_ns", "block", "events", "gap_blocks", "state", "mode", "reason", "limit", "slips", "score", "force_rate", "drive_force_N", "burst_mps2", "drive_velocity_mps", "vibration_velocity_mps", "wanted_velocity_mps", "wanted_amplitude_m", "wanted_frequency_Hz", "time_to_slip_s", "lateness_ns", "announcements", "surges", "sliding_velocity_mps", "window_s", "velocity_ratio", "drive_stiffness_N_per_m", "drive_stiffness_sigma", "breakaway_force_N", "sliding_force_N", "loop_delay_s", "exciter_gain")
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    T_NS_FIELD_NUMBER: _ClassVar[int]
    BLOCK_FIELD_NUMBER: _ClassVar[int]
    EVENTS_FIELD_NUMBER: _ClassVar[int]
    GAP_BLOCKS_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    MODE_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    LIMIT_FIELD_NUMBER: _ClassVar[int]
    SLIPS_FIELD_NUMBER: _ClassVar[int]
    SCORE_FIELD_NUMBER: _ClassVar[int]
    FORCE_RATE_FIELD_NUMBER: _ClassVar[int]
    DRIVE_FORCE_N_FIELD_NUMBER: _ClassVar[int]
    BURST_MPS2_FIELD_NUMBER: _ClassVar[int]
    DRIVE_VELOCITY_MPS_FIELD_NUMBER: _ClassVar[int]
    VIBRATION_VELOCITY_MPS_FIELD_NUMBER: _ClassVar[int]
    WANTED_VELOCITY_MPS_FIELD_NUMBER: _ClassVar[int]
    WANTED_AMPLITUDE_M_FIELD_NUMBER: _ClassVar[int]
    WANTED_FREQUENCY_HZ_FIELD_NUMBER: _ClassVar[int]
    TIME_TO_SLIP_S_FIELD_NUMBER: _ClassVar[int]
    LATENESS_NS_FIELD_NUMBER: _ClassVar[int]
    ANNOUNCEMENTS_FIELD_NUMBER: _ClassVar[int]
    SURGES_FIELD_NUMBER: _ClassVar[int]
    SLIDING_VELOCITY_MPS_FIELD_NUMBER: _ClassVar[int]
    WINDOW_S_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_RATIO_FIELD_NUMBER: _ClassVar[int]
    DRIVE_STIFFNESS_N_PER_M_FIELD_NUMBER: _ClassVar[int]
    DRIVE_STIFFNESS_SIGMA_FIELD_NUMBER: _ClassVar[int]
    BREAKAWAY_FORCE_N_FIELD_NUMBER: _ClassVar[int]
    SLIDING_FORCE_N_FIELD_NUMBER: _ClassVar[int]
    LOOP_DELAY_S_FIELD_NUMBER: _ClassVar[int]
    EXCITER_GAIN_FIELD_NUMBER: _ClassVar[int]
    sequence: int
    t_ns: int
    block: int
    events: int
    gap_blocks: int
    state: int
    mode: int
    reason: int
    limit: int
    slips: int
    score: float
    force_rate: float
    drive_force_N: float
    burst_mps2: float
    drive_velocity_mps: float
    vibration_velocity_mps: float
    wanted_velocity_mps: float
    wanted_amplitude_m: float
    wanted_frequency_Hz: float
    time_to_slip_s: float
    lateness_ns: int
    announcements: int
    surges: int
    sliding_velocity_mps: float
    window_s: float
    velocity_ratio: float
    drive_stiffness_N_per_m: float
    drive_stiffness_sigma: float
    breakaway_force_N: float
    sliding_force_N: float
    loop_delay_s: float
    exciter_gain: float
    def __init__(self, sequence: _Optional[int] = ..., t_ns: _Optional[int] = ..., block: _Optional[int] = ..., events: _Optional[int] = ..., gap_blocks: _Optional[int] = ..., state: _Optional[int] = ..., mode: _Optional[int] = ..., reason: _Optional[int] = ..., limit: _Optional[int] = ..., slips: _Optional[int] = ..., score: _Optional[float] = ..., force_rate: _Optional[float] = ..., drive_force_N: _Optional[float] = ..., burst_mps2: _Optional[float] = ..., drive_velocity_mps: _Optional[float] = ..., vibration_velocity_mps: _Optional[float] = ..., wanted_velocity_mps: _Optional[float] = ..., wanted_amplitude_m: _Optional[float] = ..., wanted_frequency_Hz: _Optional[float] = ..., time_to_slip_s: _Optional[float] = ..., lateness_ns: _Optional[int] = ..., announcements: _Optional[int] = ..., surges: _Optional[int] = ..., sliding_velocity_mps: _Optional[float] = ..., window_s: _Optional[float] = ..., velocity_ratio: _Optional[float] = ..., drive_stiffness_N_per_m: _Optional[float] = ..., drive_stiffness_sigma: _Optional[float] = ..., breakaway_force_N: _Optional[float] = ..., sliding_force_N: _Optional[float] = ..., loop_delay_s: _Optional[float] = ..., exciter_gain: _Optional[float] = ...) -> None: ...

class Announce(_message.Message):
    __slots__ = ("sequence", "t_ns", "holds_from_ns", "drive_velocity_mps")
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    T_NS_FIELD_NUMBER: _ClassVar[int]
    HOLDS_FROM_NS_FIELD_NUMBER: _ClassVar[int]
    DRIVE_VELOCITY_MPS_FIELD_NUMBER: _ClassVar[int]
    sequence: int
    t_ns: int
    holds_from_ns: int
    drive_velocity_mps: float
    def __init__(self, sequence: _Optional[int] = ..., t_ns: _Optional[int] = ..., holds_from_ns: _Optional[int] = ..., drive_velocity_mps: _Optional[float] = ...) -> None: ...

class State(_message.Message):
    __slots__ = ("sequence", "t_ns", "drive_force_N", "vibration_velocity_mps", "drive_velocity_mps", "velocity_ratio", "force_rate", "score", "mode", "state", "slips")
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    T_NS_FIELD_NUMBER: _ClassVar[int]
    DRIVE_FORCE_N_FIELD_NUMBER: _ClassVar[int]
    VIBRATION_VELOCITY_MPS_FIELD_NUMBER: _ClassVar[int]
    DRIVE_VELOCITY_MPS_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_RATIO_FIELD_NUMBER: _ClassVar[int]
    FORCE_RATE_FIELD_NUMBER: _ClassVar[int]
    SCORE_FIELD_NUMBER: _ClassVar[int]
    MODE_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    SLIPS_FIELD_NUMBER: _ClassVar[int]
    sequence: int
    t_ns: int
    drive_force_N: float
    vibration_velocity_mps: float
    drive_velocity_mps: float
    velocity_ratio: float
    force_rate: float
    score: float
    mode: int
    state: int
    slips: int
    def __init__(self, sequence: _Optional[int] = ..., t_ns: _Optional[int] = ..., drive_force_N: _Optional[float] = ..., vibration_velocity_mps: _Optional[float] = ..., drive_velocity_mps: _Optional[float] = ..., velocity_ratio: _Optional[float] = ..., force_rate: _Optional[float] = ..., score: _Optional[float] = ..., mode: _Optional[int] = ..., state: _Optional[int] = ..., slips: _Optional[int] = ...) -> None: ...

class Scope(_message.Message):
    __slots__ = ("sequence", "t_ns", "drive_force_min_N", "drive_force_mean_N", "drive_force_max_N", "mass_accel_min_mps2", "mass_accel_mean_mps2", "mass_accel_max_mps2", "base_accel_min_mps2", "base_accel_mean_mps2", "base_accel_max_mps2", "mass_position_min_m", "mass_position_mean_m", "mass_position_max_m", "drive_position_min_m", "drive_position_mean_m", "drive_position_max_m", "frequency_Hz", "amplitude_m", "vibration_velocity_mps", "drive_velocity_mps", "wanted_velocity_mps", "time_to_slip_s", "mode", "state", "reason", "limit", "guard_state", "cause")
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    T_NS_FIELD_NUMBER: _ClassVar[int]
    DRIVE_FORCE_MIN_N_FIELD_NUMBER: _ClassVar[int]
    DRIVE_FORCE_MEAN_N_FIELD_NUMBER: _ClassVar[int]
    DRIVE_FORCE_MAX_N_FIELD_NUMBER: _ClassVar[int]
    MASS_ACCEL_MIN_MPS2_FIELD_NUMBER: _ClassVar[int]
    MASS_ACCEL_MEAN_MPS2_FIELD_NUMBER: _ClassVar[int]
    MASS_ACCEL_MAX_MPS2_FIELD_NUMBER: _ClassVar[int]
    BASE_ACCEL_MIN_MPS2_FIELD_NUMBER: _ClassVar[int]
    BASE_ACCEL_MEAN_MPS2_FIELD_NUMBER: _ClassVar[int]
    BASE_ACCEL_MAX_MPS2_FIELD_NUMBER: _ClassVar[int]
    MASS_POSITION_MIN_M_FIELD_NUMBER: _ClassVar[int]
    MASS_POSITION_MEAN_M_FIELD_NUMBER: _ClassVar[int]
    MASS_POSITION_MAX_M_FIELD_NUMBER: _ClassVar[int]
    DRIVE_POSITION_MIN_M_FIELD_NUMBER: _ClassVar[int]
    DRIVE_POSITION_MEAN_M_FIELD_NUMBER: _ClassVar[int]
    DRIVE_POSITION_MAX_M_FIELD_NUMBER: _ClassVar[int]
    FREQUENCY_HZ_FIELD_NUMBER: _ClassVar[int]
    AMPLITUDE_M_FIELD_NUMBER: _ClassVar[int]
    VIBRATION_VELOCITY_MPS_FIELD_NUMBER: _ClassVar[int]
    DRIVE_VELOCITY_MPS_FIELD_NUMBER: _ClassVar[int]
    WANTED_VELOCITY_MPS_FIELD_NUMBER: _ClassVar[int]
    TIME_TO_SLIP_S_FIELD_NUMBER: _ClassVar[int]
    MODE_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    LIMIT_FIELD_NUMBER: _ClassVar[int]
    GUARD_STATE_FIELD_NUMBER: _ClassVar[int]
    CAUSE_FIELD_NUMBER: _ClassVar[int]
    sequence: int
    t_ns: int
    drive_force_min_N: float
    drive_force_mean_N: float
    drive_force_max_N: float
    mass_accel_min_mps2: float
    mass_accel_mean_mps2: float
    mass_accel_max_mps2: float
    base_accel_min_mps2: float
    base_accel_mean_mps2: float
    base_accel_max_mps2: float
    mass_position_min_m: float
    mass_position_mean_m: float
    mass_position_max_m: float
    drive_position_min_m: float
    drive_position_mean_m: float
    drive_position_max_m: float
    frequency_Hz: float
    amplitude_m: float
    vibration_velocity_mps: float
    drive_velocity_mps: float
    wanted_velocity_mps: float
    time_to_slip_s: float
    mode: Mode
    state: ContactState
    reason: Reason
    limit: Limit
    guard_state: GuardState
    cause: Cause
    def __init__(self, sequence: _Optional[int] = ..., t_ns: _Optional[int] = ..., drive_force_min_N: _Optional[float] = ..., drive_force_mean_N: _Optional[float] = ..., drive_force_max_N: _Optional[float] = ..., mass_accel_min_mps2: _Optional[float] = ..., mass_accel_mean_mps2: _Optional[float] = ..., mass_accel_max_mps2: _Optional[float] = ..., base_accel_min_mps2: _Optional[float] = ..., base_accel_mean_mps2: _Optional[float] = ..., base_accel_max_mps2: _Optional[float] = ..., mass_position_min_m: _Optional[float] = ..., mass_position_mean_m: _Optional[float] = ..., mass_position_max_m: _Optional[float] = ..., drive_position_min_m: _Optional[float] = ..., drive_position_mean_m: _Optional[float] = ..., drive_position_max_m: _Optional[float] = ..., frequency_Hz: _Optional[float] = ..., amplitude_m: _Optional[float] = ..., vibration_velocity_mps: _Optional[float] = ..., drive_velocity_mps: _Optional[float] = ..., wanted_velocity_mps: _Optional[float] = ..., time_to_slip_s: _Optional[float] = ..., mode: _Optional[_Union[Mode, str]] = ..., state: _Optional[_Union[ContactState, str]] = ..., reason: _Optional[_Union[Reason, str]] = ..., limit: _Optional[_Union[Limit, str]] = ..., guard_state: _Optional[_Union[GuardState, str]] = ..., cause: _Optional[_Union[Cause, str]] = ...) -> None: ...

class Snapshot(_message.Message):
    __slots__ = ("sequence", "t_ns", "step", "layout", "memory")
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    T_NS_FIELD_NUMBER: _ClassVar[int]
    STEP_FIELD_NUMBER: _ClassVar[int]
    LAYOUT_FIELD_NUMBER: _ClassVar[int]
    MEMORY_FIELD_NUMBER: _ClassVar[int]
    sequence: int
    t_ns: int
    step: int
    layout: str
    memory: bytes
    def __init__(self, sequence: _Optional[int] = ..., t_ns: _Optional[int] = ..., step: _Optional[int] = ..., layout: _Optional[str] = ..., memory: _Optional[bytes] = ...) -> None: ...

class Event(_message.Message):
    __slots__ = ("sequence", "t_ns", "source", "code", "text")
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    T_NS_FIELD_NUMBER: _ClassVar[int]
    SOURCE_FIELD_NUMBER: _ClassVar[int]
    CODE_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    sequence: int
    t_ns: int
    source: str
    code: str
    text: str
    def __init__(self, sequence: _Optional[int] = ..., t_ns: _Optional[int] = ..., source: _Optional[str] = ..., code: _Optional[str] = ..., text: _Optional[str] = ...) -> None: ...

class Operator(_message.Message):
    __slots__ = ("action", "who")
    class Action(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        NOTHING: _ClassVar[Operator.Action]
        STOP: _ClassVar[Operator.Action]
        RESET: _ClassVar[Operator.Action]
        ARM: _ClassVar[Operator.Action]
        DISARM: _ClassVar[Operator.Action]
        ACCEPT_GAIN: _ClassVar[Operator.Action]
    NOTHING: Operator.Action
    STOP: Operator.Action
    RESET: Operator.Action
    ARM: Operator.Action
    DISARM: Operator.Action
    ACCEPT_GAIN: Operator.Action
    ACTION_FIELD_NUMBER: _ClassVar[int]
    WHO_FIELD_NUMBER: _ClassVar[int]
    action: Operator.Action
    who: str
    def __init__(self, action: _Optional[_Union[Operator.Action, str]] = ..., who: _Optional[str] = ...) -> None: ...

class Header(_message.Message):
    __slots__ = ("role", "schema_version", "configuration", "versions", "process", "rig")
    ROLE_FIELD_NUMBER: _ClassVar[int]
    SCHEMA_VERSION_FIELD_NUMBER: _ClassVar[int]
    CONFIGURATION_FIELD_NUMBER: _ClassVar[int]
    VERSIONS_FIELD_NUMBER: _ClassVar[int]
    PROCESS_FIELD_NUMBER: _ClassVar[int]
    RIG_FIELD_NUMBER: _ClassVar[int]
    role: str
    schema_version: int
    configuration: str
    versions: str
    process: str
    rig: str
    def __init__(self, role: _Optional[str] = ..., schema_version: _Optional[int] = ..., configuration: _Optional[str] = ..., versions: _Optional[str] = ..., process: _Optional[str] = ..., rig: _Optional[str] = ...) -> None: ...

class Inject(_message.Message):
    __slots__ = ("fault", "clear", "who", "id")
    FAULT_FIELD_NUMBER: _ClassVar[int]
    CLEAR_FIELD_NUMBER: _ClassVar[int]
    WHO_FIELD_NUMBER: _ClassVar[int]
    ID_FIELD_NUMBER: _ClassVar[int]
    fault: str
    clear: bool
    who: str
    id: str
    def __init__(self, fault: _Optional[str] = ..., clear: _Optional[bool] = ..., who: _Optional[str] = ..., id: _Optional[str] = ...) -> None: ...
