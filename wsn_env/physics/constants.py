"""A scenario as kernels see it: one record of plain numbers in SI units."""

import math

import numpy as np

from wsn_env.scenario import Scenario
from wsn_env.sections import Binary, Position, Rssi

RECEIVERS = ("head", "sink", "target")

CONSTANTS = np.dtype(
    [
        ("period_s", "f8"),
        ("side_m", "f8"),
        # detection, eqs. 2-3
        ("radius_m", "f8"),
        ("inner_m", "f8"),
        ("reach_m", "f8"),
        ("decay", "f8"),
        ("ceiling", "f8"),
        ("decay_power", "f8"),
        ("edge_power", "f8"),
        # measurement: 0 position, 1 strength in dB, 2 power, 4 one bit
        ("model", "i8"),
        ("level", "f8"),
        ("slope", "f8"),
        ("noise", "f8"),
        ("floor_m", "f8"),
        # binary sensors
        ("flip", "f8"),
        ("edge_m", "f8"),
        ("every_presence", "i8"),
        ("refresh", "i8"),
        ("ring_m", "f8"),
        # radio, eq. 5
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
        ("receiver", "i8"),  # its place in RECEIVERS
        ("sensing_j", "f8"),
        # tracking
        ("q", "f8"),
        ("gate_m", "f8"),  # inf: none
        ("pooled", "i8"),
        ("silent_information", "i8"),
        ("resample_below", "f8"),
        ("search", "i8"),
        ("log_search_miss", "f8"),
        ("search_gap", "i8"),
    ]
)


def constants(scenario: Scenario) -> np.ndarray:
    """The record of a scenario, an array of one.

    A strength model is `level - slope ln(max(d, floor)^2)` in dB, or `level exp(-slope ln(max(d, floor)^2))` in power.
    """
    d, m, r, t = scenario.detection, scenario.measurement, scenario.radio, scenario.tracking
    bit = m if isinstance(m, Binary) else Binary()
    if isinstance(m, Position):
        level, slope, noise, floor = 0.0, 0.0, m.noise_m, 0.0
    elif isinstance(m, Rssi):
        level, slope, noise, floor = m.reference_dbm, 5 * m.exponent / math.log(10), m.noise_db, m.floor_m
    elif isinstance(m, Binary):
        level, slope, noise, floor = 0.0, 0.0, m.edge_m, 0.0
    else:
        level, slope, noise, floor = m.amplitude, m.exponent / 2, m.noise, m.floor_m
    record = np.zeros(1, CONSTANTS)
    values = dict(
        period_s=scenario.period_s,
        side_m=scenario.field.side_m,
        radius_m=d.radius_m,
        inner_m=(1 - d.softness) * d.radius_m,
        reach_m=d.reach_m,
        decay=d.decay,
        ceiling=d.ceiling,
        decay_power=d.decay_power,
        edge_power=d.edge_power,
        model=m.code,
        level=level,
        slope=slope,
        noise=noise,
        floor_m=floor,
        flip=bit.flip if scenario.binary else 0.0,
        edge_m=bit.edge_m,
        every_presence=bit.reports == "presence",
        refresh=bit.refresh,
        ring_m=scenario.ring_m,
        tx_j_per_bit=1e-9 * r.tx_nj_per_bit,
        amplifier_j_per_bit_m2=1e-12 * r.amplifier_pj_per_bit_m2,
        rx_j_per_bit=1e-9 * r.rx_nj_per_bit,
        report_bits=r.report_bits,
        invitation_bits=r.invitation_bits,
        handover_bits=scenario.handover_bits,
        wakeup_bits=r.wakeup_bits,
        broadcast_bits=r.broadcast_bits,
        packet_success=r.packet_success,
        tries=1 + r.retries,
        delivery=r.delivery,
        receiver=RECEIVERS.index(r.receiver),
        sensing_j=1e-9 * r.sensing_nj,
        q=scenario.filter_q,
        gate_m=math.inf if t.gate_m is None else t.gate_m,
        pooled=t.fusion == "pooled",
        silent_information=t.silent_information,
        resample_below=t.resample_below,
        search=t.search,
        log_search_miss=math.log(t.search_miss),
        search_gap=t.search_gap,
    )
    for name in CONSTANTS.names:
        record[name] = values[name]
    return record
