# Made by `make layouts`; change the dtype instead.
from typing import Any

import numpy.typing as npt

class ControllerParams:
    accel_bandwidth_Hz:float; accel_range_mps2:float; amplitude_max_m:float; band_Hz:npt.NDArray[Any]; bands:int;
    bin_s:float; bin_samples:int; bins_per_tick:int; block_s:float; configured_gain:float;
    drive_stiffness_N_per_m:float; enabled_from_ns:int; enabled_from_s:float; filter_s:float; filter_share:float;
    follow_share:float; frequency_Hz:float; frequency_max_Hz:float; frequency_min_Hz:float; frozen_steps:int;
    gain_band:float; gain_floor:float; gain_leap:float; learn_share:float; least_feed_mps:float; least_ratio:float;
    levels:int; mode:int; most_ratio:float; sample_s:float; samples_per_block:int; slew_m_per_s:float;
    slew_m_per_step:float; slot_steps:int; spring_level:int; stale_after_s:float; ticks_per_block:int;
    travel_high_m:float; travel_low_m:float; trial_every_s:float; use_force:int; use_slide_position:int; v_ratio:float;
    velocity_max_mps:float; window_s:npt.NDArray[Any]

class ControllerMemory:
    accepted_share:float; agreed:int; agreed_mps:float; allowed_Hz:float; allowed_m:float; announced_count:int;
    announced_from_ns:npt.NDArray[Any]; announced_mps:npt.NDArray[Any]; applied_mps:float; at_limit:int; banded:int;
    bins:npt.NDArray[Any]; blind:int; block:int; block_sum:npt.NDArray[Any]; breakaway_N:npt.NDArray[Any]; changed:int;
    check_least:float; check_most:float; checked_blocks:int; compliance_m_per_N:float; compliance_sigma:float;
    contact:int; crest_N:float; crest_before_N:float; differences:npt.NDArray[Any]; direction:int; doubted:int;
    dragged:npt.NDArray[Any]; drive_unseen:int; drive_velocity_mps:float; drive_velocity_sigma_mps:float; even_s:float;
    evidence_s:float; expected_stick_s:float; fade:float; failed:float; fall_N:float; fall_s:float; fall_with_N:float;
    far:npt.NDArray[Any]; fast_mps:float; followed_gain:float; force_rate:float; fresh:npt.NDArray[Any]; gain:float;
    gain_off_s:float; grown_s:float; guard_state:int; held_mps:float; in_force_s:float; in_phase_mps2:float;
    jumps:float; kept_mps:npt.NDArray[Any]; known_gain:float; last:npt.NDArray[Any]; law_mps:npt.NDArray[Any];
    learnt:npt.NDArray[Any]; least_mps:npt.NDArray[Any]; level:int; limit:int; listened:int; longest_m:float;
    loop_delay_steps:int; low_s:float; memory_s:float; missing_blocks:int; mode:int; mode_s:float; most_drive_mps:float;
    most_mps:npt.NDArray[Any]; moved_s:float; moving:int; needed_to_mps:float; needless_from_mps:float;
    noise:npt.NDArray[Any]; noise_mps:float; off:npt.NDArray[Any]; off_left_s:float; offset_m:float; outside:int;
    peak_N:float; phase_rad:float; pushed:npt.NDArray[Any]; quadrature_mps2:float; rate:npt.NDArray[Any]; ratio:float;
    ratio_now:float; relaxed_m:float; repeats:npt.NDArray[Any]; resolution:npt.NDArray[Any]; resonates:int;
    rising_mps:float; run:int; scatter:npt.NDArray[Any]; shortest_m:float; shown:float; shown_c:float;
    shown_square:float; shown_windows:float; sigma:npt.NDArray[Any]; silent_s:float; since_stick_s:float;
    slide_accel_unread:int; sliding_mps:float; slip_began:int; slipped_s:float; slipping:int; slips:int;
    slope:npt.NDArray[Any]; slope_before:npt.NDArray[Any]; steady_mps:float; steady_s:float; stepped:int; steps:int;
    stick_began:int; stiffness_learnt:int; stood_s:float; stopped:int; stretched:int; surges:int; swing:float;
    time_to_slip_s:float; top:float; tried_mps:float; tried_s:float; trip:int; unexplained:int; unseen_s:float;
    untried_s:float; usual:npt.NDArray[Any]; vibration_velocity_mps:float; waiting_s:float; wanted_m:float;
    wanted_speed_mps:float; wanted_velocity_mps:float; weak_s:float; why:int; window_s:float

class GuardParams:
    abort:npt.NDArray[Any]; absent:npt.NDArray[Any]; alarm:npt.NDArray[Any]; announced_keep:float;
    band_Hz:npt.NDArray[Any]; bands:int; block_s:float; check_m:float; duty_share:float; exciter_gain:float;
    frequency_max_Hz:float; frequency_min_Hz:float; gain_change:float; heat_per_Hz_m2:float; heat_share:float;
    hold_blocks:npt.NDArray[Any]; lost_blocks:int; loud_share:float; memory_keep:float; run:int; sample_s:float;
    slew_m_per_block:float; timeout_blocks:int; tone_Hz:npt.NDArray[Any]; tones:int; window_blocks:int

class GuardMemory:
    accepted:npt.NDArray[Any]; amplitude_m:float; announced_mps:float; block:int; cause:int; check_blocks:int;
    drive_m:npt.NDArray[Any]; drive_mps:float; duty:float; enable:int; fastest_mps:float; frequency_Hz:float; fresh:int;
    frozen_channel:int; gain:npt.NDArray[Any]; heard:int; heat:float; highest:npt.NDArray[Any]; last_sequence:int;
    limit:int; lost_blocks:int; loud_blocks:int; lowest:npt.NDArray[Any]; newest_mps:float;
    over_blocks:npt.NDArray[Any]; quiet_mps2:float; ratio_blocks:int; refused:int; seen_blocks:int;
    slide_m:npt.NDArray[Any]; square_mps2:float; state:int; toggle:int; tone_mps2:float; verified:int;
    vibration_mps:float

class DeviceMemory:
    at_end:npt.NDArray[Any]; command_block:int; commanded_Hz:float; commanded_m:float; highest:npt.NDArray[Any];
    lowest:npt.NDArray[Any]; offset:npt.NDArray[Any]; range_high:npt.NDArray[Any]; range_low:npt.NDArray[Any];
    scale:npt.NDArray[Any]; source:npt.NDArray[Any]; step:npt.NDArray[Any]

class PlantParams:
    F_c:float; F_s:float; accel_bandwidth_Hz:float; accel_highpass_keep:float; accel_highpass_keep_stick:float;
    accel_keep:float; accel_keep_stick:float; accel_lowest_Hz:float; accel_noise_mps2:float; accel_range_mps2:float;
    accel_resolution_mps2:float; age_exponent:float; age_growth_N:float; age_length_m:float; age_rested_N:float;
    age_scale_s:float; age_settling_s:float; always_on:float; amplitude_max_m:float; amplitude_slew_m_per_s:float;
    backward_ratio:float; base_Hz:float; base_accel_ratio:float; base_damping_ratio:float; base_m_per_N:float;
    block_ns:int; command_timeout_s:float; delivered_ratio:float; disturbed:int; drift_before_s:float;
    drift_rate_per_s:float; drift_ratio:float; drift_settling_s:float; dt_s:float; elastic_ratio:float;
    elasto_plastic:int; force_bandwidth_Hz:float; force_bias_N:float; force_delay_s:float; force_drift_N:float;
    force_driven:int; force_gain:float; force_keep:float; force_keep_stick:float; force_lag_order:float;
    force_lag_s:float; force_lowest_N:float; force_noise_N:float; force_range_N:float; force_rate_N_per_s:float;
    force_ratio:float; force_resolution_N:float; force_settling_s:float; forward_ratio:float; frame_Hz:float;
    frame_damping_ratio:float; frame_m_per_N:float; frequency_max_Hz:float; frequency_min_Hz:float; gap_m:float;
    h_d:float; h_t:float; h_v:float; hardening_per_m2:float; k_d:float; k_t:float; kinetic_backward_ratio:float;
    knee_m:float; knee_ratio:float; lag_dead_s:float; lag_distance_m:float; lag_s:float; late_share:float;
    load_frequency_Hz:float; load_phase_rad:float; load_ratio:float; load_second_cos:float; load_second_sin:float;
    load_seed:float; m:float; mass_accel_ratio:float; mode_ratio:float; mount_damping_ratio:float;
    mount_resonance_Hz:float; position_bandwidth_Hz:float; position_keep:float; position_keep_stick:float;
    position_linearity:float; position_lowest_m:float; position_noise_m:float; position_other_phase_rad:float;
    position_other_share:float; position_other_wavelength_m:float; position_phase_rad:float; position_range_m:float;
    position_ratio:float; position_resolution_m:float; position_second_cos:float; position_second_sin:float;
    position_seed:float; position_wavelength_m:float; position_width:float; quadratic_Ns2_per_m2:float;
    relaxation_s:float; relaxing_Ns_per_m:float; ripple_frequency_Hz:float; ripple_per_N:float; ripple_phase_rad:float;
    ripple_ratio:float; ripple_second_cos:float; ripple_second_sin:float; ripple_wavelength_m:float; rolloff_Hz:float;
    rolloff_order:float; roughness_length_m:float; roughness_ratio:float; roughness_seed:float; sag_ratio:float;
    sag_settling_s:float; samples_per_block:int; steps_per_sample:int; steps_per_stick_sample:int; stick_dt_s:float;
    stribeck_tail:float; v_s:float

class PlantMemory:
    age_s:float; amplitude_m:float; arm_N:float; base_accel_f:float; base_accel_slow_f:float; base_m:float;
    base_mps:float; block:int; command_block:int; commanded_Hz:float; commanded_m:float; delay_at:int;
    delay_line:npt.NDArray[Any]; drive_N:float; drive_position_f:float; dt_s:float; even_m:float; force_f:float;
    force_lag:npt.NDArray[Any]; frame_m:float; frame_mps:float; frequency_Hz:float; g:float; lag_at:int;
    lag_line:npt.NDArray[Any]; line_Hz:npt.NDArray[Any]; line_block:npt.NDArray[Any]; line_count:int;
    line_due:npt.NDArray[Any]; line_first:int; line_m:npt.NDArray[Any]; mass_accel_f:float; mass_accel_slow_f:float;
    mass_position_f:float; phi:float; s_d:float; sticks:int; t_s:float; v:float; v_lag:float; v_r:float;
    vibrating_s:float; x:float; z:float

class SensorRow:
    applied_Hz:float; applied_block:int; applied_m:float; base_accel_mps2:npt.NDArray[Any]; check_Hz:float;
    check_gain:float; checksum:int; drive_force_N:npt.NDArray[Any]; drive_position_m:npt.NDArray[Any]; fallback:int;
    guard_limit:int; guard_state:int; mass_accel_mps2:npt.NDArray[Any]; mass_position_m:npt.NDArray[Any]; run:int;
    sequence:int; t_ns:int

class AppliedRow:
    amplitude_m:float; answer_ns:int; cause:int; command_block:int; commands:int; commands_late:int;
    commands_refused:int; fallback:int; frequency_Hz:float; guard_limit:int; guard_state:int; heat_share:float;
    late_ns:int; round_trip_ns:int; sample_rate_Hz:float; sequence:int; t_ns:int; toggle:int

class CommandRow:
    amplitude_m:float; block:int; frequency_Hz:float; limit:int; mode:int; reason:int; run:int; sequence:int; t_ns:int

class TraceRow:
    announcements:int; block:int; breakaway_force_N:float; burst_mps2:float; drive_force_N:float;
    drive_stiffness_N_per_m:float; drive_stiffness_sigma:float; drive_velocity_mps:float; events:int;
    exciter_gain:float; force_rate:float; gap_blocks:int; lateness_ns:int; limit:int; loop_delay_s:float; mode:int;
    reason:int; score:float; sequence:int; sliding_force_N:float; sliding_velocity_mps:float; slips:int; state:int;
    surges:int; t_ns:int; time_to_slip_s:float; velocity_ratio:float; vibration_velocity_mps:float;
    wanted_amplitude_m:float; wanted_frequency_Hz:float; wanted_velocity_mps:float; window_s:float

class AnnounceRow:
    drive_velocity_mps:float; holds_from_ns:int; sequence:int; t_ns:int
