"""Every quantity of a scenario, of its sections and of the shipped kinds, by name: what `Scenario.override` takes.

For editors and type checkers; a new quantity is entered here, too: tests/test_types.py compares it with the classes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal, TypedDict

from wsn_env.models.association.base import Association
from wsn_env.models.detection.base import DetectionRule
from wsn_env.models.fault.base import Fault
from wsn_env.models.field import Field
from wsn_env.models.measurement.base import Measurement
from wsn_env.models.motion.base import Motion
from wsn_env.models.radio.base import Link
from wsn_env.scenario.tracking import Tracking


class Quantities(TypedDict, total=False):
    """Overrides by keyword. Those of a kind of one's own are not in it; `measurement=MyKind(...)` is."""

    calibration: str | Path  # a file of `wsn calibrate`, for all quantities in it
    # the scenario's own, and its sections: whole or, of several kinds, by name
    name: str
    periods: int
    period_s: float
    lam: float | tuple[float, float]
    typical_error_m: float
    typical_energy_mj: float
    error_cap_m: float | None
    scarce_energy: bool
    tells_others: bool
    unscored: int
    targets: int
    ends_outside: bool
    reference_error_m: float
    reference_energy_mj: float
    field: Field
    motion: Motion | str
    detection: DetectionRule | str
    measurement: Measurement | str
    radio: Link | str
    association: Association | str
    tracking: Tracking
    faults: tuple[Fault, ...] | list[Fault | str] | Fault | str | None
    # the field
    nodes: int
    side_m: float
    depth_m: float | None
    layout: Literal["uniform", "grid"]
    jitter: float
    field_seed: int | None
    positions: tuple[tuple[float, float], ...] | None
    # motions
    circle_m: float
    turn_s: float
    margin_m: float
    crossing_m: float
    acceleration_ms2: float
    miss_m: float
    speed_ms: float
    inset_m: float
    spread_m: float
    start_m: tuple[float, float]
    legs: tuple[tuple[float, float, float], ...]
    tracks: tuple[str, ...]
    span_m: float | None
    recording: str
    amplitude_m: float
    from_m: float
    velocity_ms: float
    turn_probability: float
    slowest_ms: float
    fastest_ms: float
    # detection rules
    radius_m: float
    softness: float
    decay: float
    ceiling: float
    decay_power: float
    edge_power: float
    threshold_db: float
    radius_spread: float
    radii_known: bool
    # measurements
    at_1m_db: float | tuple[float, ...]
    exponents: float | tuple[float, ...]
    heights_m: float | tuple[float, ...]
    beacon_m: float
    floor_m: float
    field_db: float
    field_m: float
    drift_db: float
    drift_s: float
    main_db: float
    main_sd_db: float
    fade_share: float
    fade_db: float
    fade_sd_db: float
    loss: float
    loss_after_loss: float
    interval_s: float
    bias_s: float
    temper: float
    residual_map: str | None
    reports: Literal["changes", "presence"]
    refresh: int
    flip: float
    edge_m: float
    noise_m: float
    reference_dbm: float
    exponent: float
    noise_db: float
    amplitude: float
    noise: float
    source_db: float
    spreading: float
    frequency_khz: float
    # radios
    report_bits: int
    invitation_bits: int
    handover_bits: int
    wakeup_bits: int
    broadcast_bits: int
    handover: Literal["estimate", "particles"]
    packet_success: float
    retries: int
    receiver: Literal["head", "sink", "target"]
    battery_j: float | tuple[float, float]
    transmit_w: float
    listen_w: float
    bit_rate: float
    hop_m: float
    receive_w: float
    sleep_w: float
    sound_ms: float
    tx_nj_per_bit: float
    amplifier_pj_per_bit_m2: float
    rx_nj_per_bit: float
    sensing_nj: float
    # associations
    clutter: float
    resolution_m: float
    association_sds: float
    # tracking
    tracker: str
    particles: int
    fusion: Literal["joint", "pooled"]
    silent_information: bool
    gate_sds: float | None
    outlier_share: float
    node_sd_m: float
    resample_below: float
    resampling: Literal["systematic", "spread", "common_spread"]
    spread_scale: float
    redraw_on_handover: bool
    filter_q: float | None
    manoeuvre_q: float | None
    velocity_s: float | None
    gate_m: float | None
    start: Literal["known", "search", "field", "fix"]
    start_sd_m: float
    start_sd_ms: float
    rest_sd_ms: float
    search: bool
    search_miss: float
    search_gap: int
    width_search: Literal["golden", "foa"]
    training_seed: int
    # faults
    share: float
    region_m: float
    bias_m: float
    position_sd_m: float
    probability: float
    to_bad: float
    to_good: float
    bad_success: float
    stops: int
    stop_s: float
    outside_m: float
