# /// script
# dependencies = [
#     "wsn_env", "torch==2.13.0", "minari[create,hdf5]==0.5.4",
#     "click", "colorama", "dataclasses-json", "gym==0.26.2", "scikit-learn", "structlog", "tqdm",
# ]
# [tool.examples]
# without-dependencies = ["d3rlpy==2.8.1"]
# ///
"""d3rlpy's discrete CQL learns from a Minari dataset alone: episodes of random actions.

python examples/d3rlpy_cql.py --steps 20000

d3rlpy 2.8.1 asks for gymnasium==1.0.0, and works with later ones: pip install --no-deps d3rlpy==2.8.1
"""

import os
from tempfile import TemporaryDirectory

import d3rlpy
import tyro
from closing import Example
from d3rlpy.algos import DiscreteCQLConfig
from d3rlpy.datasets import get_minari
from demonstrations import record


def main(steps: int = 20_000, updates: int = 2_000, seed: int = 0) -> None:
    """Record, learn, play."""
    d3rlpy.seed(seed)
    example = Example("d3rlpy discrete CQL")
    with TemporaryDirectory() as folder:
        os.environ["MINARI_DATASETS_PATH"] = folder
        recorded = record(max(1, steps // example.held_out.unwrapped.scenario.periods), seed, random=1.0)
        episodes, _ = get_minari(recorded.spec.dataset_id)
    settings = dict(learning_rate=3e-4, gamma=0.9, batch_size=256, target_update_interval=200, alpha=1.0)
    cql = DiscreteCQLConfig(**settings).create(device="cpu:0")
    quiet = dict(logger_adapter=d3rlpy.logging.NoopAdapterFactory(), show_progress=False)
    cql.fit(episodes, n_steps=updates, n_steps_per_epoch=updates, **quiet)
    example.close(cql.predict, recorded.total_steps)


if __name__ == "__main__":
    tyro.cli(main)
