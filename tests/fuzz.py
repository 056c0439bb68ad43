"""Random environments over all that quantities are allowed to be, and the laws of every period.

    python -m tests.fuzz --minutes 60 --from 0

searches seeds, one after another, and keeps those that break a law in tests/fuzz_found.json, with the smallest change
of the preset that still breaks it; tests/test_fuzz.py plays them ever after. Ctrl-C ends it.
"""

import argparse
import json
import math
import multiprocessing
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass, fields, replace
from functools import cache
from math import isqrt
from pathlib import Path
from random import Random
from typing import Any

import gymnasium as gym
import numpy as np

from tests.worlds import HAND_WRITTEN, assert_finite, assert_same, choices, keys_of
from wsn_env import Cluster, Scenario, View, World, make_policy
from wsn_env.envs.actions import ACTIONS, GROUP, MENU_ENTRIES, make_action
from wsn_env.envs.merit import ORDERS
from wsn_env.envs.observations import OBSERVATIONS, make_observation
from wsn_env.envs.registration import IDS
from wsn_env.envs.rewards import REWARDS
from wsn_env.models.library import FAULTS
from wsn_env.models.measurement.beacon import OF_RECEIVERS
from wsn_env.models.quantity import ScenarioError
from wsn_env.scenario.scenario import BY_NAME, MOST_LAM, named_scenarios
from wsn_env.scenario.tracking import PARTICLE_ONLY, ROBUST, TRACKERS, Tracking, reads

FOUND = Path(__file__).with_name("fuzz_found.json")
ROWS = 3
HANG_S = 150  # longer than kernels take to compile
SMALL = dict(nodes=60, periods=12, particles=300, candidates=20)  # at most so many: a case is short
LENGTHS = ("_m", "_ms", "_ms2")  # endings of what grows with the world


@dataclass(frozen=True)
class Case:
    """An environment, and the seed of its episodes and of what is chosen in them."""

    id: str
    keywords: dict[str, Any]
    seed: int

    def __str__(self) -> str:
        words = "".join(f", {name}={value!r}" for name, value in self.keywords.items())
        return f'gym.make("wsn_env/{self.id}"{words}).reset(seed={self.seed})'


# --- drawing --------------------------------------------------------------------------------------------------


def case_of(seed: int, usual: bool = False) -> Case:
    """The case of a seed; `usual` as for `draw_case`."""
    return draw_case(Random(seed), usual)


def draw_case(rng: Random, usual: bool = False) -> Case:
    """Kinds, then quantities: most are the preset's, some near that, some anywhere in all that is allowed.

    Args:
        usual: only measurements and detection rules that meet in other tests, too, whose kernels are compiled anyway.
    """
    name = rng.choice(IDS)
    preset = named_scenarios()[name]
    kinds = {role: rng.choice(without_files(role)) for role in BY_NAME if rng.random() < 0.4}
    if usual:
        sonar = kinds.get("measurement", name) in ("sonar", "Underwater-v0")
        kinds["detection"] = "threshold" if sonar else "radius"
    elif not hasattr(BY_NAME["measurement"].kinds.get(kinds.get("measurement"), type(preset.measurement)), "mean_db"):
        while kinds.get("detection") == "threshold":  # it needs levels
            kinds["detection"] = rng.choice(without_files("detection"))
    measured = BY_NAME["measurement"].kinds.get(kinds.get("measurement"), type(preset.measurement))
    if usual or not measured().independent:
        kinds.pop("association", None)  # whose kernels are compiled in other tests, or that it does not suit
    parts = {role: BY_NAME[role].kinds[kind]() for role, kind in kinds.items()}
    preset = replace_parts(preset, parts)
    keywords = kinds | draw_quantities(rng, preset)
    keywords |= draw_field(rng, preset, keywords)
    keywords |= draw_tracking(rng, preset, keywords) | draw_others(rng, preset, keywords)
    keywords |= {
        name: rng.choice(list(names))
        for name, names in dict(action=ACTIONS, observation=OBSERVATIONS, reward=REWARDS, order=ORDERS).items()
    }
    if rng.random() < 0.3:
        keywords["candidates"] = rng.randint(9 if keywords["action"] == "menu" else 1, SMALL["candidates"])
    if rng.random() < 0.1:
        keywords |= dict(render_mode="rgb_array", frame_px=rng.choice([16, 64, 100, 333]))
    if rng.random() < 0.1 and not usual:
        keywords["fast"] = True
    keywords |= draw_faults(rng, preset, keywords)
    return Case(name, keywords, rng.randrange(2**31))


@cache
def without_files(role: str) -> list[str]:
    """The kinds of a role that can be made without a file."""
    names = []
    for name, kind in BY_NAME[role].kinds.items():
        with suppress(ScenarioError):
            kind()
            names.append(name)
    return names


def replace_parts(preset: Scenario, parts: dict[str, Any]) -> dict[str, Any]:
    """The sections of a preset by name, its own quantities under "scenario", with other kinds."""
    sections = {name: getattr(preset, name) for name in ("field", *BY_NAME, "tracking")}
    return {"scenario": preset} | sections | parts


def draw_quantities(rng: Random, sections: dict[str, Any]) -> dict[str, Any]:
    """Some of the quantities that say what they may be."""
    size = 10 ** rng.uniform(-4, 3) if rng.random() < 0.25 else 1.0
    wild, near = rng.choice([0, 0.02, 0.05, 0.2]), rng.choice([0, 0.1, 0.5])
    drawn: dict[str, Any] = {}
    for section in sections.values():
        for item in fields(section):
            allowed, value = item.metadata.get("allowed", OF_RECEIVERS.get(item.name)), getattr(section, item.name)
            if allowed is None or item.name == "tracker":
                continue
            allowed = dict(allowed)
            if isinstance(value, tuple):  # one a receiver
                value = value[0]
            if allowed.pop("optional", False) and rng.random() < 0.7:
                continue
            if "choices" in allowed:
                if rng.random() < 0.25:
                    drawn[item.name] = rng.choice(allowed["choices"])
                continue
            whole, paired = allowed.pop("whole", False), allowed.pop("drawn", False)
            scale = size if item.name.endswith(LENGTHS) else 1.0
            chance = rng.random()
            if chance < wild:
                value = anywhere(rng, **allowed)
            elif value is not None and (scale != 1.0 or chance < near):
                value = value * scale * (10 ** rng.uniform(-0.7, 0.7) if chance < near else 1.0)
            else:
                continue
            drawn[item.name] = within(value, whole, **allowed)
            if paired and drawn[item.name] and rng.random() < 0.4:
                drawn[item.name] = (
                    drawn[item.name],
                    within(drawn[item.name] * 10 ** rng.uniform(0, 2), whole, **allowed),
                )
    if "targets" in drawn:  # of which these environments take one
        drawn["targets"] = 1
    for name in ("periods", "particles"):
        drawn[name] = min(drawn.get(name, SMALL[name]), rng.randint(2, SMALL[name]))
    return drawn


def anywhere(
    rng: Random,
    above: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
    below: float | None = None,
) -> float:
    """A number that is allowed: a bound, or log-uniform in its distance from one."""
    bounds = [bound for bound in (at_least, at_most) if bound is not None]
    if bounds and rng.random() < 0.3:
        return rng.choice(bounds)
    low, high = above if at_least is None else at_least, below if at_most is None else at_most
    most = 10 ** rng.choice([3.0, 12.0, 300.0])  # where there is no bound
    low, high = -most if low is None else low, most if high is None else high
    if low < 0 < high:
        return rng.choice([-1, 1]) * log_uniform(rng, 1e-12, min(-low, high))
    if low == 0:
        low = min(10 ** -rng.choice([6.0, 15.0, 300.0]), high)
    if rng.random() < 0.2:  # near the upper end
        return high - log_uniform(rng, 1e-16 * (high - low), high - low)
    return log_uniform(rng, low, high) if low > 0 else rng.uniform(low, high)


def log_uniform(rng: Random, low: float, high: float) -> float:
    """Between two positive numbers."""
    return math.exp(rng.uniform(math.log(low), math.log(high)))


def within(value: float, whole: bool, above=None, at_least=None, at_most=None, below=None) -> float:
    """A number of few digits, where they keep it in its bounds."""
    short = round(value) if whole else float(f"{value:.3g}")
    if at_least is not None and short < at_least or above is not None and short <= above:
        short = at_least if at_least is not None else value
    if at_most is not None and short > at_most or below is not None and short >= below:
        short = at_most if at_most is not None else value
    return short


def draw_field(rng: Random, sections: dict[str, Any], keywords: dict[str, Any]) -> dict[str, Any]:
    """Nodes where the preset has them, or others."""
    if sections["field"].positions is not None and "side_m" not in keywords and rng.random() < 0.8:
        return dict(layout="uniform", nodes=len(sections["field"].positions), field_seed=None)
    nodes = rng.choice([1, 2, 3, rng.randint(1, SMALL["nodes"]), rng.randint(1, SMALL["nodes"])])
    grid = rng.random() < 0.3
    return dict(
        positions=None,
        depth_m=None,
        nodes=isqrt(nodes) ** 2 if grid else nodes,
        layout="grid" if grid else "uniform",
        field_seed=rng.choice([None, 0]),
    )


def draw_tracking(rng: Random, sections: dict[str, Any], keywords: dict[str, Any]) -> dict[str, Any]:
    """A tracker that reads what nodes report, and of the filter's quantities those that it makes use of."""
    measurement = sections["measurement"]
    named = sections["association"].names_targets
    able = [name for name in TRACKERS if reads(name, measurement)] if named else ["particle"]
    tracker = sections["tracking"].tracker
    if tracker not in able or rng.random() < 0.6:
        tracker = rng.choice(able)
    drawn: dict[str, Any] = dict(tracker=tracker)
    usual = {item.name: item.default for item in fields(Tracking)}
    if tracker != "particle":
        drawn |= {name: usual[name] for name in PARTICLE_ONLY}
    if not measurement.reports_state or tracker == "particle":
        drawn["gate_m"] = None
    if tracker in ("grnn", "grnn_kf") and keywords.get("positions", ()) is None:
        drawn["field_seed"] = 0
    if not measurement.independent:
        drawn["silent_information"] = False
        drawn |= {name: usual[name] for name in ROBUST}
    if measurement.lasting_errors:
        drawn |= dict(search=False, fusion="joint")
    if not named:
        drawn |= {"fusion": "joint", "silent_information": False} | {name: usual[name] for name in ROBUST}
    if (keywords | drawn).get("gate_sds") is not None:
        drawn |= dict(fusion="joint", silent_information=False)
    if tracker.startswith("boundary"):
        drawn["reports"] = "changes"
    return drawn


def draw_others(rng: Random, sections: dict[str, Any], keywords: dict[str, Any]) -> dict[str, Any]:
    """What fits the quantities drawn before, or has rules of its own."""
    drawn: dict[str, Any] = {}
    if rng.random() < 0.3:
        low, more = float(f"{log_uniform(rng, 1e-9, 1e-2):.3g}"), rng.choice([1.0, 1.0, 10.0])
        drawn["battery_j"] = low if more == 1.0 else (low, more * low)
    lam = rng.choice([None, None, 0, 1e-9, MOST_LAM, (1e-9, MOST_LAM), (0.3, 30.0)])
    if lam is not None:
        drawn["lam"] = lam
    if keywords.get("unscored", 0) >= keywords["periods"] or keywords.get("ends_outside"):
        drawn["unscored"] = 0
    elif sections["scenario"].unscored:
        drawn["unscored"] = min(sections["scenario"].unscored, keywords["periods"] - 1)
    for item in fields(sections["measurement"]):  # one a receiver
        value, nodes = getattr(sections["measurement"], item.name), keywords["nodes"]
        if isinstance(value, tuple) and len(value) != nodes and item.name not in keywords:
            drawn[item.name] = value[0]
    if hasattr(sections["measurement"], "mean_db") and "threshold_db" in {
        item.name for item in fields(sections["detection"])
    }:  # levels that are reached somewhere
        if rng.random() < 0.8:
            at_m = log_uniform(rng, 1.5, 1e4)
            drawn["threshold_db"] = float(f"{sections['measurement'].mean_db(at_m):.4g}")
    return drawn


def draw_faults(rng: Random, sections: dict[str, Any], keywords: dict[str, Any]) -> dict[str, Any]:
    """Some faults that fit, with settings of their own."""
    kinds: dict[str, Any] = dict(FAULTS.kinds)
    if sections["measurement"].lasting_errors:
        kinds = {name: kind for name, kind in kinds.items() if not (kind.of_sensing or kind().changes_tracks)}
    if keywords.get("ends_outside", sections["scenario"].ends_outside):
        kinds.pop("excursion", None)
    if not sections["association"].names_targets:
        kinds = {name: kind for name, kind in kinds.items() if not kind().strikes}
    faults = []
    for name in rng.sample(sorted(kinds), min(rng.choice([0, 0, 0, 1, 2, 3]), len(kinds))):
        own = {item.name for item in fields(kinds[name])}
        drawn = {key: value for key, value in draw_quantities(rng, {name: kinds[name]()}).items() if key in own}
        faults.append(",".join([name, *(f"{key}={value}" for key, value in drawn.items())]))
    return {"faults": faults} if faults else {}


# --- the laws -------------------------------------------------------------------------------------------------


def play(case: Case) -> int:
    """Plays a case, in environments and in the world alone. Returns the periods played; 0: refused when made.

    Raises:
        AssertionError, or anything else that broke a law.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            env = gym.make(f"wsn_env/{case.id}", disable_env_checker=True, **case.keywords)
        except ValueError as refusal:
            assert "\n" not in str(refusal) and len(str(refusal)) < 500, f"refused in many words: {refusal}"
            return 0
        return play_environments(case, env) + play_world(case, env.unwrapped.scenario)


def play_environments(case: Case, env: gym.Env) -> int:
    """One environment, and a batch whose rows have the same seeds: the row of the same seed is the same."""
    envs = gym.make_vec(
        f"wsn_env/{case.id}",
        num_envs=ROWS,
        vectorization_mode="vector_entry_point",
        autoreset_mode="SameStep" if case.seed % 2 else "NextStep",
        threads=1,
        **case.keywords,
    )
    rng, row = np.random.default_rng(case.seed), case.seed % ROWS
    seeds = [case.seed + i for i in range(ROWS)]
    envs.single_action_space.seed(case.seed)
    observation, info = env.reset(seed=seeds[row])
    observations, infos = envs.reset(seed=seeds)
    battery = env.unwrapped.scenario.radio.most_battery_j
    periods, ended = 0, np.zeros(ROWS, bool)
    while not ended[row]:
        check_observation(env, observation, "observation")
        check_observation(envs, observations, "observations")
        check_numbers(env.unwrapped, info, battery)
        check_numbers(envs.unwrapped, infos, battery)
        check_frames(case, env, envs, row)
        assert_row(observations, observation, row, "observation")
        actions = [envs.single_action_space.sample() for _ in range(ROWS)]
        if case.keywords.get("action") not in ("radius", "scores"):
            masks = envs.unwrapped.action_masks()
            assert masks.dtype == bool and masks.any(axis=1).all(), "an action mask without any action"
            np.testing.assert_array_equal(env.unwrapped.action_masks(), masks[row], "action mask of a row")
            if case.keywords.get("action", "menu") == "menu" and rng.random() < 0.5:
                actions = [int(rng.choice(np.flatnonzero(mask))) for mask in masks]
        stacked = actions if isinstance(actions[0], dict) else np.array(actions)
        observation, reward, terminated, truncated, info = env.step(actions[row])
        observations, rewards, terminations, truncations, infos = envs.step(stacked)
        periods += 1
        ended = terminations | truncations
        assert np.isfinite(reward).all() and np.isfinite(rewards).all(), f"reward {reward}, {rewards}"
        assert_row(rewards, reward, row, "reward")
        assert (terminated, truncated) == (terminations[row], truncations[row]), "the ends of a row"
        if ended.any() and not ended[row]:
            break  # other rows begin anew
        if not ended[row]:
            assert_row({name: infos[name] for name in info}, info, row, "info")
    check_observation(env, observation, "observation")
    check_observation(envs, observations, "observations")
    check_numbers(env.unwrapped, info, battery)
    check_numbers(envs.unwrapped, infos, battery)
    if not env.unwrapped.scenario.ends_outside:
        check_observation(envs, envs.step(stacked)[0], "observations of new episodes")
    return periods * (ROWS + 1)


def check_observation(env, observation, name: str) -> None:
    """It is in its space, and finite."""
    assert_finite({name: observation} if not isinstance(observation, dict) else observation)
    assert env.observation_space.contains(observation), f"{name} outside of its space: {outside(env, observation)}"


def outside(env, observation) -> str:
    """What of an observation is not in its space."""
    if not isinstance(observation, dict):
        return "the array"
    return ", ".join(name for name, space in env.observation_space.items() if not space.contains(observation[name]))


def check_numbers(env, info: dict[str, Any], battery_j: float) -> None:
    """Finite numbers in info, view, state and belief; batteries between empty and full."""
    for name, value in info.items():
        array = np.asarray(value)
        assert array.dtype.kind != "f" or np.isfinite(array).all(), f"info {name} = {value}"
    state = env._state
    assert_finite(state)
    assert (state.belief.log_weights <= 0).all(), "log weights above 0"
    assert (np.diagonal(state.belief.cov, axis1=1, axis2=2) >= 0).all(), "variances below 0"
    for residual in (state.residual_j, env.view.battery):
        assert ((residual >= 0) & (residual <= battery_j)).all(), "batteries outside of 0 to full"


def check_frames(case: Case, env, envs, row: int) -> None:
    """A picture of the size asked for, the same of a row of a batch, where pictures are asked for."""
    px = case.keywords.get("frame_px")
    if px is not None:
        frame, frames = env.render(), envs.render()
        assert frame.shape == (px, px, 3) and frame.dtype == np.uint8, f"frame {frame.shape} {frame.dtype}"
        assert frame.std() > 0, "nothing on a frame"
        np.testing.assert_array_equal(frames[row], frame, "frame of a row")


def assert_row(batch, single, row: int, name: str) -> None:
    """A row of a batch has the bits of the single environment."""
    if isinstance(single, dict):
        for key, value in single.items():
            assert_row(batch[key], value, row, f"{name} {key}")
    else:
        np.testing.assert_array_equal(np.asarray(batch)[row], np.asarray(single), f"{name} of a row")


def play_world(case: Case, scenario: Scenario) -> int:
    """Wild clusters and hand-written policies; every observation, the menu, and a batch of one."""
    fast = case.keywords.get("fast", False)
    world, keys, row = World(scenario, threads=1, fast=fast), keys_of(case.seed, ROWS), case.seed % ROWS
    candidates = max(case.keywords.get("candidates", 12), GROUP)
    observations = {
        name: make_observation(name, scenario, case.keywords.get("order", "nearest"), candidates)
        for name in OBSERVATIONS
    }
    menu = make_action("menu", scenario, case.keywords.get("order", "nearest"), candidates)
    policies = [make_policy(name, scenario) for name in HAND_WRITTEN]
    state, single = world.reset(keys), world.reset(keys[row : row + 1])
    for period in range(scenario.periods):
        view = View.of(state)
        assert_finite(view.as_arrays(), {"spread": view.spread_m})
        for name, observation in observations.items():
            arrays = observation.encode(view)
            for b in range(ROWS):
                one = {key: value[b] for key, value in arrays.items()} if isinstance(arrays, dict) else arrays[b]
                check_observation(Spaced(observation.space), one, f"observation {name!r}")
        cluster = policies[(case.seed + period) % len(policies)].act(view)
        if (case.seed + period) % 2:
            cluster = choices(case.seed, period, ROWS, scenario.field.nodes)
        if period == scenario.periods - 1:
            check_menu(menu, view)
        state, outcome = world.step(state, cluster, donate=True)
        own = Cluster(cluster.head[row : row + 1], cluster.members[row : row + 1])
        single, alone = world.step(single, own, donate=True)
        assert_finite(state, outcome)
        assert_same(outcome.row, alone.row, slice(row, row + 1))
        assert_same(state.belief, single.belief, slice(row, row + 1))
        assert (outcome.energy_j >= 0).all() and (outcome.spent_j >= 0).all(), "energy below 0"
        assert ((outcome.dropped >= 0) & (outcome.dropped <= cluster.members.shape[1] + 1)).all(), "dropped"
        if not any(isinstance(fault, FAULTS.kinds["late"]) for fault in scenario.faults):
            assert (outcome.delivered <= outcome.detections).all(), "more delivered than detected"
    return scenario.periods * (ROWS + 1)


@dataclass(frozen=True)
class Spaced:
    """What has an observation space."""

    observation_space: gym.Space


def check_menu(menu, view: View) -> None:
    """What the mask allows leads to a living head, and to as many further members as the entry says."""
    masks = menu.masks(view)
    assert masks[:, 0].all(), "keeping the cluster is always an entry"
    for entry in range(MENU_ENTRIES):
        head, members = menu.cluster(np.full(len(masks), entry), view)
        for b in np.flatnonzero(masks[:, entry]) if entry else ():
            assert view.alive[b, head[b]], f"menu entry {entry}: a dead head"
            named = members[b][members[b] >= 0]
            assert len(named) == len(set(named) - {head[b]}) == (entry - 1) % GROUP, f"menu entry {entry}: members"


# --- the search -----------------------------------------------------------------------------------------------


def broken_law(case: Case) -> tuple[int, str]:
    """Periods played, and the law that was broken: the error's first line, and where it came from."""
    try:
        return play(case), ""
    except Exception as error:
        frames = traceback.extract_tb(error.__traceback__)
        own = [frame for frame in frames if "/wsn_env/" in frame.filename or "/agents/" in frame.filename]
        place = f"{Path(own[-1].filename).name}: {own[-1].name}" if own else frames[-1].name
        line = " ".join(str(error).split())
        return 0, f"{type(error).__name__} in {place}: {line:.160}"


def serve(pipe: Any) -> None:
    """Play the cases that come through a pipe: in a process of its own, which may hang or crash."""
    with suppress(KeyboardInterrupt, EOFError):
        while True:
            pipe.send(broken_law(pipe.recv()))


class Player:
    """Plays cases in another process, which is begun anew after a crash or a hang."""

    def __init__(self) -> None:
        self._process: Any = None

    def broken_law(self, case: Case) -> tuple[int, str]:
        """As the function does."""
        if self._process is None:
            self._pipe, theirs = multiprocessing.Pipe()
            self._process = multiprocessing.get_context("spawn").Process(target=serve, args=(theirs,), daemon=True)
            self._process.start()
            theirs.close()
        try:
            self._pipe.send(case)
            if self._pipe.poll(HANG_S):
                return self._pipe.recv()
            law = f"no end within {HANG_S} s"
        except (EOFError, OSError):
            law = "the process crashed"
        self.stop()
        return 0, law

    def stop(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._process = None


def shrunk(case: Case, law: str, player: Player) -> Case:
    """The same with as many quantities as may be as they are in the preset, while the same law is broken."""
    kind = law.partition(":")[0]
    for name in reversed(case.keywords):  # kinds last
        less = replace(case, keywords={key: value for key, value in case.keywords.items() if key != name})
        if player.broken_law(less)[1].partition(":")[0] == kind:
            case = less
    return case


def found() -> list[dict[str, Any]]:
    """What has been found so far."""
    return json.loads(FOUND.read_text()) if FOUND.exists() else []


def kept_cases() -> Iterator[Case]:
    """The cases of all that has been found."""
    for entry in found():
        yield Case(entry["id"], {name: tuples(value) for name, value in entry["keywords"].items()}, entry["seed"])


def tuples(value: Any) -> Any:
    """JSON's lists as they were."""
    return tuple(map(tuples, value)) if isinstance(value, list) else value


def keep(number: int, case: Case, law: str) -> None:
    """Append a case to the file."""
    entries = [*found(), {"from": number, "law": law, **asdict(case)}]
    new = FOUND.with_suffix(".new")
    new.write_text("[\n" + ",\n".join(map(json.dumps, entries)) + "\n]\n")
    new.replace(FOUND)


def search(minutes: float, first: int, most: int, usual: bool) -> None:
    """Play the cases of one seed after another; say what was found."""
    player, begun, counts, laws = Player(), time.monotonic(), Counter(), Counter()
    number, shown = first, 0.0
    try:
        while time.monotonic() - begun < 60 * minutes:
            case = case_of(number, usual)
            periods, law = player.broken_law(case)
            counts.update(cases=1, periods=periods, made=bool(periods), broken=bool(law))
            if law:
                kind = law.partition(":")[0]
                laws[kind] += 1
                if laws[kind] <= most:
                    case = shrunk(case, law, player)
                    law = player.broken_law(case)[1] or law
                    keep(number, case, law)
                    print(f"seed {number}: {law}\n    {case}", flush=True)
            number += 1
            if time.monotonic() - shown > 30:
                shown = time.monotonic()
                print(f"seed {number}: {dict(counts)}", flush=True)
    except KeyboardInterrupt:
        pass
    player.stop()
    print(f"seeds {first}..{number - 1}: {dict(counts)}")
    for law, count in laws.most_common():
        print(f"{count} {law}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=60)
    parser.add_argument("--from", type=int, default=0, dest="first", help="the first seed")
    parser.add_argument("--most", type=int, default=3, help="keep at most so many of a kind of failure")
    parser.add_argument("--usual", action="store_true", help="only kinds that meet in other tests: less to compile")
    arguments = parser.parse_args()
    search(arguments.minutes, arguments.first, arguments.most, arguments.usual)
