"""A scenario as kernels see it: one record of plain numbers in SI units, those of each kind in a record of its own."""

from __future__ import annotations

import math
from functools import partial
from weakref import ref

import numpy as np

from wsn_env.compiled.arrays import record
from wsn_env.models.kinds import constants_type, fill_constants
from wsn_env.scenario.scenario import Scenario
from wsn_env.scenario.tracks import CELLS, neighbourhood_m, presence

KINDS = ("measurement", "detection", "radio", "association")
DOUBTS = ("clutter", "resolution_m", "association_sds")  # of associations that name no target; else 0

TRACKING = record(
    [
        ("period_s", "f8"),
        ("side_m", "f8"),
        ("depth_m", "f8"),
        ("radius_m", "f8"),
        ("error_cap_m", "f8"),  # inf: none
        ("q", "f8"),
        ("switches", "i8"),  # 1: the filter's target switches between modes of motion
        ("manoeuvre_q", "f8"),
        ("walks", "i8"),
        ("velocity_kept", "f8"),  # of a walker's, from period to period
        ("velocity_sd", "f8"),
        ("gate_m", "f8"),  # inf: none
        ("pooled", "i8"),
        ("silent_information", "i8"),
        ("robust", "i8"),  # 1: any of the following matters
        ("gate_sds", "f8"),  # inf: none
        ("outlier_share", "f8"),
        ("node_sd_m", "f8"),
        ("resample_below", "f8"),
        ("spread_scale", "f8"),  # 0: systematic resampling alone
        ("spread_alike", "i8"),  # 1: along one direction for all parents
        ("redraw", "i8"),
        ("search", "i8"),
        ("log_search_miss", "f8"),
        ("search_gap", "i8"),
    ]
)


def constants(scenario: Scenario) -> np.ndarray:
    """The record of a scenario, an array of one."""
    return _both(scenario)[0].copy()


def common_constants(scenario: Scenario) -> np.ndarray:
    """The record, an array of one, of what matters beside the measurement: most scenarios' have one type."""
    return _both(scenario)[1].copy()


def _both(scenario):
    known = _made.get(id(scenario))
    if known is None or known[0]() is not scenario:
        forget = partial(_made.pop, id(scenario), None)
        records = _constants(scenario), _common_constants(scenario)
        _made[id(scenario)] = known = ref(scenario, lambda _: forget()), records
    return known[1]


def _zeros(members):
    """One record; those of equal types are of one type, by which kernels are found."""
    made = record(members)
    return np.zeros(1, _types.setdefault(made, made))


def _common_constants(scenario):
    radio = constants_type(scenario.radio, scenario)
    numbers = {
        "radius_m": scenario.radius_m,
        "period_s": scenario.period_s,
        "periods": float(scenario.periods),
        "typical_error_m": scenario.typical_error_m,
        "typical_energy_mj": scenario.typical_energy_mj,
        "neighbourhood_m": neighbourhood_m(scenario),
    }
    plain = [(name, "f8") for name in numbers]
    flags = [("equal_everywhere", "i8"), ("scarce_energy", "i8"), ("tells_others", "i8")]
    # How wide a cell of the map of presence is along x and y, and the map; zeros where nobody asks for it.
    mapped = [("cell_m", "f8", 2), ("presence", "f8", (CELLS, CELLS))]
    made = _zeros([("radio", radio), *flags, *plain, *mapped])
    fill_constants(made["radio"], scenario.radio, scenario)
    made["equal_everywhere"] = scenario.measurement.equal_everywhere
    made["scarce_energy"], made["tells_others"] = scenario.scarce_energy, scenario.tells_others
    if scenario.scarce_energy:
        made["cell_m"], made["presence"] = np.array(scenario.field.room_m) / CELLS, presence(scenario)
    for name, value in numbers.items():
        made[name] = value
    return made


_made: dict[int, tuple[ref, tuple[np.ndarray, np.ndarray]]] = {}  # by scenario
_types: dict[np.dtype, np.dtype] = {}


def _constants(scenario: Scenario) -> np.ndarray:
    t = scenario.tracking
    types = [(name, constants_type(getattr(scenario, name), scenario)) for name in KINDS]
    plain = [(name, "f8") for name in ("period_s", "radius_m", "reach_m", "ring_m", *DOUBTS)]
    made = _zeros([*types, ("tracking", TRACKING), ("targets", "i8"), *plain])
    for name in KINDS:
        fill_constants(made[name], getattr(scenario, name), scenario)
    made["targets"] = scenario.targets
    walks = t.velocity_s is not None
    side_m, depth_m = scenario.field.room_m
    tracking = dict(
        period_s=scenario.period_s,
        side_m=side_m,
        depth_m=depth_m,
        radius_m=scenario.radius_m,
        error_cap_m=math.inf if scenario.error_cap_m is None else scenario.error_cap_m,
        q=scenario.filter_q,
        switches=t.switches,
        manoeuvre_q=t.manoeuvre_q or 0.0,
        walks=walks,
        velocity_kept=1.0 if t.velocity_s is None else math.exp(-scenario.period_s / t.velocity_s),
        velocity_sd=t.rest_sd_ms,
        gate_m=math.inf if t.gate_m is None else t.gate_m,
        pooled=t.fusion == "pooled",
        silent_information=t.silent_information,
        robust=t.robust,
        gate_sds=math.inf if t.gate_sds is None else t.gate_sds,
        outlier_share=t.outlier_share,
        node_sd_m=t.node_sd_m,
        resample_below=t.resample_below,
        spread_scale=0.0 if t.resampling == "systematic" else t.spread_scale,
        spread_alike=t.resampling == "common_spread",
        redraw=t.redraw_on_handover,
        search=t.search,
        log_search_miss=math.log(t.search_miss),
        search_gap=t.search_gap,
    )
    for name, value in tracking.items():
        made["tracking"][name] = value
    for name in DOUBTS:
        made[name] = getattr(scenario.association, name, 0.0)
    for name in ("period_s", "radius_m", "reach_m", "ring_m"):
        made[name] = getattr(scenario, name)
    return made
