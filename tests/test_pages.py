"""Pages: their numbers are the evaluation's, and they work in a browser from a file, without network."""

import base64
import csv
import html
import json
import re

import numpy as np
import pytest

from tests.browser import chromium, complaints
from wsn_env import Scenario, World, evaluate, make_policy
from wsn_env.bluetooth.synthetic import write_dataset
from wsn_env.cli import main
from wsn_env.envs.registration import IDS
from wsn_env.evaluation.rollout import episodes, evaluation_seeds
from wsn_env.reports.pages.learning_curves import read_progress
from wsn_env.reports.pages.replay_page import replay

SEED = evaluation_seeds(0, 3)[2]
TWO = {"Binary-v0": ("boundary", "nearest2"), "Underwater-v0": ("strongest_signal", "nearest2")}


def data_of(path) -> dict:
    """What a page's player shows."""
    return json.loads(re.search(r'id="data">(.*?)</script>', path.read_text())[1])


@pytest.mark.parametrize("name", IDS)
def test_a_replay_tells_what_the_evaluation_does(name, tmp_path):
    scenario = Scenario.named(name)
    policies = TWO.get(name, ("pre_dc" if scenario.radio.receiver == "head" else "all", "nearest2"))
    out = tmp_path / "replay.html"
    replay({policy: make_policy(policy, scenario) for policy in policies}, scenario, SEED, out)
    assert out.stat().st_size < 500_000 * max(1, scenario.periods / 500)
    rows = evaluate(list(policies), scenario, episodes=3).rows
    data = data_of(out)
    assert [episode["policy"] for episode in data["episodes"]] == list(policies)
    for episode in data["episodes"]:
        row = next(r for r in rows if r["seed"] == SEED and r["policy"] == episode["policy"])
        assert episode["rms_m"] == pytest.approx(row["rms_m"])
        assert episode["total"] == pytest.approx(row["return"])
        frames = episode["frames"]
        assert len(frames) == scenario.periods + 1
        errors = np.array([frame["error"] for frame in frames[1 + scenario.unscored :]])
        assert np.sqrt(np.mean(errors**2)) == pytest.approx(row["rms_m"], rel=1e-3)
        assert frames[0]["energy"] == 0 and sum(frame["energy"] for frame in frames) == pytest.approx(
            row["energy_mj"] * scenario.periods, rel=1e-3
        )


def test_several_targets_are_replayed(tmp_path):
    scenario = Scenario.named("PreDC-v0", targets=3, particles=300, battery_j=5e-4)
    policy = make_policy("nearest3", scenario)
    replay({"nearest3": policy}, scenario, SEED, tmp_path / "replay.html")
    data = data_of(tmp_path / "replay.html")
    row = next(row for row in evaluate(["nearest3"], scenario, episodes=3).rows if row["seed"] == SEED)
    (episode,) = data["episodes"]
    assert len(data["tracks"]) == 3 == len({tuple(track) for track in data["tracks"]})
    assert episode["rms_m"] == pytest.approx(row["rms_m"])
    assert episode["total"] == pytest.approx(row["return"]) and episode["energy_mj"] == pytest.approx(row["energy_mj"])
    left = np.full(scenario.field.nodes, 5e-4)
    for frame in episode["frames"]:
        assert len(frame["targets"]) == 3
        for node, battery in frame["left_j"]:
            left[node] = battery
    *_, (state, _) = episodes(policy, World(scenario), [SEED])
    np.testing.assert_allclose(left, state.residual_j[2], rtol=1e-6)


@pytest.mark.parametrize("start", ["known", "search"])
def test_batteries_are_the_worlds_to_the_last_node(start, tmp_path):
    scenario = Scenario.named("PreDC-v0", battery_j=1e-4, particles=300, start=start)
    policy = make_policy("all", scenario)
    replay({"all": policy}, scenario, SEED, tmp_path / "replay.html")
    left = np.full(scenario.field.nodes, scenario.radio.battery_j)
    for frame in data_of(tmp_path / "replay.html")["episodes"][0]["frames"]:
        for node, battery in frame["left_j"]:
            left[node] = battery
    *_, (state, _) = episodes(policy, World(scenario), [SEED])
    np.testing.assert_allclose(left, state.residual_j[0], rtol=1e-6)
    assert (left == 0).any()


def test_what_a_search_costs_and_wakes_is_shown(tmp_path):
    """Also before the first period, where it counts for nobody's return."""
    scenario = Scenario.named("PreDC-v0", start="search", search_miss=0.5, particles=300)
    out = tmp_path / "replay.html"
    recording = replay({"nearest0": make_policy("nearest0", scenario)}, scenario, 0, out)
    frames = data_of(out)["episodes"][0]["frames"]
    searches = [frame for frame in frames if frame["search"]]
    assert frames[0]["search"] and len(searches) > 1
    assert all(frame["awake"] == scenario.field.nodes > len(frame["targets"][0]["members"]) + 1 for frame in searches)
    spent = [frame["energy"] for frame in frames]
    assert spent[0] > 1 and np.mean(spent[1:]) == pytest.approx(recording.episodes[0].energy_mj, rel=1e-3)


def test_binary_sensors_that_report_nothing_there_have_no_ring(tmp_path):
    scenario = Scenario.named("Binary-v0", periods=20)
    replay({"boundary": make_policy("boundary", scenario)}, scenario, 0, tmp_path / "replay.html")
    data = data_of(tmp_path / "replay.html")
    frames = [frame["targets"][0] for frame in data["episodes"][0]["frames"]]
    assert all(set(frame["detects"]) <= {*frame["heard"], *frame["members"], frame["head"]} for frame in frames)
    assert any(set(frame["heard"]) - set(frame["detects"]) for frame in frames)
    assert ["heard", "detects"] in data["legend"]


def test_a_recorded_track_is_replayed(tmp_path, capsys):
    write_dataset(tmp_path / "data", tracks=2, seconds=40)
    track = sorted((tmp_path / "data").glob("*.mbd"))[0]
    out = tmp_path / "page" / "replay.html"
    command = ["replay", "--scenario", "Ble-v0", "--policy", "all", "strongest:n=3", "--recording", str(track)]
    assert main([*command, "--out", str(out)]) == 0
    assert "strongest:n=3: RMS" in capsys.readouterr().out
    data = data_of(out)
    assert len(data["nodes"]) == 2 * 12 and data["receiver"] == "sink"
    own = [frame["targets"][0] for frame in data["episodes"][0]["frames"][1:]]
    assert all({frame["head"], *frame["members"]} >= set(range(12)) for frame in own)


@pytest.mark.parametrize(
    "arguments,words",
    [
        (["--policy", "pre_dc", "random", "all"], ("one or two",)),
        (["--policy", "pre_cd"], ("pre_cd", "pre_dc")),
        (["--policy", "all", "--scenario", "Ble-v0", "--recording", "nowhere.mbd"], ("nowhere.mbd", "is no file")),
        (["--policy", "pre_dc", "--recording", __file__], ("PreDC-v0", "Ble-v0")),
        (["--policy", "pre_dc", "--set", "nodse=3"], ("nodse", "nodes")),
        (["--policy", "pre_dc", "--seed", "-1"], ("seed", "-1")),
    ],
)
def test_bad_input_is_one_line_and_leaves_no_page(arguments, words, tmp_path, capsys):
    out = tmp_path / "replay.html"
    assert main(["replay", *arguments, "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert all(word in said for word in words) and said.count("\n") == 1
    assert not out.exists()


@pytest.fixture(scope="module")
def reported(tmp_path_factory):
    """A folder of an evaluation, its policies' rows by (policy, lam)."""
    folder = tmp_path_factory.mktemp("evaluation")
    command = ["evaluate", "--policies", "nearest1", "pre_dc", "nearest3", "--lam", "1", "10", "--episodes", "8"]
    assert main([*command, "--set", "particles=300", "--out", str(folder)]) == 0
    return folder


def test_a_report_has_the_tables_and_the_worst_episode(reported):
    text = (reported / "report.html").read_text()
    for line in (reported / "evaluation.md").read_text().splitlines():
        if line.startswith("| ") and "policy" not in line and "---" not in line:
            assert all(f">{cell.strip()}</td>" in text for cell in line.strip("|").split("|"))
    with open(reported / "evaluation.csv", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["policy"] == "nearest1" and float(row["lam"]) == 10.0]
    worst = min(rows, key=lambda row: float(row["return"]))
    data = data_of(reported / "report.html")
    assert data["seed"] == int(worst["seed"]) and data["lam"] == 10.0
    assert data["episodes"][0]["total"] == pytest.approx(float(worst["return"]))
    assert "numpy" in text and f"{rows[0]['seed']} to {rows[-1]['seed']}" in text


def test_labels_are_no_formulas(tmp_path):
    labels = [r"$\frac{$", "_top", "a$b$"]
    named = [f"{label}=nearest{n}" for n, label in enumerate(labels)]
    assert main(["evaluate", "--policies", *named, "--episodes", "2", "--lam", "1", "2", "--out", str(tmp_path)]) == 0
    pictures = re.findall(r'src="data:image/svg\+xml;base64,(.*?)"', (tmp_path / "report.html").read_text())
    drawn = [html.unescape(base64.b64decode(picture).decode()) for picture in pictures]
    assert len(drawn) == 3 and all(f"{label}<" in picture for label in labels for picture in drawn)


def test_without_matplotlib_there_is_no_report_but_all_else(tmp_path, monkeypatch):
    monkeypatch.setattr("wsn_env.reports.pictures.find_spec", lambda name: None)
    assert main(["evaluate", "--policies", "nearest1", "--episodes", "2", "--out", str(tmp_path)]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"evaluation.csv", "evaluation.json", "evaluation.md"}


def test_a_training_is_read_in_the_order_of_its_steps(tmp_path):
    """A run that was killed in the middle of a line, twice, and resumed from its last checkpoints."""
    for begins, text in {
        0: "a,time/total_timesteps\n1.5,100\n,200\n9,300\n9,400\n2.",
        200: "time/total_timesteps,b\n300,7\n1000,9\n11",
        1000: "time/total_timesteps,b\n1100,8\n",
    }.items():
        (tmp_path / f"progress-{begins}").mkdir()
        (tmp_path / f"progress-{begins}" / "progress.csv").write_text(text)
    for foreign in ("progress-old", "progress-", "progress-1e3", "progress--5", "progress-200 copy", "progress"):
        (tmp_path / foreign).mkdir()
        (tmp_path / foreign / "progress.csv").write_text("time/total_timesteps\n50\n")
    (tmp_path / "progress-7").write_text("a file")
    (tmp_path / "progress-8" / "progress.csv").mkdir(parents=True)
    with open(tmp_path / "progress-0" / "progress.csv", "r+") as file:
        lines = file.read()
        file.seek(0)
        file.write(lines.replace("\n,200", "\n,150,1,2\nx,160\n,200"))
    progress = read_progress(tmp_path)
    assert np.array_equal(progress["time/total_timesteps"], [100, 200, 300, 1000, 1100])
    assert np.array_equal(progress["a"], [1.5, *[np.nan] * 4], equal_nan=True)
    assert np.array_equal(progress["b"], [np.nan, np.nan, 7, 9, 8], equal_nan=True)


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    with chromium(tmp_path_factory.mktemp("chromium")) as driver:
        yield driver


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    """A replay of two policies, of which one has a name that would end a script."""
    out = tmp_path_factory.mktemp("pages") / "replay.html"
    scenario = Scenario.named("PreDC-v0")
    names = {"pre_dc": "pre_dc", "</script><b>nearest": "nearest2"}
    replay({label: make_policy(name, scenario) for label, name in names.items()}, scenario, 7, out)
    return out


@pytest.fixture
def opened(browser, two):
    """That page in a browser, and its data."""
    browser.get(two.as_uri())
    yield browser, data_of(two)
    assert complaints(browser) == []


def period(browser) -> int:
    return int(re.match(r"step (\d+) of 100", browser.find_element("id", "period").text)[1])


def keys(browser, *pressed):
    from selenium.webdriver import ActionChains

    ActionChains(browser).send_keys(*pressed).perform()


def test_play_advances_and_pauses(opened):
    from selenium.webdriver.support.ui import WebDriverWait

    browser, _ = opened
    button = browser.find_element("id", "play")
    button.click()
    WebDriverWait(browser, 20).until(lambda browser: period(browser) >= 3)
    assert button.text == "pause"
    button.click()
    at = period(browser)
    assert button.text == "play"
    assert browser.execute_async_script("setTimeout(arguments[0], 300)") is None and period(browser) == at


def test_slider_and_keyboard_seek(opened):
    from selenium.webdriver.common.keys import Keys

    browser, data = opened
    browser.execute_script(
        "const slider = document.getElementById('slider'); slider.value = 42; slider.dispatchEvent(new Event('input'))"
    )
    assert period(browser) == 42
    shown = [caption.text for caption in browser.find_elements("css selector", "figcaption")]
    assert len(shown) == 2 and shown[1].startswith("</script><b>nearest")
    for episode, text in zip(data["episodes"], shown):
        assert f"error {episode['frames'][42]['error']:.2f} m" in text
    keys(browser, Keys.ARROW_RIGHT, Keys.ARROW_RIGHT, Keys.ARROW_LEFT)
    assert period(browser) == 43
    keys(browser, Keys.END)
    assert period(browser) == 100
    keys(browser, Keys.HOME)
    assert period(browser) == 0
    slow = browser.find_element("id", "speed").get_attribute("value")
    keys(browser, "+")
    assert int(browser.find_element("id", "speed").get_attribute("value")) > int(slow)


def test_hovering_shows_a_node(opened):
    from selenium.webdriver import ActionChains

    browser, data = opened
    browser.execute_script("seek(30)")
    head = data["episodes"][0]["frames"][30]["targets"][0]["head"]
    x, y, canvas = browser.execute_script(
        "const [x, y] = scaleOf(views[0].canvas.getBoundingClientRect().width)(nodes[arguments[0]]);"
        "return [x, y, views[0].canvas]",
        head,
    )
    size = canvas.size
    ActionChains(browser).move_to_element_with_offset(canvas, x - size["width"] / 2, y - size["height"] / 2).perform()
    tip = browser.find_element("id", "tip")
    assert tip.is_displayed() and "battery" in tip.text and "last in 30" in tip.text
    browser.execute_script("seek(0)")  # what it says goes with the time
    assert tip.is_displayed() and "awake in 0 of 0 time steps" in tip.text
    ActionChains(browser).move_to_element(browser.find_element("id", "play")).perform()
    assert not tip.is_displayed()


def test_a_search_wakes_every_node_that_one_hovers_over(browser, tmp_path):
    scenario = Scenario.named("PreDC-v0", start="search", search_miss=0.5, particles=300)
    out = tmp_path / "replay.html"
    replay({"nearest0": make_policy("nearest0", scenario)}, scenario, 0, out)
    frames = data_of(out)["episodes"][0]["frames"]
    k = next(k for k, frame in enumerate(frames) if k and frame["search"])
    own = [frame["targets"][0] for frame in frames]
    asleep = next(n for n in range(scenario.field.nodes) if all(n not in (f["head"], *f["members"]) for f in own))
    browser.get(out.as_uri())
    caption = browser.find_element("css selector", "figcaption")
    assert "225 awake" in caption.text and "search" in caption.text
    browser.execute_script("seek(arguments[0])", k)
    browser.execute_script(
        "const [x, y] = scaleOf(views[0].canvas.getBoundingClientRect().width)(nodes[arguments[0]]);"
        "const box = views[0].canvas.getBoundingClientRect();"
        "hover(views[0], { clientX: box.left + x, clientY: box.top + y })",
        asleep,
    )
    tip = browser.find_element("id", "tip").text
    assert tip.startswith(f"node {asleep} ") and f"awake in 1 of {k} time steps, last in {k}" in tip
    assert complaints(browser) == []


def test_all_is_in_sight_without_scrolling(opened):
    """Fields, curves, buttons and legend in the window of 1,200 x 1,000."""
    browser, _ = opened
    height, end = browser.execute_script(
        "return [innerHeight, document.getElementById('legend').getBoundingClientRect().bottom]"
    )
    assert end <= height


def test_a_hue_means_one_thing(opened):
    """Policies have none of the hues of what is in the field."""
    browser, data = opened
    lines = browser.execute_script("return [stroke(0)[0], stroke(1)[0]]")
    assert lines[0] != lines[1] and not {*lines} & {*data["hue"].values()}


def test_what_is_drawn_moves_with_time(opened):
    browser, _ = opened
    drawn = []
    for to in (10, 60, 10):
        browser.execute_script("seek(arguments[0])", to)
        script = "return ['field0', 'field1', 'error', 'energy'].map((id) => document.getElementById(id).toDataURL())"
        drawn.append(browser.execute_script(script))
    assert all(a != b for a, b in zip(drawn[0], drawn[1])) and drawn[0] == drawn[2]


def test_a_report_opens_with_its_pictures_and_plays(browser, reported):
    browser.get((reported / "report.html").as_uri())
    widths = browser.execute_script("return [...document.images].map((image) => image.naturalWidth)")
    assert len(widths) == 3 and min(widths) > 100
    keys(browser, "+", " ")  # the page's own
    assert browser.find_element("id", "play").text == "play"
    browser.execute_script("document.getElementById('player').focus()")
    keys(browser, " ")
    assert browser.find_element("id", "play").text == "pause"
    keys(browser, " ")
    assert [each for each in complaints(browser) if not each["name"].startswith("data:")] == []
