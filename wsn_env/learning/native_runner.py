"""RLlib's env runner for a native batch."""

from __future__ import annotations

import uuid
from typing import Any

import numpy as np
import torch
from gymnasium.vector import AutoresetMode, VectorEnv
from ray.rllib.core.columns import Columns
from ray.rllib.env.single_agent_env_runner import SingleAgentEnvRunner
from ray.rllib.env.single_agent_episode import SingleAgentEpisode
from ray.rllib.utils.metrics import WEIGHTS_SEQ_NO

from wsn_env.evaluation.native_envs import unwrap_native


class NativeRunner(SingleAgentEnvRunner):
    """Samples a native batch array by array, where RLlib's own runner handles every row of every period in Python.

    `PPOConfig().env_runners(env_runner_cls=NativeRunner, gym_env_vectorize_mode="vector_entry_point", ...)` on an
    environment in disabled autoreset mode. It samples periods, not episodes (batch_mode "truncate_episodes"), and knows
    no connectors between environment and module and no callbacks on episodes: what others there are is refused.
    """

    def make_env(self) -> None:
        """As RLlib's, but checked, and without its list of infos."""
        super().make_env()
        wrapped: Any = self.env
        self._envs: VectorEnv = wrapped.env  # below DictInfoToList
        if unwrap_native(self._envs).autoreset_mode != AutoresetMode.DISABLED:
            raise ValueError("NativeRunner: needs an environment with autoreset_mode Disabled")

    def _sample(
        self,
        *,
        num_timesteps: int | None = None,
        num_episodes: int | None = None,
        explore: bool,
        random_actions: bool = False,
        force_reset: bool = False,
    ) -> list[SingleAgentEpisode]:
        if num_timesteps is None or random_actions:
            raise ValueError("NativeRunner: samples periods with the module's actions, not episodes or random actions")
        if force_reset or self._needs_initial_reset:
            self._now = self._envs.reset(seed=self._seed if self._needs_initial_reset else None)[0]
            self._needs_initial_reset = False
            self._started, self._sums = np.zeros(self.num_envs, int), np.zeros(self.num_envs)
            self._ids = [uuid.uuid4().hex for _ in range(self.num_envs)]
        periods = -(-num_timesteps // self.num_envs)
        columns: dict[str, list[np.ndarray]] = {}
        # Of episodes: row, first and last period, the observation after it, whether it ended.
        chunks: list[tuple[int, int, int, np.ndarray, bool, bool]] = []
        since = np.zeros(self.num_envs, int)
        for t in range(periods):
            for name, values in self._choose_actions(explore).items():
                columns.setdefault(name, []).append(values)
            columns.setdefault(Columns.OBS, []).append(self._now)
            self._now, rewards, terminated, truncated, _ = self._envs.step(columns[Columns.ACTIONS][-1])
            columns.setdefault(Columns.REWARDS, []).append(np.asarray(rewards, np.float32))
            ended = terminated | truncated
            if ended.any():
                last, (self._now, _) = self._now, self._envs.reset(options={"reset_mask": ended})
                for row in np.flatnonzero(ended).tolist():
                    chunks.append((row, int(since[row]), t + 1, last[row], bool(terminated[row]), bool(truncated[row])))
                    since[row] = t + 1
        for row in np.flatnonzero(since < periods).tolist():
            chunks.append((row, int(since[row]), periods, self._now[row], False, False))
        stacked = {name: np.stack(values) for name, values in columns.items()}
        episodes = [self._make_chunk(stacked, *chunk) for chunk in chunks]
        self._log_env_steps(metric=self._metrics_num_env_steps_sampled, num_steps=periods * self.num_envs)
        self._increase_sampled_metrics(periods * self.num_envs, sum(one.is_done for one in episodes))
        return episodes

    def _choose_actions(self, explore: bool) -> dict[str, np.ndarray]:
        """Actions of all rows and what the learner wants to know of them."""
        module: Any = self.module
        forward = module.forward_exploration if explore else module.forward_inference
        kind = module.get_exploration_action_dist_cls() if explore else module.get_inference_action_dist_cls()
        with torch.no_grad():
            inputs = forward({Columns.OBS: torch.as_tensor(self._now)})[Columns.ACTION_DIST_INPUTS]
            choice = kind.from_logits(inputs) if explore else kind.from_logits(inputs).to_deterministic()
            actions = choice.sample()
            logp = choice.logp(actions) if explore else torch.zeros(len(actions))
        decided = {Columns.ACTIONS: actions, Columns.ACTION_DIST_INPUTS: inputs, Columns.ACTION_LOGP: logp}
        return {name: values.numpy() for name, values in decided.items()}

    def _make_chunk(
        self,
        columns: dict[str, np.ndarray],
        row: int,
        first: int,
        stop: int,
        last: np.ndarray,
        terminated: bool,
        truncated: bool,
    ) -> SingleAgentEpisode:
        """Part of an episode, as RLlib has it."""
        own = {name: values[first:stop, row] for name, values in columns.items()}
        extra = {name: own[name] for name in (Columns.ACTION_DIST_INPUTS, Columns.ACTION_LOGP)}
        extra[WEIGHTS_SEQ_NO] = np.full(stop - first, self._weights_seq_no)
        arrays: dict[str, Any] = {  # where lists are declared
            "observations": np.concatenate([own[Columns.OBS], last[None]]),
            "actions": own[Columns.ACTIONS],
            "rewards": own[Columns.REWARDS],
        }
        chunk = SingleAgentEpisode(
            self._ids[row],
            **arrays,
            infos=[{}] * (stop - first + 1),
            extra_model_outputs=extra,
            terminated=terminated,
            truncated=truncated,
            t_started=int(self._started[row]),
            len_lookback_buffer=0,
        )
        self._started[row] += stop - first
        self._sums[row] += own[Columns.REWARDS].sum()
        if chunk.is_done:
            self._log_episode_metrics(int(self._started[row]), float(self._sums[row]), 0.0)
            self._started[row], self._sums[row], self._ids[row] = 0, 0.0, uuid.uuid4().hex
        return chunk
