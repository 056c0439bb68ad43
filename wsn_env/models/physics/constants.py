"""A scenario as kernels see it: one record of plain numbers in SI units."""

import math
from statistics import NormalDist

import numpy as np

from wsn_env.models.sections import RECEIVERS, Beacon, Binary, Detection, Level, Measurement, Position, Threshold
from wsn_env.scenario import Scenario

SHARPEST = 1e-6  # m^(2/3): an edge without width would divide by it

CONSTANTS = np.dtype(
    [
        ("period_s", "f8"),
        ("side_m", "f8"),
        ("depth_m", "f8"),
        # detection: 0 eqs. 2-3, 1 a threshold on the measured level
        ("detection", "i8"),
        ("radius_m", "f8"),
        ("reach_m", "f8"),
        ("inner_m", "f8"),
        ("decay", "f8"),
        ("ceiling", "f8"),
        ("decay_power", "f8"),
        ("edge_power", "f8"),
        ("edge_root", "f8"),  # eqs. 2-3 as a normal distribution in the cube root of the squared distance
        ("edge_width", "f8"),
        ("threshold_db", "f8"),
        # measurement: 0 position, 1 strength in dB, 2 power, 3 the same as 1 with absorption, 4 one bit, 5 beacon
        ("model", "i8"),
        ("level", "f8"),
        ("slope", "f8"),
        ("absorption", "f8"),  # dB/m
        ("noise", "f8"),
        ("floor_m", "f8"),
        # binary sensors
        ("flip", "f8"),
        ("edge_m", "f8"),
        ("every_presence", "i8"),
        ("refresh", "i8"),
        ("ring_m", "f8"),
        # a beacon: what the tracker takes its levels for
        ("bias_variance", "f8"),
        ("bias_kept", "f8"),  # of a bias from period to period
        ("white_variance", "f8"),  # of one packet
        ("temper", "f8"),
        ("heard", "f8"),  # probability that a listening receiver hears any packet in a period
        ("report_packets", "f8"),  # how many they are then, on average; 1 of all other sensors
        # radio, eq. 5, or modem
        ("tx_j_per_bit", "f8"),
        ("amplifier_j_per_bit_m2", "f8"),
        ("rx_j_per_bit", "f8"),
        ("report_bits", "f8"),
        ("invitation_bits", "f8"),
        ("handover_bits", "f8"),
        ("wakeup_bits", "f8"),
        ("broadcast_bits", "f8"),
        ("packet_success", "f8"),
        ("tries", "i8"),
        ("delivery", "f8"),
        ("head_delivery", "f8"),
        ("receiver", "i8"),  # its place in RECEIVERS
        ("awake_j", "f8"),  # a node's period, packets apart
        ("asleep_j", "f8"),
        ("hop_m", "f8"),
        # tracking
        ("q", "f8"),
        ("walks", "i8"),
        ("velocity_kept", "f8"),  # of a walker's, from period to period
        ("velocity_sd", "f8"),
        ("gate_m", "f8"),  # inf: none
        ("pooled", "i8"),
        ("silent_information", "i8"),
        ("resample_below", "f8"),
        ("spread_scale", "f8"),  # 0: systematic resampling alone
        ("redraw", "i8"),
        ("search", "i8"),
        ("log_search_miss", "f8"),
        ("search_gap", "i8"),
    ]
)


def constants(scenario: Scenario) -> np.ndarray:
    """The record of a scenario, an array of one."""
    r, t = scenario.radio, scenario.tracking
    record = sensing_constants(scenario.detection, scenario.measurement)
    walks = t.velocity_s is not None
    values = dict(
        period_s=scenario.period_s,
        side_m=scenario.field.room_m[0],
        depth_m=scenario.field.room_m[1],
        ring_m=scenario.ring_m,
        tx_j_per_bit=r.tx_j_per_bit,
        amplifier_j_per_bit_m2=r.amplifier_j_per_bit_m2,
        rx_j_per_bit=r.rx_j_per_bit,
        report_bits=r.report_bits,
        invitation_bits=r.invitation_bits,
        handover_bits=scenario.handover_bits,
        wakeup_bits=r.wakeup_bits,
        broadcast_bits=r.broadcast_bits,
        packet_success=r.packet_success,
        tries=1 + r.retries,
        delivery=r.delivery,
        head_delivery=r.head_delivery,
        receiver=RECEIVERS.index(r.receiver),
        awake_j=r.awake_j(scenario.period_s),
        asleep_j=r.asleep_j(scenario.period_s),
        hop_m=r.hop_m,
        q=scenario.filter_q,
        walks=walks,
        velocity_kept=math.exp(-scenario.period_s / t.velocity_s) if walks else 1.0,
        velocity_sd=t.rest_sd_ms,
        report_packets=1.0,
        gate_m=math.inf if t.gate_m is None else t.gate_m,
        pooled=t.fusion == "pooled",
        silent_information=t.silent_information,
        resample_below=t.resample_below,
        spread_scale=t.spread_scale if t.resampling == "spread" else 0.0,
        redraw=t.redraw_on_handover,
        search=t.search,
        log_search_miss=math.log(t.search_miss),
        search_gap=t.search_gap,
    )
    if scenario.hears:
        m = scenario.measurement
        values |= dict(bias_variance=m.bias_db**2, bias_kept=math.exp(-scenario.period_s / m.bias_s))
        values |= dict(white_variance=m.white_db**2, temper=m.temper)
        heard = m.heard(scenario.period_s)
        values |= dict(heard=heard, report_packets=m.packets(scenario.period_s) / heard)
    for name, value in values.items():
        record[name] = value
    return record


def sensing_constants(detection: Detection | Threshold, measurement: Measurement) -> np.ndarray:
    """The part of the record that says what nodes sense, an array of one; zero elsewhere.

    A strength model is `level - slope ln(max(d, floor)^2) - absorption max(d, floor)` in dB, or
    `level exp(-slope ln(max(d, floor)^2))` in power.
    """
    d, m = detection, measurement
    radius, reach = d.distances_m(m)
    values = dict(detection=d.code, radius_m=radius, reach_m=reach, model=m.code)
    if isinstance(d, Threshold):
        values |= dict(threshold_db=d.threshold_db)
    else:
        values |= dict(inner_m=(1 - d.softness) * radius, decay=d.decay, ceiling=d.ceiling)
        values |= dict(decay_power=d.decay_power, edge_power=d.edge_power)
        near, far = (d.distance_m(NormalDist().cdf(sds)) ** (2 / 3) for sds in (1, -1))
        values |= dict(edge_root=(near + far) / 2, edge_width=max((far - near) / 2, SHARPEST))
    if isinstance(m, Position):
        values |= dict(noise=m.noise_m)
    elif isinstance(m, Level):
        values |= dict(level=m.at_1m_db, slope=5 * m.exponent / math.log(10), absorption=m.absorption_db_per_m)
        values |= dict(noise=m.noise_db, floor_m=m.floor_m)
    elif isinstance(m, Binary):
        values |= dict(flip=m.flip, edge_m=m.edge_m, refresh=m.refresh)
        values |= dict(every_presence=m.reports == "presence")
    elif isinstance(m, Beacon):
        values |= dict(floor_m=m.floor_m)
    else:
        values |= dict(level=m.amplitude, slope=m.exponent / 2, noise=m.noise, floor_m=m.floor_m)
    record = np.zeros(1, CONSTANTS)
    for name, value in values.items():
        record[name] = value
    return record
