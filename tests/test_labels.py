"""Labels are shown as they are: on the terminal, in Markdown, on pages, in pictures; what is no line is refused."""

import csv
import html
import io
import json
import re
import warnings

import pytest
from rich.console import Console

from wsn_env import Scenario, evaluate, make_policy
from wsn_env.cli import main
from wsn_env.evaluation import progress
from wsn_env.reports.front_tables import save_and_print_fronts
from wsn_env.reports.markdown import escape_markdown, markdown_table
from wsn_env.reports.pages.evaluation_page import write_report
from wsn_env.reports.tables import print_tables, save_markdown

SMALL = Scenario.named("PreDC-v0", periods=3, particles=20, nodes=20)
LABELS = [
    ["[/x]", "[bold]b", "[red]x[/red]", ":smile:", "a:smile:b", "mine.py:Two:k=3", "[link=http://x]y[/link]"],
    ["a|b", "a\\|b", "|", "\\", "\\[x]", "`code`", "*x*", "_x_", "~~x~~", "[a](http://x)", "#h", "- x"],
    ["<b>x</b>", "<script>alert(1)</script>", "</script>", "&amp;", "-->", "{{data}}", "{0}", "%s", '"', "'"],
    ["$x$", "$\\frac{", "__a", "😀", "👨‍👩‍👧", "汉字", "1", "007", "../x", "C:\\x", "a,b", "=1+1", " lead", "x" * 60],
]
MARKED = {  # what Markdown gets
    "[/x]": r"\[/x\]", ":smile:": r"\:smile:", "mine.py:Two:k=3": r"mine.py\:Two:k=3", "a|b": r"a\|b", "_x_": r"\_x\_",
    "<b>x</b>": r"\<b\>x\</b\>", "&amp;": r"\&amp;", "$x$": r"\$x\$", "`code`": r"\`code\`", "*x*": r"\*x\*",
    "pre_dc": "pre_dc", "nearest:n=2": "nearest:n=2", "😀": "😀", "\\": r"\\", "~~x~~": r"\~\~x\~\~",
}  # fmt: skip


@pytest.fixture(scope="module", params=range(len(LABELS)))
def compared(request):
    policies = {label: make_policy(f"nearest{i}", SMALL) for i, label in enumerate(LABELS[request.param])}
    return policies, evaluate(policies, SMALL, [1.0, 4.0], episodes=2)


def test_the_terminal_shows_labels_as_they_are(compared, capsys):
    policies, evaluation = compared
    print_tables(evaluation)
    save_and_print_fronts(evaluation)
    shown = capsys.readouterr().out
    for label in policies:
        assert f" {label.strip()} " in shown


def test_markdown_shows_labels_as_they_are(compared, tmp_path):
    policies, evaluation = compared
    save_markdown(evaluation, tmp_path)
    lines = (tmp_path / "evaluation.md").read_text(encoding="utf-8").splitlines()
    rows = [line for line in lines if line.startswith("| ") and not line.startswith(("| policy", "| ---"))]
    assert len(rows) == 2 * len(policies)
    for label in policies:
        marked = escape_markdown(label).replace("|", "\\|")
        assert sum(row.startswith(f"| {marked} | ") for row in rows) == 2
    assert {len(re.findall(r"(?<!\\)\|", row.replace("\\\\", ""))) for row in rows} == {9}


def test_files_pages_and_pictures_take_every_label(tmp_path):
    labels = ["[/x]", "a|b", "<script>alert(1)</script>", "{{data}}", "$\\frac{", "__a", "😀"]
    policies = {label: make_policy(f"nearest{i}", SMALL) for i, label in enumerate(labels)}
    evaluation = evaluate(policies, SMALL, [1.0, 4.0], episodes=2)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        save_and_print_fronts(evaluation, tmp_path)
        evaluation.save(tmp_path)
        page = write_report(tmp_path, evaluation, policies).read_text(encoding="utf-8")
    with open(tmp_path / "evaluation.csv", newline="", encoding="utf-8") as file:
        assert list(dict.fromkeys(row["policy"] for row in csv.DictReader(file))) == labels
    assert json.loads((tmp_path / "evaluation.json").read_text())["policies"] == labels
    for label in policies:
        assert f"<td>{html.escape(label)}</td>" in page
    assert "<script>alert" not in page and page.count("<script") == page.count("</script>")
    names = {"evaluation.csv", "evaluation.json", "front.csv", "front.json", "front.png", "report.html"}
    assert {path.name for path in tmp_path.iterdir()} == names


@pytest.mark.parametrize(("label", "marked"), MARKED.items())
def test_markdown_of_a_label(label, marked):
    assert markdown_table(["a"], [[escape_markdown(label)]]).splitlines()[2] == f"| {marked} |"


def test_cells_of_markdown_are_one_line():
    assert markdown_table(["a"], [["1\n2"]]).splitlines()[2] == "| 1 2 |"


@pytest.mark.parametrize("label", [label for some in LABELS for label in some])
def test_the_progress_bar_shows_labels_as_they_are(label, monkeypatch):
    written = io.StringIO()
    monkeypatch.setattr(
        "rich.console.Console", lambda **_: Console(file=written, force_terminal=True, width=200, color_system=None)
    )
    with progress.progress_bar() as report:
        report(1, 2, label)
    assert label.strip() in written.getvalue()


NO_LINES = [
    "a\nb",
    "a\tb",
    "\x1b[31mred",
    "a\x00",
    "\r",
    "",
    "  ",
    "a\u2028b",
    "a\udc80",
    "\x7f",
    "\x9b31m",
    3,
    None,
    ("a",),
]


@pytest.mark.parametrize("label", NO_LINES, ids=repr)
def test_what_is_no_line_is_no_label(label):
    with pytest.raises(ValueError, match=r"^policies: label .*: must be one line of text, without control characters$"):
        evaluate({label: make_policy("nearest0", SMALL)}, SMALL, [4.0], episodes=1)
    with pytest.raises(ValueError, match=r"^Scenario.name = .*: must be (a str|one line of text)"):
        SMALL.override(name=label)


def test_a_comparison_with_markup_as_labels_ends_with_its_files(tmp_path, capsys):
    labels = ["[/x]", ":smile:", "a|b"]
    policies = [f"{label}=nearest{i}" for i, label in enumerate(labels) if ":" not in label]
    options = ["--episodes", "1", "--set", "particles=20", "periods=3", "--out", str(tmp_path), "--lam", "1", "4"]
    assert main(["evaluate", "--policies", *policies, "nearest:n=3", *options, "--pareto"]) == 0
    assert " [/x] " in capsys.readouterr().out
    assert (tmp_path / "report.html").exists()


def test_results_are_saved_before_tables_are_printed(tmp_path, monkeypatch):
    monkeypatch.setattr("wsn_env.reports.tables.wide_console", lambda: 1 / 0)
    command = ["evaluate", "--policies", "nearest0", "--episodes", "1", "--set", "particles=20", "--out", str(tmp_path)]
    assert main(command) == 2
    assert {"evaluation.csv", "evaluation.json", "evaluation.md"} <= {path.name for path in tmp_path.iterdir()}
