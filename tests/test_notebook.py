"""What notebooks show: the one in docs/, cell by cell; tables, frames and axes."""

import ast
import json
import re
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import pytest
from matplotlib.axes import Axes

import wsn_env
from wsn_env import evaluate
from wsn_env.evaluation.comparison import COLUMNS, Evaluation
from wsn_env.evaluation.intervals import Summary
from wsn_env.evaluation.progress import no_progress, progress_bar
from wsn_env.reports.labels import Box

NOTEBOOK = Path(__file__).parents[1] / "docs" / "notebook.ipynb"
SMALL = dict(particles=100, nodes=40, side_m=50.0, crossing_m=20.0, periods=7)


@pytest.fixture(autouse=True)
def closing():
    yield
    plt.close("all")


def run_cell(source: str, names: dict):
    """What a notebook would show below a cell: its last expression."""
    body = ast.parse(source).body
    last = body.pop() if isinstance(body[-1], ast.Expr) else None
    exec(compile(ast.Module(body, []), "cell", "exec"), names)
    return None if last is None else eval(compile(ast.Expression(last.value), "cell", "eval"), names)


def test_the_notebook_runs_cell_by_cell():
    cells = json.loads(NOTEBOOK.read_text())["cells"]
    sources = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    names: dict = {}
    shown = [run_cell(source, names) for source in sources]
    assert len(sources) == 10 and shown[0] is None
    kinds = [type(each) for each in shown[1:]]
    assert kinds.count(Evaluation) == 3 and sum(issubclass(kind, Axes) for kind in kinds) == 4
    assert all("<table" in each._repr_html_() for each in shown if hasattr(each, "_repr_html_"))


def test_a_table_for_notebooks_has_every_policy_at_every_lam_the_best_first():
    evaluation = evaluate(["nearest0", "nearest2"], wsn_env.Scenario.named("PreDC-v0", **SMALL), [0.1, 50.0], 20)
    rows = re.findall(r"<tr><td>([^<]*)</td><td>([^<]*)</td><td>(-[\d.]+) \[", evaluation._repr_html_())
    assert [row[:2] for row in rows] == [(f"{lam:g}", name) for lam in (0.1, 50.0) for name in evaluation.ranked(lam)]
    for lam, name, value in rows:
        assert float(value) == pytest.approx(evaluation.values(name, float(lam), "return").mean(), abs=0.06)
    labelled = evaluate({"<b>": wsn_env.make_policy("nearest0", "PreDC-v0")}, "PreDC-v0", episodes=1)
    assert "<b>" not in labelled._repr_html_() and "&lt;b&gt;" in labelled._repr_html_()


def test_a_frame_has_the_rows_of_the_file():
    pytest.importorskip("pandas")
    evaluation = evaluate(["nearest0", "nearest2"], wsn_env.Scenario.named("PreDC-v0", **SMALL), episodes=3)
    frame = evaluation.to_frame()
    assert list(frame.columns) == list(COLUMNS) and len(frame) == 6
    assert (frame[frame.policy == "nearest2"]["return"] == evaluation.values("nearest2", 4.0, "return")).all()


@pytest.mark.parametrize(
    ("summary", "text"),
    [
        (Summary(-120.2345, -123.4567, -116.9), "-120.2 [-123.5, -116.9]"),
        (Summary(0.0358123, 0.0344999, 0.0371), "0.0358 [0.0345, 0.0371]"),
        (Summary(15123.4, 14000.0, 16200.0), "15123 [14000, 16200]"),
        (Summary(1.0, 1.0, 1.0), "1 [1, 1]"),
    ],
)
def test_a_summary_is_rounded_to_what_its_interval_tells(summary, text):
    assert summary.text == text and repr(summary) == f"Summary({text})"


def label_boxes(axes):
    axes.figure.canvas.draw()
    return [Box(*each.get_window_extent().extents) for each in axes.texts]


def test_labels_of_a_comparison_keep_apart_and_within_the_axes():
    policies = ["greedy", "pre_dc", "strongest", "centroid", *(f"nearest{size}" for size in range(6))]
    evaluation = evaluate(policies, wsn_env.Scenario.named("PreDC-v0", **SMALL), [4.0], 10)
    axes = wsn_env.plot_comparison(evaluation, emphasis="greedy")
    boxes, frame = label_boxes(axes), Box(*axes.get_window_extent().extents)
    assert len(boxes) >= 8
    shrunk = [Box(box.left + 1, box.low + 2, box.right - 1, box.high - 2) for box in boxes]
    assert all(box.within(frame) for box in shrunk)
    assert not any(one.meets(other) for i, one in enumerate(shrunk) for other in shrunk[:i])


def test_plots_draw_into_given_axes():
    scenario = wsn_env.Scenario.named("PreDC-v0", **SMALL)
    evaluation = evaluate(["nearest0", "greedy"], scenario, [1.0, 4.0], 4)
    _, axes = plt.subplots(1, 3)
    assert wsn_env.plot_comparison(evaluation, 1.0, ax=axes[0]) is axes[0]
    assert wsn_env.plot_fronts(evaluation, ax=axes[1]) is axes[1]
    assert wsn_env.plot_episode(wsn_env.make_policy("nearest2", scenario), scenario, ax=axes[2]) is axes[2]
    episode = evaluate("nearest2", scenario, episodes=1)
    drawn = wsn_env.plot_episode("nearest2", scenario, seed=episode.rows[0]["seed"])
    assert f"RMS {episode.rows[0]['rms_m']:.3g} m" in drawn.get_title()


def test_work_within_work_has_no_second_bar(monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    with progress_bar() as outer, progress_bar() as inner:
        assert outer is not no_progress and inner is no_progress
        outer(1, 2, "x"), inner(1, 2, "y")
