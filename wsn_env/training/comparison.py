"""A trained policy beside every baseline, on episodes that neither has seen."""

from __future__ import annotations

import sys

from wsn_env.evaluation.comparison import evaluate
from wsn_env.evaluation.kept_blocks import remove_kept_blocks
from wsn_env.evaluation.policies import Policy, make_policy, policy_names
from wsn_env.evaluation.progress import progress_bar
from wsn_env.reports.pages.evaluation_page import write_report
from wsn_env.reports.pictures import write_picture
from wsn_env.reports.plots import draw_comparison
from wsn_env.reports.tables import print_tables, save_markdown
from wsn_env.scenario import Scenario
from wsn_env.training.settings import Training, trade_offs

SIZED = ("nearest", "informed")  # compared with each of SIZES
SIZES = range(9)  # further members
SLOW = ("ppo", "planner", "mcts")  # left out: the one trained is in it, the others take hours


def make_baselines(scenario: Scenario) -> dict[str, Policy]:
    """Every installed policy that fits the scenario, by name; says which are left out."""
    made, elsewhere = {}, []
    names = [name for name in policy_names() if name not in (*SLOW, *SIZED)]
    for name in sorted(names + [f"{name}{size}" for name in SIZED for size in SIZES]):
        try:
            policy = make_policy(name, scenario)
        except ValueError as problem:
            print(f"train: left out of the comparison: {problem}", file=sys.stderr)
            continue
        if getattr(policy, "fits", True):
            made[name] = policy
        else:
            elsewhere.append(name)
    if elsewhere:
        print(f"train: not compared, since they are meant for other scenarios: {', '.join(elsewhere)}")
    return made


def compare(settings: Training, scenario: Scenario, policies: dict[str, Policy], made: dict) -> None:
    """Paired comparison with every baseline: table, CSV, JSON, picture, report."""
    folder = settings.folder
    # Where it is steered, the price is the network's own affair.
    lams = [0.0] if settings.steering else trade_offs(settings, scenario)
    with progress_bar() as report:
        evaluation = evaluate(
            policies, scenario, lams, settings.episodes or 0, settings.evaluation_seed, keep=folder, progress=report
        )
    evaluation.save(folder)
    save_markdown(evaluation, folder)
    write_picture(folder / "comparison.png", draw_comparison(evaluation, evaluation.middle_lam, emphasis="ppo"))
    with progress_bar() as report:
        page = write_report(folder, evaluation, policies, made, report)
    remove_kept_blocks(folder)
    print_tables(evaluation, reference="ppo", most=10)
    print(f"written: {folder / 'evaluation.csv'}, {folder / 'comparison.png'}, {page}")
