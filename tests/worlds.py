"""Random scenarios, choices and play for the property tests."""

from math import isqrt

import numpy as np
from hypothesis import strategies as st

from wsn_env import Cluster, Scenario, View, World
from wsn_env.compiled.arrays import Arrays
from wsn_env.envs.expectations import REPORTS, Expectations
from wsn_env.envs.merit import PositionCov, gain
from wsn_env.models.library import FAULTS, MEASUREMENTS
from wsn_env.models.state import Grid, Knowledge
from wsn_env.scenario.tracking import BOUNDARY_TRACKERS, reads

TRACKERS = ("particle", "particle", "particle", "ekf", "ukf", "ickf", "snapshot", *BOUNDARY_TRACKERS)
MOTIONS = ["crossing", "straight", "sine", "circle", "turns", "waypoint"]
OF_SENSING = {name for name, kind in FAULTS.kinds.items() if kind.of_sensing}
MODEM_J = 5000.0  # a modem's packets cost so many times a radio's
SOURCE_DB = 120.0
KEYS = st.integers(0, 2**64 - 1)
HAND_WRITTEN = "all boundary centroid nearest0 nearest3 pre_dc random static_cluster strongest_signal".split()
HAND_WRITTEN += "adaptive adaptive_informed greedy informed2".split()


@st.composite
def scenarios(draw, trackers=TRACKERS, modem_hops_m=(30.0, 70.0, 250.0), no_faults=(), **fixed):
    """Small scenarios of every kind: lossy, short of energy, lost from the start, without any noise in the filter.

    Half of them have faults, but for some (`no_faults`).

    All with sonars and some others have modems, with batteries (given ones, too) MODEM_J times as large.
    """
    readable = {name: [t for t in trackers if reads(t, kind())] for name, kind in MEASUREMENTS.kinds.items()}
    measurement = fixed.get("measurement", draw(st.sampled_from([name for name in readable if readable[name]])))
    tracker = fixed.get("tracker", draw(st.sampled_from(readable[measurement])))
    overrides = dict(
        nodes=draw(st.integers(1, 60)),
        side_m=draw(st.sampled_from([60.0, 100.0, 140.0])),
        periods=draw(st.integers(3, 25)),
        lam=draw(st.sampled_from([4.0, 0, (0.3, 30)])),
        motion=draw(st.sampled_from(MOTIONS)),
        measurement=measurement,
        packet_success=draw(st.sampled_from([1.0, 0.9, 0.3, 0.0])),
        retries=draw(st.integers(0, 4)),
        battery_j=draw(st.sampled_from([1.0, 1e-3, (5e-5, 2e-3), 2e-4, 5e-5, 1e-6])),
        error_cap_m=draw(st.sampled_from([None, 20.0])),
        scarce_energy=draw(st.booleans()),
        handover=draw(st.sampled_from(["estimate", "estimate", "particles"])),
        receiver=draw(st.sampled_from(["head", "head", "sink", "target"])),
        tracker=tracker,
        particles=draw(st.sampled_from([2, 3, 16, 17, 50, 300])),
        fusion=draw(st.sampled_from(["joint", "pooled"])),
        resample_below=draw(st.sampled_from([2 / 3, 2 / 3, 0, 1])),
        filter_q=draw(st.sampled_from([None, 0, 0.5])),
        start=draw(st.sampled_from(["known", "known", "search", "field", "fix"])),
        start_sd_m=draw(st.sampled_from([1.0, 1e-6, 12.0])),
        search=draw(st.sampled_from([True, True, False])),
        search_gap=draw(st.integers(1, 6)),
    )
    # Each three kinds that meet are compiled apart, so not all of them do.
    if measurement == "sonar" and "radius_m" not in fixed:
        overrides |= draw(threshold(SOURCE_DB))
    else:
        overrides |= dict(radius_m=draw(st.sampled_from([3.0, 10.0, 40.0])), ceiling=draw(st.sampled_from([0.6, 1.0])))
    if measurement == "binary":
        overrides |= draw(binary_sensors(tracker))
    if tracker == "particle":
        overrides |= draw(cloud(measurement))
    if measurement == "beacon":
        overrides |= draw(beacon(overrides["nodes"]))
    if tracker in BOUNDARY_TRACKERS:
        overrides["gate_m"] = draw(st.sampled_from([None, None, 2.0, 20.0]))
    if draw(st.booleans()):
        overrides |= dict(layout="grid", nodes=isqrt(overrides["nodes"]) ** 2, jitter=draw(st.sampled_from([0.25, 0])))
    if overrides.get("gate_sds") is not None:
        overrides |= dict(fusion="joint", silent_information=False)
    faults = sorted(FAULTS.kinds.keys() - set(no_faults) - (OF_SENSING if measurement == "beacon" else set()))
    overrides["faults"] = draw(st.one_of(st.just([]), st.lists(st.sampled_from(faults), max_size=3)))
    if isinstance(overrides.get("at_1m_db"), tuple):
        overrides["at_1m_db"] = overrides["at_1m_db"][: overrides["nodes"]]
    overrides |= fixed
    if measurement == "sonar" or (measurement == "position" and draw(st.booleans())):
        overrides |= dict(radio="modem", hop_m=draw(st.sampled_from(modem_hops_m)), receiver="head")
        overrides["battery_j"] = np.multiply(overrides["battery_j"], MODEM_J).tolist()
    else:
        overrides["sensing_nj"] = draw(st.sampled_from([0.0, 1500.0]))
    return Scenario.named("PreDC-v0", **overrides)


@st.composite
def threshold(draw, at_1m_db):
    """Detection by a threshold on a level in dB, at a mean level that is reached at 3 to 40 m."""
    return dict(
        detection="threshold",
        threshold_db=at_1m_db - draw(st.sampled_from([7.0, 20.0, 30.0])),
        noise_db=draw(st.sampled_from([3.0, 0.5])),
    )


@st.composite
def binary_sensors(draw, tracker):
    """What binary sensors have of their own; those that tell of their presence serve no tracker of the boundary."""
    modes = ["changes"] if tracker.startswith("boundary") else ["changes", "presence"]
    return dict(
        reports=draw(st.sampled_from(modes)),
        refresh=draw(st.sampled_from([0, 0, 1, 3])),
        flip=draw(st.sampled_from([0.0, 0.01, 0.4])),
        edge_m=draw(st.sampled_from([1.0, 0.01, 20.0])),
    )


@st.composite
def beacon(draw, nodes):
    """A beacon's receivers, alike or each its own, and a filter that walks or not."""
    own = tuple(-50.0 - i % 20 for i in range(nodes))
    return dict(
        at_1m_db=draw(st.sampled_from([-60.0, own])),
        heights_m=draw(st.sampled_from([0.0, 2.3])),
        field_db=draw(st.sampled_from([2.24, 0.0])),
        loss=draw(st.sampled_from([0.146, 0.0, 0.7])),
        loss_after_loss=draw(st.sampled_from([0.8, 0.6])),
        interval_s=draw(st.sampled_from([0.4525, 1.7])),
        temper=draw(st.sampled_from([1.0, 0.3])),
        velocity_s=draw(st.sampled_from([None, 5.0])),
        motion=draw(st.sampled_from(["waypoint", "walk", "straight"])),
        fusion="joint",
        silent_information=False,
        search=False,
    )


@st.composite
def cloud(draw, measurement):
    """What the particle filter alone has; a bitmap tells of silence anyhow."""
    robust = dict(
        gate_sds=draw(st.sampled_from([None, None, 3.0])),
        outlier_share=draw(st.sampled_from([0.0, 0.0, 0.1])),
        node_sd_m=draw(st.sampled_from([0.0, 0.0, 2.0])),
    )
    modes = dict(manoeuvre_q=draw(st.sampled_from([None, None, 0.7])))
    return (
        (robust if MEASUREMENTS.kinds[measurement]().independent else {})
        | modes
        | dict(
            silent_information=measurement != "binary" and draw(st.sampled_from([False, False, True])),
            resampling=draw(st.sampled_from(["systematic", "spread", "common_spread"])),
            spread_scale=draw(st.sampled_from([0.5, 0.0, 3.0])),
            redraw_on_handover=draw(st.sampled_from([False, False, True])),
        )
    )


def choices(seed, period, rows, nodes):
    """Random clusters (rows,), (rows, M): sensible, empty, and with entries that are repeated or out of range."""
    rng = np.random.default_rng([seed, period])
    width = int(rng.choice([0, 1, 3, nodes + 2]))
    wild = rng.random() < 0.3
    low, high = (-3, nodes + 3) if wild else (-1, nodes)
    return Cluster(rng.integers(low, high, rows), rng.integers(low, high, (rows, width)))


def expected(scenario, positions, mean, cov, receivers=None):
    """(S,) EXPECTED of nodes at positions (S, 2), under a belief about the period to come.

    Args:
        receivers: (S,) RECEIVER, what has been learnt of them, where errors last.
    """
    nodes, side = len(positions), Grid.side(len(positions))
    axes = {"rows": 1, "nodes": nodes, "cells": side * side + 1} | scenario.measurement.axes(nodes)
    known = Knowledge.zeros(**axes)
    known.network.row["head"] = -1
    known.network.positions[0] = positions
    known.belief["predicted_mean"], known.belief["predicted_cov"] = mean, cov
    if receivers is not None:
        known.receivers[0] = receivers
    return Expectations(scenario, nodes).of_nodes(View(known), np.arange(nodes)[None], REPORTS).table[0, :nodes]


def expected_gain(node, detection, cov):
    """Drop of the position covariance's trace by a report that comes so likely, and its entries xx, xy, yy after it.

    Args:
        node: EXPECTED.
    """
    sure = node.copy()
    sure["detection"] = detection
    drop, after = gain(sure, 1.0, PositionCov(cov[0, 0], cov[0, 2], cov[2, 2]))
    return drop, *after


def keys_of(seed, rows):
    """Keys of a batch."""
    return np.random.default_rng(seed).integers(2**64, size=rows, dtype=np.uint64)


def play(scenario, keys, seed, threads=1, pick=None, donate=False):
    """Plays an episode with `choices`; yields (state before, choice, state after, outcome) each period.

    Args:
        pick: which rows of the choices the batch's rows take; None: all in order.
    """
    world = World(scenario, threads=threads)
    state = world.reset(keys)
    pick = np.arange(len(keys)) if pick is None else np.asarray(pick)
    for period in range(scenario.periods):
        everyone = choices(seed, period, max(len(keys), pick.max() + 1, 12), scenario.field.nodes)
        cluster = Cluster(everyone.head[pick], everyone.members[pick])
        before = state
        state, outcome = world.step(state, cluster, donate=donate)
        yield before, cluster, state, outcome


def leaves(value, path=""):
    """(name, array) of all arrays in records, nested NamedTuples and dicts; the fields of structured ones apart."""
    if isinstance(value, Arrays):
        for name, part in value.leaves():
            yield from leaves(part, f"{path}.{name}")
    elif isinstance(value, tuple):
        for name, part in zip(value._fields, value, strict=True):
            yield from leaves(part, f"{path}.{name}")
    elif isinstance(value, dict):
        for name, part in value.items():
            yield from leaves(part, f"{path}.{name}")
    elif isinstance(value, np.ndarray) and value.dtype.names:
        for name in value.dtype.names:
            yield f"{path}.{name}", value[name]
    else:
        yield path, np.asarray(value)


def assert_same(left, right, rows=slice(None), other=slice(None)):
    """Both hold the same bits, in the rows named."""
    for (name, a), (_, b) in zip(leaves(left), leaves(right), strict=True):
        a, b = a[rows], b[other]
        assert a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes(), name


def assert_finite(*values):
    """All their numbers are."""
    for value in values:
        for name, array in leaves(value):
            assert np.isfinite(array).all(), name


def living_entries(state):
    """A copy whose arrays hold zeros beyond their valid entries (what lies there is nobody's business)."""
    state = state.copy()
    slots = np.arange(state.network.battery.shape[1])
    state.network.members[slots >= state.network.n_members[:, None]] = 0
    stale = slots >= state.reports.count[:, None]
    state.reports.node[stale] = 0
    state.reports.value[stale] = 0
    state.ledger.charged[slots >= state.ledger.count[:, None]] = 0
    return state
