"""Frames: what they show, and that looking changes nothing."""

import copy
import os
import pickle
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from PIL import Image

from wsn_env import ClusterEnv, ClusterVectorEnv
from wsn_env.envs.registration import IDS
from wsn_env.envs.rendering import camera
from wsn_env.envs.rendering.palette import BLUE, FLASH, GREEN, ORANGE, PURPLE, VERMILION, YELLOW
from wsn_env.envs.rendering.plan import WORDS_FROM, legend, plan_of

GOLDEN = Path(__file__).parent / "golden" / "frame.png"


CLEAR = {"Lifetime-v0": 4, "PreDC-v0": 3}  # seeds of pictures in which nothing covers what is looked for; else 1


def played(actions, seed=0, scenario="PreDC-v0", **keywords):
    """An environment after some actions, and the info of the last."""
    env = ClusterEnv(scenario, render_mode="rgb_array", **keywords)
    env.reset(seed=seed)
    for action in actions:
        info = env.step(action)[4]
    return env, info


def field_of(picture):
    """Without the words above and the legend below."""
    high = len(picture)
    return picture[high * 9 // 100 : high * 86 // 100]


def count(picture, colour):
    """Pixels of about a colour."""
    return int((np.abs(picture.astype(int) - colour).max(axis=2) < 25).sum())


def test_frame_is_the_golden_one():
    """Tolerance: half a level in the mean, one pixel in a thousand quite another: fonts and rounding, not shapes."""
    picture = played([13, 13, 14, 15, 13, 0, 0, 14], filter_q=0.05)[0].render()
    if not GOLDEN.exists():
        Image.fromarray(picture).save(GOLDEN)
        pytest.fail(f"{GOLDEN} was missing: look at the new one")
    off = np.abs(picture.astype(int) - np.asarray(Image.open(GOLDEN)).astype(int)).max(axis=2)
    assert off.mean() < 0.5 and (off > 40).mean() < 0.001


def off(picture, points, colour):
    """How far the pixels at (N, 2) are from a colour."""
    x, y = np.floor(points).astype(int).T
    return np.abs(picture[y, x].astype(int) - colour).max(axis=1)


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize("size", [64, 300, 600])
def test_frames_show_target_head_and_awake_nodes_where_they_are(name, size):
    env, _ = played([13, 13], seed=CLEAR.get(name, 1), scenario=name, frame_px=size)
    picture, view, scenario = env.render(), env.view, env.scenario
    assert picture.shape == (size, size, 3) and picture.dtype == np.uint8
    plan = plan_of(size, name, scenario.field.room_m, legend(scenario))
    # A ring about the target, of which the estimate covers a part; the tail ends in its middle.
    turns = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    radius = max(6 * plan.unit, 3.2) - max(2.6 * plan.unit, 1.4) / 2
    ring = plan.pixels(env.unwrapped._state.track[0, 2, ::2]) + radius * np.column_stack([np.cos(turns), np.sin(turns)])
    assert (off(picture, ring, GREEN) < 100).mean() > 0.4
    if size < WORDS_FROM:
        return
    awake, head = view.member[0].copy(), view.head[0]
    if scenario.radio.receiver == "head":
        awake[head] = False
        assert (off(picture, plan.pixels(view.positions[0, [head]]), VERMILION) == 0).all()
    assert awake.any() and (off(picture, plan.pixels(view.positions[0, awake]), BLUE) == 0).all()


def test_frame_shows_head_reports_and_handover():
    env, info = played([13, 25])
    picture = field_of(env.render())
    assert count(picture, VERMILION) > 100 and (count(picture, PURPLE) > 0) == info["handover"]
    assert (count(picture, ORANGE) > 0) == (info["detections"] > 0)
    env.reset(seed=0)
    assert not count(field_of(env.render()), VERMILION)


def test_a_search_flashes():
    env = ClusterEnv(render_mode="rgb_array", start="search")
    assert env.reset(seed=0)[1]["searched"]
    assert count(env.render(), FLASH) > 50_000
    assert not env.step(13)[4]["searched"]
    assert count(env.render(), FLASH) < 5_000


def test_looking_changes_nothing():
    seen, unseen = ClusterEnv(render_mode="rgb_array"), ClusterEnv()
    seen.reset(seed=5)
    unseen.reset(seed=5)
    for action in (13, 2, 0, 17):
        first = seen.render()
        assert (first == seen.render()).all()
        steps = seen.step(action), unseen.step(action)
        assert steps[0][1] == steps[1][1] and steps[0][4]["energy_mj"] == steps[1][4]["energy_mj"]


def test_numbers_so_far_are_those_of_the_infos():
    env = ClusterEnv(render_mode="rgb_array")
    infos = [env.reset(seed=3)[1]] + [env.step(13)[4] for _ in range(12)]
    trail = env._camera._trail
    assert trail.energy_mj[0] == pytest.approx(sum(info["energy_mj"] for info in infos))
    squares = [info["error_m"] ** 2 for info in infos[1:]]
    assert trail.rms_m(env._state, 0) == pytest.approx(np.sqrt(np.mean(squares)))


def test_copies_render_the_same():
    env, _ = played([13, 13, 2])
    twins = [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]
    for each in (env, *twins):
        each.step(4)
    assert all((env.render() == twin.render()).all() for twin in twins)


def test_rows_of_a_batch_look_like_environments_of_their_own():
    rows = ClusterVectorEnv(3, render_mode="rgb_array", frame_px=200, periods=4)
    rows.reset(seed=[7, 8, 9])
    for _ in range(6):  # the fifth begins the next episodes
        rows.step(np.array([13, 14, 15]))
    frames = rows.render()
    env = ClusterEnv(render_mode="rgb_array", frame_px=200, periods=4)
    env.reset(seed=8)
    for _ in range(4):
        env.step(14)
    env.reset()
    env.step(14)
    assert (frames[1] == env.render()).all()
    picture = camera.tile_frames(frames)
    assert picture.shape == (402, 402, 3) and (picture[:200, 202:] == frames[1]).all()


@pytest.fixture
def no_screen(monkeypatch):
    """pygame, without a screen."""
    monkeypatch.setitem(os.environ, "SDL_VIDEODRIVER", "dummy")
    return pytest.importorskip("pygame")


def test_window_shows_every_period_and_closes(no_screen):
    pygame = no_screen
    env = ClusterEnv(render_mode="human", frame_px=120)
    env.reset(seed=0)
    env.step(13)
    shown = pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)
    same = ClusterEnv(render_mode="rgb_array", frame_px=120)
    same.reset(seed=0)
    same.step(13)
    assert (shown == same.render()).all() and env.render() is None
    env.close()
    assert pygame.display.get_surface() is None
    rows = ClusterVectorEnv(5, render_mode="human", frame_px=100)
    rows.reset(seed=0)
    assert pygame.display.get_surface().get_size() == (304, 202)
    rows.close()


def test_environments_share_the_screens_one_window(no_screen):
    pygame = no_screen
    first, second = (ClusterEnv(render_mode="human", frame_px=size) for size in (64, 80))
    for env in (first, second, first):
        env.reset(seed=0)
        size = pygame.display.get_surface().get_size()[0]
        assert size == env._camera.frame_px
    first.close()
    second.step(13)
    assert pygame.display.get_surface().get_size() == (80, 80)
    second.close()
    assert pygame.display.get_surface() is None


def test_words_that_do_not_fit_are_left_out_or_shorter():
    """A search in a small frame: above the field stands the period alone."""
    for size, chip in ((64, False), (300, True)):
        env = ClusterEnv(render_mode="rgb_array", start="search", frame_px=size)
        env.reset(seed=0)
        above = env.render()[: size // 20]
        assert (count(above, YELLOW) > 0) == chip


def test_who_closes_the_window_is_not_shown_another(no_screen):
    pygame = no_screen
    env = ClusterEnv(render_mode="human", frame_px=64)
    env.reset(seed=0)
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    env.step(0)
    assert pygame.display.get_surface() is None
    env.step(0)
    assert pygame.display.get_surface() is None


def test_window_without_pygame_says_what_to_install(monkeypatch):
    monkeypatch.setattr(camera, "find_spec", lambda name: None)
    with pytest.raises(gym.error.DependencyNotInstalled, match="pygame-ce"):
        ClusterEnv(render_mode="human")
