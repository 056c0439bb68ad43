"""The ecosystem's wrappers around single and native vector forms: unchanged, and row i of one is the other."""

import copy
import pickle
from functools import partial
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import wrappers
from gymnasium.vector import AsyncVectorEnv
from gymnasium.wrappers import vector
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

from tests.test_env import SMALL, same
from wsn_env import ClusterEnv, ClusterVectorEnv

ROWS, SEED, STEPS = 3, 5, 2 * SMALL["periods"]  # one whole episode and part of another


def make(**settings) -> ClusterEnv:
    return ClusterEnv(lam=4.0, **SMALL | settings)


def make_rows(**settings) -> ClusterVectorEnv:
    return ClusterVectorEnv(ROWS, lam=4.0, **SMALL | settings)


def make_radius() -> ClusterEnv:
    return make(action="radius")


def play(env, actions) -> list[tuple]:
    """(observation, reward, truncated, info) of the reset and of every step."""
    told = [(env.reset(seed=SEED)[0], 0.0, False, {})]
    for action in actions:
        observation, reward, _, truncated, info = env.step(action)
        told.append((observation, reward, truncated, info))
        if np.ndim(truncated) == 0 and truncated:
            env.reset()
    return told


def entries(rows: int | None = None) -> np.ndarray:
    """Menu entries, all of them."""
    return np.random.default_rng(0).integers(0, 28, (STEPS,) if rows is None else (STEPS, rows))


def test_record_episode_statistics():
    actions = entries()
    told = play(wrappers.RecordEpisodeStatistics(make()), actions)
    last = told[SMALL["periods"]][3]["episode"]
    assert last["l"] == SMALL["periods"]
    assert last["r"] == pytest.approx(sum(one[1] for one in told[: SMALL["periods"] + 1]), rel=1e-5)
    rows = play(vector.RecordEpisodeStatistics(make_rows()), np.repeat(actions[:, None], ROWS, axis=1))
    ended = rows[SMALL["periods"]][3]
    assert ended["_episode"].all() and ended["episode"]["r"][0] == last["r"]
    assert len(set(ended["episode"]["r"])) == ROWS


@pytest.mark.parametrize("form", ["single", "vector"])
def test_record_video(form, tmp_path):
    settings = dict(video_folder=str(tmp_path / "videos"), episode_trigger=lambda episode: episode == 0)
    if form == "single":
        env = wrappers.RecordVideo(make(render_mode="rgb_array"), **settings)
    else:
        env = vector.RecordVideo(make_rows(render_mode="rgb_array"), **settings)
    play(env, entries(None if form == "single" else ROWS))
    env.close()
    (video,) = Path(tmp_path / "videos").glob("*.mp4")
    from moviepy import VideoFileClip

    with VideoFileClip(str(video)) as clip:
        width, height = clip.size
        frames = [frame.astype(int) for frame in clip.iter_frames()]
    assert (width, height) == (600, 600) if form == "single" else (3 * height == width or width == 3 * height)
    assert len(frames) >= SMALL["periods"]
    assert abs(frames[0] - frames[-1]).max() > 100, "nothing moved"


@pytest.mark.parametrize("observation", ["candidates", "menu"])
def test_normalize_observation(observation):
    told = play(wrappers.NormalizeObservation(make(observation=observation)), entries())
    plain = play(make(observation=observation), entries())
    assert not same(told[5][0], plain[5][0])
    rows = play(vector.NormalizeObservation(make_rows(observation=observation)), entries(ROWS))
    seen = np.array([one[0] for one in rows[1:]])
    assert np.isfinite(seen).all() and abs(seen.mean()) < 0.3 and seen.dtype == np.float32


def test_normalize_reward():
    told = play(wrappers.NormalizeReward(make(), gamma=0.95), entries())
    plain = play(make(), entries())
    assert all(ours[1] <= 0 for ours in told) and told[3][1] != plain[3][1]
    assert told[3][3]["reward_error"] == plain[3][3]["reward_error"]  # info tells the environment's own
    rows = play(vector.NormalizeReward(make_rows(), gamma=0.95), entries(ROWS))
    assert np.std([one[1] for one in rows[1:]]) > 0


@pytest.mark.parametrize("action", ["menu", "subset"])
def test_flatten_observation(action):
    actions = entries() if action == "menu" else [make(action="subset").action_space.sample() for _ in range(STEPS)]
    env = wrappers.FlattenObservation(make(observation="dict", action=action))
    told = play(env, actions)
    plain = play(make(observation="dict", action=action), actions)
    space = make(observation="dict").observation_space
    assert all(one[0] in env.observation_space for one in told)
    assert all(same(ours[0], gym.spaces.flatten(space, theirs[0])) for ours, theirs in zip(told, plain))
    rows = vector.FlattenObservation(make_rows(observation="dict", action=action))
    assert same(play(rows, np.repeat(np.array(actions)[:, None], ROWS, axis=1))[4][0][0], told[4][0])


def test_frame_stack_observation():
    told = play(wrappers.FrameStackObservation(make(), 3), entries())
    plain = play(make(), entries())
    assert same(told[6][0], np.stack([plain[k][0] for k in (4, 5, 6)]))


@pytest.mark.parametrize("settings", [dict(flatten=True, normalize_time=True), dict(flatten=False)])
def test_time_aware_observation(settings):
    # The horizon is the environment's own: no TimeLimit tells the wrapper.
    limited = wrappers.TimeLimit(make(), SMALL["periods"])
    env = wrappers.TimeAwareObservation(limited, **settings)
    told = play(env, entries())
    assert all(one[0] in env.observation_space for one in told)
    if settings["flatten"]:
        assert [one[0][-1] for one in told[:4]] == pytest.approx([k / SMALL["periods"] for k in range(4)])
    assert [one[2] for one in told].index(True) == SMALL["periods"]


def test_transform_action():
    actions = np.random.default_rng(1).uniform(-1, 1, (STEPS, 1)).astype(np.float32)
    centred = gym.spaces.Box(-1.0, 1.0, (1,), np.float32)
    env = wrappers.TransformAction(make_radius(), lambda action: (action + 1) / 2, centred)
    told = play(env, actions)
    plain = play(make_radius(), (actions + 1) / 2)
    assert all(same(ours[:2], theirs[:2]) for ours, theirs in zip(told, plain))
    spaces = dict(action_space=gym.spaces.Box(-1.0, 1.0, (ROWS, 1), np.float32), single_action_space=centred)
    rows = vector.TransformAction(make_rows(action="radius"), lambda action: (action + 1) / 2, **spaces)
    assert same(play(rows, np.repeat(actions[:, None], ROWS, axis=1))[6][0][0], plain[6][0])


def test_a_chain_of_them():
    env = wrappers.RecordEpisodeStatistics(make(observation="dict"))
    env = wrappers.FrameStackObservation(wrappers.NormalizeObservation(wrappers.FlattenObservation(env)), 2)
    told = play(wrappers.NormalizeReward(env), entries())
    assert told[SMALL["periods"]][3]["episode"]["l"] == SMALL["periods"]
    assert np.isfinite([one[0] for one in told]).all()


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["copy", "pickle"])
@pytest.mark.parametrize("form", [make, make_rows], ids=["single", "vector"])
@pytest.mark.parametrize("played", [None, 0, 4])
def test_copies_go_on_as_the_original_would(form, copied, played):
    """Before the first reset, after it, and amid an episode; the next episodes, too."""
    env, actions = form(), entries(None if form is make else ROWS)
    if played is not None:
        env.reset(seed=SEED)
        for action in actions[:played]:
            env.step(action)
    twin = copied(env)
    if played is None:
        assert same(env.reset(seed=SEED)[0], twin.reset(seed=SEED)[0])
    for action in actions[played or 0 :]:
        ours, theirs = env.step(action), twin.step(action)
        assert same(ours[:4], theirs[:4]) and same(ours[4], theirs[4])
        if form is make and ours[3]:
            assert same(env.reset()[0], twin.reset()[0])


@pytest.mark.parametrize("context", ["spawn", "fork"])
def test_async_vector_env_equals_the_native_batch(context):
    theirs = AsyncVectorEnv([partial(ClusterEnv, lam=4.0, **SMALL)] * ROWS, context=context)  # its module is light
    try:
        for ours, other in zip(play(make_rows(), entries(ROWS)), play(theirs, entries(ROWS))):
            assert same(ours[:3], other[:3])
    finally:
        theirs.close()


@pytest.mark.parametrize("context", [pytest.param("spawn", marks=[pytest.mark.slow, pytest.mark.full]), "fork"])
def test_subproc_vec_env_equals_dummy_vec_env(context):
    pair = DummyVecEnv([make] * ROWS), SubprocVecEnv([make] * ROWS, start_method=context)
    try:
        for envs in pair:
            envs.seed(SEED)
        assert same(*(envs.reset() for envs in pair))
        for action in entries(ROWS):
            ours, theirs = (envs.step(action) for envs in pair)
            assert same(ours[0], theirs[0]) and same(ours[1], theirs[1].astype(np.float32)) and same(ours[2], theirs[2])
    finally:
        pair[1].close()
