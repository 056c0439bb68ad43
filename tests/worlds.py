"""Random scenarios, choices and play for the property tests."""

import numpy as np
from hypothesis import strategies as st

from wsn_env import Cluster, Scenario, World
from wsn_env.scenario import READS
from wsn_env.sections import BOUNDARY_TRACKERS, MEASUREMENTS

TRACKERS = ("particle", "particle", "particle", "ekf", "ukf", "ickf", "snapshot", *BOUNDARY_TRACKERS)
MOTIONS = ["crossing", "straight", "sine", "circle", "turns", "waypoint"]
KEYS = st.integers(0, 2**64 - 1)


@st.composite
def scenarios(draw, trackers=TRACKERS, **fixed):
    """Small scenarios of every kind: lossy, short of energy, lost from the start, without any noise in the filter."""
    readable = {name: [t for t in trackers if kind in READS[t]] for name, kind in MEASUREMENTS.items()}
    measurement = fixed.get("measurement", draw(st.sampled_from([name for name in MEASUREMENTS if readable[name]])))
    tracker = fixed.get("tracker", draw(st.sampled_from(readable[measurement])))
    overrides = draw(binary_sensors(tracker)) if measurement == "binary" else {}
    overrides |= dict(
        nodes=draw(st.integers(1, 60)),
        side_m=draw(st.sampled_from([60.0, 100.0, 140.0])),
        periods=draw(st.integers(3, 25)),
        lam=draw(st.sampled_from([4.0, 0, (0.3, 30)])),
        motion=draw(st.sampled_from(MOTIONS)),
        measurement=measurement,
        radius_m=draw(st.sampled_from([3.0, 10.0, 40.0])),
        ceiling=draw(st.sampled_from([0.6, 1.0])),
        packet_success=draw(st.sampled_from([1.0, 0.9, 0.3, 0.0])),
        retries=draw(st.integers(0, 4)),
        sensing_nj=draw(st.sampled_from([0.0, 1500.0])),
        battery_j=draw(st.sampled_from([1.0, 1e-3, 2e-4, 5e-5, 1e-6])),
        handover=draw(st.sampled_from(["estimate", "estimate", "particles"])),
        receiver=draw(st.sampled_from(["head", "head", "sink", "target"])),
        tracker=tracker,
        gate_m=draw(st.sampled_from([None, None, 2.0, 20.0])),
        particles=draw(st.sampled_from([2, 3, 16, 17, 50, 300])),
        fusion=draw(st.sampled_from(["joint", "pooled"])),
        silent_information=draw(st.sampled_from([False, False, True])),
        resample_below=draw(st.sampled_from([2 / 3, 2 / 3, 0, 1])),
        filter_q=draw(st.sampled_from([None, 0, 0.5])),
        start=draw(st.sampled_from(["known", "known", "search", "field", "fix"])),
        start_sd_m=draw(st.sampled_from([1.0, 1e-6, 12.0])),
        search=draw(st.sampled_from([True, True, False])),
        search_gap=draw(st.integers(1, 6)),
    )
    overrides |= fixed
    overrides["silent_information"] &= tracker == "particle" and measurement != "binary"
    return Scenario.named("PreDC-v0", **overrides)


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


def choices(seed, period, rows, nodes):
    """Random clusters (rows,), (rows, M): sensible, empty, and with entries that are repeated or out of range."""
    rng = np.random.default_rng([seed, period])
    width = int(rng.choice([0, 1, 3, nodes + 2]))
    wild = rng.random() < 0.3
    low, high = (-3, nodes + 3) if wild else (-1, nodes)
    return Cluster(rng.integers(low, high, rows), rng.integers(low, high, (rows, width)))


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
    """(name, array) of all arrays in nested NamedTuples and dicts; the fields of structured ones apart."""
    if isinstance(value, tuple):
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


def living_entries(state):
    """A copy whose arrays hold zeros beyond their valid entries (what lies there is nobody's business)."""
    state = state.copy()
    slots = np.arange(state.network.battery.shape[1])
    state.network.members[slots >= state.network.n_members[:, None]] = 0
    stale = slots >= state.reports.count[:, None]
    state.reports.node[stale] = 0
    state.reports.value[stale] = 0
    state.ledger.payer[slots >= state.ledger.count[:, None]] = 0
    return state
