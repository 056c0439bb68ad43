"""A scenario says everything about a simulated network and its target; the published systems are presets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache, cached_property
from importlib import import_module
from pkgutil import iter_modules
from typing import Any, Unpack, cast

import numpy as np

from wsn_env.models.association.base import Association
from wsn_env.models.association.known import Known
from wsn_env.models.detection.base import DetectionRule
from wsn_env.models.detection.radius import Detection
from wsn_env.models.fault.base import Fault
from wsn_env.models.field import Field
from wsn_env.models.kinds import Kind, Registry
from wsn_env.models.library import ASSOCIATIONS, DETECTIONS, FAULTS, MEASUREMENTS, MOTIONS, RADIOS
from wsn_env.models.measurement.base import Measurement
from wsn_env.models.measurement.position import Position
from wsn_env.models.motion.base import Motion
from wsn_env.models.motion.crossing import Crossing
from wsn_env.models.own import kind_text
from wsn_env.models.quantity import (
    ScenarioError,
    Section,
    UnknownQuantity,
    described,
    is_line,
    quantity,
    short,
    span,
    suggest,
)
from wsn_env.models.radio.base import Link
from wsn_env.models.radio.radio import Radio
from wsn_env.models.recordings.calibration_file import read_quantities
from wsn_env.scenario.named import faults_named, kind_named, section_told
from wsn_env.scenario.quantities import Quantities
from wsn_env.scenario.tracking import Tracking

PARTS: dict[str, type] = {
    "name": str,
    "field": Field,
    "motion": Motion,
    "detection": DetectionRule,
    "measurement": Measurement,
    "radio": Link,
    "association": Association,
    "tracking": Tracking,
}
BY_NAME: dict[str, Registry] = {
    "motion": MOTIONS,
    "detection": DETECTIONS,
    "measurement": MEASUREMENTS,
    "radio": RADIOS,
    "association": ASSOCIATIONS,
}


MOST_LAM = 1e9  # m/mJ: observations and rewards are float32


@dataclass(frozen=True)
class Scenario(Section):
    """Everything about a simulated network. `Scenario.named(id)` gives a published system's."""

    name: str = described("PreDC-v0", "one line of text for tables and pages")
    periods: int = quantity(100, "horizon of an episode", at_least=1, at_most=10**7, whole=True)
    period_s: float = quantity(1.0, "sampling period T", at_least=1e-6, at_most=3600)
    lam: float | tuple[float, float] = quantity(
        4.0, "what a mJ may cost of error [m/mJ]", at_least=0, at_most=MOST_LAM, drawn=True
    )
    typical_error_m: float = quantity(
        1.0, "error of a good schedule: the scale of a learner's rewards", at_least=1e-9, at_most=1e9
    )
    typical_energy_mj: float = quantity(0.3, "its energy in a period", at_least=1e-9, at_most=1e9)
    error_cap_m: float | None = quantity(
        None,
        "an error counts as this at most, so that a lost target costs no more the farther it goes; None: as it is",
        above=0,
        at_most=1e9,
        optional=True,
    )
    scarce_energy: bool = quantity(
        False, "observations also tell what is left of energy and time", choices=(True, False)
    )
    tells_others: bool = quantity(False, "observations also tell of a field's other targets", choices=(True, False))
    unscored: int = quantity(0, "periods at the start that rms_m leaves out: acquisition", at_least=0, whole=True)
    targets: int = quantity(
        1,
        "targets in a field, each with its track, belief and cluster; nodes and batteries are shared",
        at_least=1,
        at_most=1000,
        whole=True,
    )
    ends_outside: bool = quantity(
        False,
        "an episode ends in the period in which the target is outside the field: tracks are neither reflected at the"
        " border nor drawn again to stay inside",
        choices=(True, False),
    )
    # The hypervolume's reference point, above what was measured of the head alone (nearest0) and of the most expensive
    # competitive policy; it stays as it is when rules get better.
    reference_error_m: float = quantity(
        1.5, "mean error that a point of a front must stay below", at_least=1e-9, at_most=1e9
    )
    reference_energy_mj: float = quantity(0.4, "energy in a period that it must stay below", at_least=1e-9, at_most=1e9)
    field: Field = Field()
    motion: Motion = Crossing()
    detection: DetectionRule = Detection()
    measurement: Measurement = Position()
    radio: Link = Radio()
    association: Association = Known()
    tracking: Tracking = Tracking()
    faults: tuple[Fault, ...] = described((), 'what goes wrong: faults, or text such as "stuck,share=0.1+late"')

    def __post_init__(self) -> None:
        super().__post_init__()
        self._take_faults()
        for name, part in PARTS.items():
            value = getattr(self, name)
            if not isinstance(value, part):
                raise ScenarioError(f"Scenario.{name} = {value!r}: must be a {_words(name, part)}")
            if isinstance(value, Kind):
                value.check_functions()
        if not is_line(self.name):
            raise ScenarioError(f"Scenario.name = {self.name!r}: must be one line of text, without control characters")
        if self.unscored >= self.periods:
            raise ScenarioError(f"Scenario.unscored = {self.unscored}: must be below periods = {self.periods}")
        if self.ends_outside and self.unscored:
            raise ScenarioError(f"Scenario.unscored = {self.unscored}: must be 0 with ends_outside = True")
        checked: tuple[Any, ...] = (
            *(self.tracking, self.detection, self.measurement, self.radio, self.association),
            *self.faults,
        )
        for part in checked:
            part.check(self)
        self.motion.check_measurement(self.measurement)
        if self.targets > 1:
            self._check_several_targets()

    @property
    def title(self) -> str:
        """Its name, with the number of targets where they are several: for tables and pages."""
        return self.name if self.targets == 1 else f"{self.name}, {self.targets} targets"

    def check_one_target(self, of_what: str) -> None:
        """Raise ScenarioError where there are several."""
        if self.targets > 1:
            raise ScenarioError(
                f"Scenario.targets = {self.targets}: must be 1 for {of_what}; several are for evaluate, replay, train"
                " and gym.make('wsn_env/Multi-v0', targets=...)"
            )

    def _check_several_targets(self) -> None:
        """Raise ScenarioError for what is made for one."""
        m = self.measurement
        one = {
            f"measurement = {type(m).__name__}, which tells nothing of whom it is": m.reports_state or m.lasting_errors,
            "faults": any(fault.strikes for fault in self.faults),
            "ends_outside = True": self.ends_outside,
            "motion = Replay": m.packets_of(self) is not None,
        }
        for what, given in one.items():
            if given:
                raise ScenarioError(f"Scenario.targets = {self.targets}: must be 1 with {what}")

    def _take_faults(self) -> None:
        """One fault, or a list of them, is a tuple."""
        given: Any = self.faults
        faults = (given,) if isinstance(given, Fault) else tuple(given) if isinstance(given, (list, tuple)) else None
        wrong = [given] if faults is None else [each for each in faults if not isinstance(each, Fault)]
        if wrong:
            kinds = ", ".join(kind.__name__ for kind in FAULTS.kinds.values())
            raise ScenarioError(f"Scenario.faults = {short(repr(wrong[0]))}: must be faults: {kinds} or your own")
        for fault in faults or ():
            fault.check_functions()
        object.__setattr__(self, "faults", faults)

    @property
    def kinds(self) -> tuple[Kind, ...]:
        """Of everything that there are several kinds of."""
        return self.motion, self.detection, self.measurement, self.radio, self.association, *self.faults

    @property
    def lam_range(self) -> tuple[float, float]:
        """(lowest, highest) lam of an episode [m/mJ]."""
        return span(self.lam)

    def counted_m(self, error_m: Any) -> Any:
        """Errors as they count in rewards and returns: at most `error_cap_m`.

        Args:
            error_m: (...,) m.
        """
        return error_m if self.error_cap_m is None else np.minimum(error_m, self.error_cap_m)

    @property
    def lam_balance(self) -> float:
        """Where the typical error and the typical energy cost about the same, to one digit [m/mJ]."""
        return float(f"{self.typical_error_m / self.typical_energy_mj:.1g}")

    def typical_cost(self, lam: Any) -> Any:
        """What a period of a good schedule costs at this lam, about [m]: the scale of a learner's rewards.

        A schedule that lam suits pays for less energy the dearer it is, hence the root.

        Args:
            lam: (...,) m/mJ.
        """
        return self.typical_error_m * np.sqrt(1.0 + lam * self.typical_energy_mj / self.typical_error_m)

    @property
    def lam_span(self) -> tuple[float, float]:
        """The trade-offs that matter [m/mJ]: from precise to frugal, 0.3 to 30 for PreDC-v0."""
        return float(f"{self.lam_balance / 10:.2g}"), float(f"{self.lam_balance * 10:.2g}")

    @property
    def lam_octaves(self) -> tuple[float, ...]:
        """Six of them to compare at [m/mJ]: 0.5, 1, 2, 4, 8, 16 for PreDC-v0."""
        return tuple(float(f"{self.lam_balance * 2**k / 6:.3g}") for k in range(6))

    @property
    def ring_m(self) -> float:
        """How far from the target a node tells most: at the edge of detection for one bit, as near as may be else."""
        return self.measurement.ring_m(self.radius_m)

    @property
    def filter_q(self) -> float:
        """The filter's acceleration noise [m/s^2]."""
        return self.motion.fitting_q if self.tracking.filter_q is None else self.tracking.filter_q

    @property
    def track_q(self) -> float:
        """The target's own acceleration noise [m/s^2]; the filter's where the motion has none."""
        own = self.motion.process_noise_ms2
        return self.filter_q if own is None else own

    @cached_property
    def radius_m(self) -> float:
        """Sensing radius; with a threshold, where the mean level is at it."""
        return self.detection.distances_m(self.measurement)[0]

    @cached_property
    def reach_m(self) -> float:
        """From here on a node detects nothing (with a threshold, less than once in a million periods)."""
        return self.detection.distances_m(self.measurement)[1]

    @property
    def handover_bits(self) -> int:
        """Size of a handover: the estimate, or 5 numbers of 32 bits for every particle."""
        return self.radio.handover_bits if self.radio.handover == "estimate" else 5 * 32 * self.tracking.particles

    @classmethod
    def of(cls, scenario: str | Mapping[str, Any] | Scenario, /, **overrides: Unpack[Quantities]) -> Scenario:
        """A scenario from a preset's name, from what `as_dict` tells or from a scenario, with overrides by quantity."""
        if isinstance(scenario, Mapping):
            if "name" not in scenario:
                raise ScenarioError(f"scenario = {short(repr(scenario))}: must tell its name, as `as_dict` does")
            scenario = cls().override(**cast(Any, scenario))
        if not isinstance(scenario, Scenario):
            return cls.named(scenario, **overrides)
        return scenario.override(**overrides) if overrides else scenario

    @classmethod
    def named(cls, name: str, /, **overrides: Unpack[Quantities]) -> Scenario:
        """A preset, with overrides by quantity.

        Args:
            name: one of `named_scenarios()`, with or without "wsn_env/".
            overrides: as for `override`.
        """
        if not isinstance(name, str):
            raise ScenarioError(
                f"scenario = {short(repr(name))}: must be a Scenario or a name: {', '.join(named_scenarios())}"
            )
        plain_name = name.removeprefix("wsn_env/")
        if plain_name not in named_scenarios():
            raise ScenarioError(f"scenario {name!r} is unknown: {suggest(plain_name, named_scenarios())}")
        return named_scenarios()[plain_name].override(**overrides)

    def override(self, **quantities: Unpack[Quantities]) -> Scenario:
        """A copy with some quantities changed, whatever section they stand in.

        Sections are given whole, as `as_dict` tells them or, where there are several kinds, by name:
        `override(nodes=400, motion="sine", amplitude_m=20, tracker="ekf")`. So are faults, of which several are joined:
        `faults="stuck,share=0.3+late"`. An unknown keyword raises and suggests. `calibration=FILE` stands for all
        quantities that `wsn calibrate` wrote into the file. A replay without `periods` is as long as its recording.
        """
        changes: dict[str, Any] = dict(quantities)
        if "calibration" in changes:
            changes = read_quantities(changes.pop("calibration")) | changes
        if changes.get("positions") is not None:
            changes.setdefault("nodes", Field.nodes)  # the positions tell how many
        whole: dict[str, Any] = {}
        for name, part in PARTS.items():
            if isinstance(changes.get(name), Mapping):
                whole[name] = section_told(name, part, BY_NAME.get(name), changes.pop(name))
        for name, registry in BY_NAME.items():
            if isinstance(changes.get(name), str):
                whole[name] = kind_named(registry, name, changes.pop(name), changes)
        whole["faults"] = faults_named(changes.pop("faults", self.faults), changes)
        for item in fields(self):
            if item.name in changes:
                whole[item.name] = changes.pop(item.name)
        known: dict[str, Any] = dict.fromkeys(("calibration", *PARTS))
        for item in fields(self):
            section: Any = whole.get(item.name, getattr(self, item.name))
            if is_dataclass(section):
                own = {part.name for part in fields(section)}
                known |= dict.fromkeys(own)
                if own & changes.keys():
                    whole[item.name] = replace(
                        cast(Any, section), **{key: changes.pop(key) for key in own & changes.keys()}
                    )
            else:
                known[item.name] = None
        if changes:
            name, owners = next(iter(changes)), _kinds_with_quantities()
            if name in owners:
                raise ScenarioError(f"scenario has no quantity {name!r}: it is one of {' and '.join(owners[name])}")
            raise UnknownQuantity("scenario", name, known | owners)
        motion = whole.get("motion", self.motion)
        if isinstance(motion, Motion) and motion != self.motion and "periods" not in whole:
            horizon = motion.horizon(whole.get("period_s", self.period_s))
            whole |= {} if horizon is None else {"periods": horizon}
        return replace(self, **whole)  # at once: a tracker and what it reads may change together

    def quantities(self) -> dict[str, Any]:
        """Every quantity of every section by name."""
        flat: dict[str, Any] = {}
        for item in fields(self):
            value = getattr(self, item.name)
            flat |= (
                {f.name: getattr(value, f.name) for f in fields(value)} if is_dataclass(value) else {item.name: value}
            )
        return flat

    def as_dict(self) -> dict[str, Any]:
        """Nested plain values for JSON, with each section's kind; `Scenario.of` makes a scenario of them."""
        plain: dict[str, Any] = {}
        for item in fields(self):
            value = getattr(self, item.name)
            plain[item.name] = section_as_dict(value) if is_dataclass(value) else value
        return plain | {"faults": [section_as_dict(fault) for fault in self.faults]}


def section_as_dict(section: Any) -> dict[str, Any]:
    """A section's kind and quantities, as `override` takes them."""
    return {"kind": kind_text(type(section))} | {item.name: getattr(section, item.name) for item in fields(section)}


def _words(name: str, part: type) -> str:
    """What a part of a scenario may be."""
    kinds = BY_NAME[name].kinds.values() if name in BY_NAME else ()
    return " or ".join(kind.__name__ for kind in kinds) or part.__name__


def _kinds_with_quantities() -> dict[str, list[str]]:
    """By quantity, the kinds that have it: {"amplitude_m": ["motion='sine'"], ...}."""
    owners: dict[str, list[str]] = {}
    for role, registry in {**BY_NAME, "faults": FAULTS}.items():
        for name, kind in registry.kinds.items():
            for item in fields(kind):
                owners.setdefault(item.name, []).append(f"{role}={name!r}")
    return owners


@cache
def named_scenarios() -> dict[str, Scenario]:
    """The named scenarios by id: the files of `scenario.presets`, found by themselves."""
    package = "wsn_env.scenario.presets"
    names = sorted(module.name for module in iter_modules(import_module(package).__path__))
    return {name.replace("_", "-"): import_module(f"{package}.{name}").SCENARIO for name in names}
