"""RLlib's env runner samples a native batch at least three times as fast as its own loop over single environments.

    python -m benchmarks.rllib [--rounds N] [--short] [--json FILE]

All have the same environment, module and number of rows; a turn samples some periods of every row. RLlib's own runner
on the native batch stands beside them: it handles every row of every period in Python.
"""

from collections.abc import Callable

from rich.console import Console

from benchmarks.race import Claim, Options, Result, Table, figure, interleave, main

AT_LEAST = 3.0
ROWS, SHORT_ROWS, PERIODS = 256, 16, 64
NATIVE, OWN, SYNC = "NativeRunner, native batch", "RLlib's runner, native batch", "RLlib's runner, single environments"


def measure(options: Options, console: Console) -> Result:
    """Race, or say why not."""
    result = Result(name="rllib", title="Sampling with RLlib", packages=["ray", "torch", "gymnasium"])
    what = "RLlib: sampling a native batch over its loop over single environments"
    try:
        import ray  # noqa: F401
    except ImportError:
        result.claims.append(Claim(what, AT_LEAST, None, why="ray is not installed"))
        return result
    rows = SHORT_ROWS if options.short else ROWS
    calls = {name: sampler(name, rows) for name in (NATIVE, OWN, SYNC)}
    times = interleave(calls, options, dict.fromkeys(calls, rows * PERIODS), warm=not options.short)
    result.text = (
        f"{rows} rows of wsn_env/PreDC-v0 with its default observation, a module of two layers of 64, one env runner in"
        f" this process, one thread. A period of a row, over {PERIODS} periods at a time."
    )
    lines = []
    for name in calls:
        low, high = times.spread(name, NATIVE)
        ratio = f"{figure(times.ratio(name, NATIVE))} ({figure(low)}-{figure(high)})"
        lines.append([name, f"{1e6 * times.median(name):.1f}", f"{1 / times.median(name):,.0f}", ratio])
    result.tables.append(Table("A period of a row", ["sampled by", "us", "periods/s", "time over the first's"], lines))
    result.claims.append(Claim(what, AT_LEAST, times.ratio(SYNC, NATIVE)))
    result.figures = {"seconds": times.seconds}
    return result


def sampler(name: str, rows: int) -> Callable[[], object]:
    """A call that samples PERIODS periods of each row."""
    import torch
    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig
    from ray.rllib.env.single_agent_env_runner import SingleAgentEnvRunner

    from wsn_env.learning.native_runner import NativeRunner

    torch.set_num_threads(1)
    settings = {"lam": 4.0} | ({"autoreset_mode": "Disabled"} if name == NATIVE else {})
    config = (
        PPOConfig()
        .environment("wsn_env:wsn_env/PreDC-v0", env_config=settings)
        .env_runners(
            num_env_runners=0,
            num_envs_per_env_runner=rows,
            gym_env_vectorize_mode="sync" if name == SYNC else "vector_entry_point",
        )
        .rl_module(model_config=DefaultModelConfig(fcnet_hiddens=[64, 64], vf_share_layers=False))
        .debugging(seed=0, log_level="ERROR")
    )
    runner = (NativeRunner if name == NATIVE else SingleAgentEnvRunner)(config=config, worker_index=0)
    return lambda: runner.sample(num_timesteps=rows * PERIODS)


if __name__ == "__main__":
    main(measure, __doc__)
