"""wsn_env: wireless sensor networks that track a moving target, as Gymnasium environments.

import gymnasium as gym, wsn_env
env = gym.make("wsn_env/PreDC-v0", lam=4.0)
envs = gym.make_vec("wsn_env/PreDC-v0", num_envs=64, vectorization_mode="vector_entry_point")
"""

import importlib
from typing import TYPE_CHECKING, Any

from wsn_env.envs.registration import register_envs

if TYPE_CHECKING:
    from wsn_env.envs.env import ClusterEnv as ClusterEnv
    from wsn_env.envs.multi_env import MultiEnv as MultiEnv
    from wsn_env.envs.multi_env import MultiVectorEnv as MultiVectorEnv
    from wsn_env.envs.parallel_env import parallel_env as parallel_env
    from wsn_env.envs.registration import register as register
    from wsn_env.envs.vector_env import ClusterVectorEnv as ClusterVectorEnv
    from wsn_env.evaluation.as_policy import as_policy as as_policy
    from wsn_env.evaluation.bound import error_bound as error_bound
    from wsn_env.evaluation.comparison import evaluate as evaluate
    from wsn_env.evaluation.policies import make_policy as make_policy
    from wsn_env.evaluation.scoring import score as score
    from wsn_env.models.quantity import ScenarioError as ScenarioError
    from wsn_env.models.state import Cluster as Cluster
    from wsn_env.models.state import Outcome as Outcome
    from wsn_env.models.state import State as State
    from wsn_env.reports.episode_plot import plot_episode as plot_episode
    from wsn_env.reports.front_plots import plot_fronts as plot_fronts
    from wsn_env.reports.pages.replay_page import replay as replay
    from wsn_env.reports.plots import plot_comparison as plot_comparison
    from wsn_env.scenario import Scenario as Scenario
    from wsn_env.simulation.view import View as View
    from wsn_env.simulation.world import World as World

__version__ = "0.1.0"

_HOMES = {
    "Scenario": "wsn_env.scenario",
    "ScenarioError": "wsn_env.models.quantity",
    "World": "wsn_env.simulation.world",
    "View": "wsn_env.simulation.view",
    "State": "wsn_env.models.state",
    "Cluster": "wsn_env.models.state",
    "Outcome": "wsn_env.models.state",
    "ClusterEnv": "wsn_env.envs.env",
    "ClusterVectorEnv": "wsn_env.envs.vector_env",
    "MultiEnv": "wsn_env.envs.multi_env",
    "MultiVectorEnv": "wsn_env.envs.multi_env",
    "parallel_env": "wsn_env.envs.parallel_env",
    "evaluate": "wsn_env.evaluation.comparison",
    "as_policy": "wsn_env.evaluation.as_policy",
    "error_bound": "wsn_env.evaluation.bound",
    "score": "wsn_env.evaluation.scoring",
    "replay": "wsn_env.reports.pages.replay_page",
    "plot_comparison": "wsn_env.reports.plots",
    "plot_episode": "wsn_env.reports.episode_plot",
    "plot_fronts": "wsn_env.reports.front_plots",
    "make_policy": "wsn_env.evaluation.policies",
    "register": "wsn_env.envs.registration",
    "register_envs": "wsn_env.envs.registration",
}
__all__ = ["__version__", *_HOMES]


def __getattr__(name: str) -> Any:
    """Load the public names when they are first used, so that importing the package stays cheap (PEP 562)."""
    if name in _HOMES:
        return getattr(importlib.import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'wsn_env' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)


register_envs()
