"""Paired comparison: seeds, rows, intervals, files, stopping and continuing."""

import csv
import json

import gymnasium as gym
import numpy as np
import pytest

from wsn_env import Scenario, View, World, make_policy
from wsn_env.evaluation.comparison import COLUMNS, Evaluation, evaluate
from wsn_env.evaluation.intervals import Summary
from wsn_env.evaluation.rollout import BLOCK, evaluation_seeds, rollout
from wsn_env.reports.pictures import write_picture
from wsn_env.reports.plots import draw_comparison
from wsn_env.reports.tables import format_markdown, print_tables, save_markdown

SCENARIO = Scenario.named("PreDC-v0", particles=60, nodes=40, side_m=50.0, crossing_m=20.0, periods=8)


KALMAN = dict(tracker="ekf", search=False, side_m=5000.0, radius_m=20_000.0, ceiling=1.0, softness=0.01, nodes=20)


@pytest.mark.parametrize("q, low, high", [(0.1, 0.0, 0.0), (0.02, 0.5, 3.0)])
def test_anees_is_one_where_a_kalman_filters_model_is_right_and_more_where_it_is_too_sure(q, low, high):
    """Positions from everywhere and white acceleration of .1 m/s^2, so that the filter is exact at q = .1."""
    scenario = Scenario.named("PreDC-v0", acceleration_ms2=0.1, filter_q=q, periods=40, **KALMAN)
    rows = rollout(make_policy("nearest1", scenario), World(scenario, threads=1), range(300))
    anees = np.array([row["anees"] for row in rows])
    slack = 4 * anees.std() / len(anees) ** 0.5
    assert 1 + low - slack < anees.mean() < 1 + high + slack


@pytest.fixture(scope="module")
def evaluation() -> Evaluation:
    return evaluate(["pre_dc", "nearest0", "all"], SCENARIO, [1.0, 10.0], episodes=BLOCK + 7, seed=3)


def test_a_row_replays_in_the_environment(evaluation):
    """gym.make(...).reset(seed=the row's) and the same policy give the row's figures."""
    for row in evaluation.rows[:: BLOCK + 3]:
        env = gym.make(
            "wsn_env/PreDC-v0", scenario=SCENARIO, lam=row["lam"], action="cluster", observation="view"
        ).unwrapped
        policy = make_policy(row["policy"], SCENARIO)
        observation, _ = env.reset(seed=row["seed"])
        infos, total, nees = [], 0.0, []
        for _ in range(row["periods"]):
            observation, reward, *_, info = env.step(policy.predict(observation)[0])
            infos.append(info)
            total += reward
            offset, cov = info["estimate_m"] - info["target_m"], observation["cov"][::2, ::2]
            nees.append(offset @ np.linalg.solve(cov, offset) / 2)
        assert row["anees"] == pytest.approx(np.mean(nees), rel=1e-9)
        assert row["return"] == pytest.approx(total, rel=1e-12)
        assert row["error_m"] == pytest.approx(np.mean([info["error_m"] for info in infos]), rel=1e-12)
        assert row["rms_m"] == pytest.approx(info["episode_rms_m"], rel=1e-12)
        assert (
            row["reference_m"] == info["episode_reference_m"]
            and row["reference_all_awake_m"] == env.unwrapped.reference_all_awake_m()
        )
        assert row["energy_mj"] == pytest.approx(np.mean([info["energy_mj"] for info in infos]), rel=1e-12)
        assert row["members"] == np.mean([info["members"] for info in infos])
        assert row["handovers"] == sum(info["handover"] for info in infos)
        assert row["lost"] == sum(info["error_m"] > 20 for info in infos)


def test_return_is_made_of_error_and_energy(evaluation):
    for row in evaluation.rows:
        assert row["return"] == pytest.approx(-row["periods"] * (row["error_m"] + row["lam"] * row["energy_mj"]))
        assert 0 < row["reference_all_awake_m"] <= row["reference_m"] * (1 + 1e-9)


def test_policies_meet_common_random_numbers():
    """A policy's rows do not depend on who else is compared, on the number of threads, or on lam but for the return."""
    alone = evaluate(["nearest0"], SCENARIO, [1.0], episodes=BLOCK + 7, seed=3, threads=1)
    crowd = evaluate(["all", "nearest0"], SCENARIO, [1.0, 10.0], episodes=BLOCK + 7, seed=3, threads=2)
    assert [row for row in crowd.rows if row["policy"] == "nearest0" and row["lam"] == 1.0] == alone.rows
    a, b = (crowd.values("nearest0", lam, "rms_m") for lam in (1.0, 10.0))
    assert (a == b).all()


def test_seeds_never_meet_training():
    assert evaluation_seeds(0, 3) == [2**31, 2**31 + 1, 2**31 + 2]
    assert evaluation_seeds(2, 1) == [2**31 + 200_000]
    assert not set(evaluation_seeds(0, 100_000)) & set(evaluation_seeds(1, 100_000))
    for seed, episodes in ((-1, 1), (0, 0), (0, 100_001), (10_000, 1)):
        with pytest.raises(ValueError, match="must be in"):
            evaluation_seeds(seed, episodes)


def test_bootstrap_intervals_cover_and_pairs_narrow():
    rng = np.random.default_rng(1)
    covered = 0
    for _ in range(200):
        s = Summary.of(rng.normal(3.0, 2.0, 100))
        assert s.low < s.mean < s.high
        covered += s.low <= 3.0 <= s.high
    assert 180 <= covered <= 199  # 95 % of 200, within four standard errors
    assert Summary.of([2.0]) == Summary(2.0, 2.0, 2.0)


def test_files_hold_rows_and_settings(evaluation, tmp_path):
    evaluation.save(tmp_path)
    with open(tmp_path / "evaluation.csv") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == list(COLUMNS) and len(rows) == 2 * 3 * (BLOCK + 7)
    assert [float(row["return"]) for row in rows] == [row["return"] for row in evaluation.rows]
    saved = json.loads((tmp_path / "evaluation.json").read_text())
    assert saved["scenario"]["field"]["nodes"] == 40 and saved["seed"] == 3 and "numba" in saved["versions"]
    assert len(saved["means"]) == 6
    one = next(m for m in saved["means"] if m["policy"] == "nearest0" and m["lam"] == 10.0)
    difference = evaluation.values("nearest0", 10.0, "return") - evaluation.values("pre_dc", 10.0, "return")
    assert one["return_minus_pre_dc"]["mean"] == pytest.approx(difference.mean())


def test_a_stopped_run_continues_where_it_was(tmp_path, monkeypatch):
    whole = evaluate(["nearest0", "nearest1"], SCENARIO, [1.0], episodes=2 * BLOCK)

    def stop(done, total, text):
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        evaluate(["nearest0", "nearest1"], SCENARIO, [1.0], episodes=2 * BLOCK, keep=tmp_path, progress=stop)
    blocks = tmp_path / "evaluation.blocks.jsonl"
    with open(blocks, "a") as file:
        file.write('["nearest1", 1.0, 1, [{"lam": 1.0, "peri')  # as kill -9 leaves it
    played = []
    import wsn_env.evaluation.rollout as module

    rollout = module.rollout
    monkeypatch.setattr(module, "rollout", lambda *a: played.append(1) or rollout(*a))
    continued = evaluate(["nearest0", "nearest1"], SCENARIO, [1.0], episodes=2 * BLOCK, keep=tmp_path)
    assert continued.rows == whole.rows and len(played) == 1
    other = evaluate(["nearest0", "nearest1"], SCENARIO, [1.0], episodes=2 * BLOCK, seed=1, keep=tmp_path)
    assert len(played) == 5 and other.rows != whole.rows


def test_tables_and_picture(evaluation, tmp_path):
    table = format_markdown(evaluation, 10.0, "pre_dc").splitlines()
    returns = [float(line.split("|")[2].split()[0]) for line in table[2:]]
    assert returns == sorted(returns, reverse=True) and len(returns) == 3
    write_picture(tmp_path / "front.png", draw_comparison(evaluation, 10.0, emphasis="nearest0"))
    assert (tmp_path / "front.png").read_bytes()[:4] == b"\x89PNG"


def test_a_policy_of_ones_own_needs_no_name():
    class Lonely:
        def act(self, view: View):
            return make_policy("nearest0", SCENARIO).act(view)

    evaluation = evaluate(
        {"mine": Lonely(), "nearest0": make_policy("nearest0", SCENARIO)}, SCENARIO, [2.0], episodes=3
    )
    assert (evaluation.values("mine", 2.0, "return") == evaluation.values("nearest0", 2.0, "return")).all()
    assert evaluation.difference("mine", "nearest0", 2.0) == Summary(0.0, 0.0, 0.0)


def test_kept_blocks_belong_to_their_policy(tmp_path):
    """Another policy under the same name does not get the rows of the one before."""
    one, other = (make_policy(name, SCENARIO) for name in ("nearest0", "nearest4"))
    first = evaluate({"mine": one}, SCENARIO, [1.0], episodes=4, keep=tmp_path)
    second = evaluate({"mine": other}, SCENARIO, [1.0], episodes=4, keep=tmp_path)
    assert second.rows == evaluate({"mine": other}, SCENARIO, [1.0], episodes=4).rows != first.rows


def test_repeated_and_missing_lams():
    assert len(evaluate(["nearest0"], SCENARIO, [4.0, 4.0], episodes=3).values("nearest0", 4.0, "return")) == 3
    with pytest.raises(ValueError, match="name the lams"):
        evaluate(["nearest0"], SCENARIO.override(lam=(1.0, 2.0)), episodes=3)
    with pytest.raises(ValueError, match="at least one"):
        evaluate([], SCENARIO, [1.0])


def test_damaged_blocks_are_played_again(tmp_path):
    whole = evaluate(["nearest0"], SCENARIO, [1.0], episodes=4)
    evaluate(["nearest0"], SCENARIO, [1.0], episodes=4, keep=tmp_path)
    blocks = tmp_path / "evaluation.blocks.jsonl"
    head = blocks.read_text().splitlines()[0]
    for damage in (b"\xff\xfe", b"5", b'["nearest0", 1.0, 0, []]', b'["nearest0", 1.0, 0, 7]'):
        blocks.write_bytes(head.encode() + b"\n" + damage + b"\n")
        assert evaluate(["nearest0"], SCENARIO, [1.0], episodes=4, keep=tmp_path).rows == whole.rows


def test_a_policy_blind_to_lam_plays_once_and_its_rows_are_those_of_a_replay(tmp_path, monkeypatch):
    import wsn_env.evaluation.rollout as module

    class Watched:
        """Says nothing of lam, so that it is played at each."""

        def act(self, view):
            return make_policy("pre_dc", SCENARIO).act(view)

    lams, rollout, played = [0.3, 1.7, 10.0], module.rollout, []
    monkeypatch.setattr(module, "rollout", lambda *given: played.append(given[0]) or rollout(*given))
    policies = {"blind": make_policy("pre_dc", SCENARIO), "seeing": Watched()}
    whole = evaluate(policies, SCENARIO, lams, episodes=BLOCK + 3, seed=4)
    assert played.count(policies["blind"]) == 2 and played.count(policies["seeing"]) == 6
    blind, seeing = ([row | {"policy": ""} for row in whole.rows if row["policy"] == name] for name in policies)
    assert repr(blind) == repr(seeing)

    def stop(done, total, text):
        if done == 4:  # of eight: the first lam, and what the blind one has played for all
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        evaluate(policies, SCENARIO, lams, episodes=BLOCK + 3, seed=4, keep=tmp_path, progress=stop)
    played.clear()
    continued = evaluate(policies, SCENARIO, lams, episodes=BLOCK + 3, seed=4, keep=tmp_path)
    assert continued.rows == whole.rows
    assert [type(policy).__name__ for policy in played] == ["Watched"] * 4  # two blocks each at two lams


def test_the_best_of_a_family_in_hindsight(tmp_path, capsys):
    names = ["pre_dc", "nearest0", "nearest3", "nearest8", "single7"]
    policies = {name: make_policy("nearest0" if name == "single7" else name, SCENARIO) for name in names}
    evaluation = evaluate(policies, SCENARIO, [0.3, 30.0], episodes=20)
    assert evaluation.families() == ["nearest"] and evaluation.family_name("nearest") == "nearest0..8"
    assert evaluation.middle_lam == 30.0 == evaluate(policies, SCENARIO, [30.0, 0.3], episodes=1).middle_lam
    for lam in evaluation.lams:
        assert evaluation.ranked(lam)[0] == max(names, key=lambda name: evaluation.values(name, lam, "return").mean())
    for lam in evaluation.lams:
        means = {name: evaluation.values(name, lam, "return").mean() for name in names[1:4]}
        assert evaluation.best_of("nearest", lam) == max(means, key=means.get)
    assert evaluation.best_of("nearest", 30.0) == "nearest0" != evaluation.best_of("nearest", 0.3)
    with pytest.raises(ValueError, match="'neares' has no members: did you mean nearest"):
        evaluation.best_of("neares", 30.0)
    with pytest.raises(ValueError, match="must be one of 0.3, 30"):
        evaluation.best_of("nearest", 4.0)
    print_tables(evaluation)
    assert "best in hindsight: nearest0 of nearest0..8" in capsys.readouterr().out
    save_markdown(evaluation, tmp_path)
    assert (tmp_path / "evaluation.md").read_text().count("best in hindsight") == 2


def test_a_long_comparison_is_shown_in_short(capsys, monkeypatch):
    """The best at the middle trade-off and the one of interest in 80 columns, and a line for each trade-off."""
    monkeypatch.setenv("COLUMNS", "80")
    names = [f"nearest{size}" for size in range(9)]
    evaluation = evaluate([*names, "pre_dc"], SCENARIO, [0.3, 3.0, 30.0], episodes=10)
    print_tables(evaluation, reference="pre_dc", most=3)
    shown = capsys.readouterr().out.splitlines()
    ranked = evaluation.ranked(3.0)
    wanted = [name for name in ranked if name in (*ranked[:3], "pre_dc")]
    rows = [line.split()[0] for line in shown if line.strip() and "to pre_dc" not in line and line.split()[0] in ranked]
    assert rows == wanted and f"{10 - len(wanted)} more: evaluation.md" in shown
    assert all(len(line.rstrip()) <= 80 for line in shown if not line.startswith("/ref"))
    for lam in evaluation.lams:
        best = next(name for name in evaluation.ranked(lam) if name != "pre_dc")
        own, other = (evaluation.values(name, lam, "return").mean() for name in ("pre_dc", best))
        (line,) = [line for line in shown if line.startswith(f"lam {lam:g}: ")]
        ahead = 100 * (own - other) / abs(other)
        assert f"pre_dc {own:.1f}, best other {best} {other:.1f}: {ahead:+.1f} [" in line
