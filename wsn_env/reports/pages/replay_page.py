"""The replay page: an episode under one policy, or under two on the same random numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from wsn_env.evaluation.files import check_writable, replacing
from wsn_env.evaluation.policies import Policy, named_policies
from wsn_env.evaluation.rollout import FIRST_SEED
from wsn_env.models.arguments import checked_but
from wsn_env.models.quantity import ScenarioError, whole_number
from wsn_env.reports.pages.page import build_page, fill_template, json_for_script, read_template
from wsn_env.reports.pages.recording import Recording, record
from wsn_env.scenario import Scenario

MOST = 2  # policies side by side


@checked_but("policies", "seed")
def replay(
    policies: str | Sequence[str] | Mapping[str, Policy],
    scenario: str | Scenario,
    seed: int = FIRST_SEED,
    out: str | Path = "replay.html",
) -> Recording:
    """Play an episode and write its page.

    Args:
        policies: one or two, as `evaluate` takes them.
        scenario: with one lam; or a preset's name.
        seed: of `reset`.
        out: file to write; its folder is made.

    Raises:
        ValueError: too many policies, a lam that is a range, or a seed below 0.
    """
    scenario = Scenario.of(scenario)
    named = named_policies(policies, scenario)
    if len(named) > MOST:
        raise ValueError(f"policies = {', '.join(named)}: must be one or two")
    if scenario.lam_range[0] != scenario.lam_range[1]:
        raise ScenarioError(f"Scenario.lam = {scenario.lam!r}: must be one number for a replay")
    seed = whole_number("seed", seed, 0)
    check_writable(out)
    recording = record(named, scenario, seed)
    page = build_page("replay", f"{scenario.title}, seed {seed}", player_html(recording))
    with replacing(out) as path:
        path.write_text(page, encoding="utf-8")
    return recording


def player_html(recording: Recording) -> str:
    """HTML of the player for a page; a page has room for one."""
    data = recording.common | {"episodes": [vars(episode) for episode in recording.episodes]}
    return fill_template("player.html", data=json_for_script(data), script=read_template("player.js"))
