"""Plays an evaluation's blocks as tasks of a Ray cluster. Needs the extra `ray`."""

from __future__ import annotations

import logging
import socket
import sys
from collections.abc import Iterator, Sequence
from types import ModuleType
from typing import TYPE_CHECKING, Any

from wsn_env.evaluation.rollout import Block, Engine, in_this_process
from wsn_env.models.own_files import OF_FILES, add_noted, noted_files, watch

if TYPE_CHECKING:
    from ray import ObjectRef

AHEAD = 4  # tasks a core that wait their turn
PATIENCE_S = 5.0


def on_ray(address: str | None = None) -> Engine:
    """A core a block, spread over the nodes; one lost with a worker or a node is played again elsewhere.

    Every node must have this package in the same version. What it plays is made of the block alone, so the rows are
    those of a single process, whatever the number of workers and whoever was killed.

    Args:
        address: of a running cluster, such as "auto" or "HOST:6379"; None: one on this machine, for this evaluation.

    Raises:
        ValueError: without Ray, or with nobody at the address.
    """
    try:
        import ray
    except ImportError:
        raise ValueError("engine 'ray': Ray is not installed: pip install 'wsn_env[ray]'") from None

    def play(blocks: Sequence[Block]) -> Iterator[tuple[Block, list[dict[str, float]]]]:
        ours = not ray.is_initialized()
        if ours:
            connect(address)
        try:
            yield from _play_blocks(ray, blocks)
        finally:
            if ours:
                ray.shutdown()

    return play


def connect(address: str | None) -> None:
    """Join the cluster at an address, or begin one on this machine.

    Raises:
        ValueError: with nobody at the address. Ray itself would try for minutes.
    """
    import ray

    allowed = "must be HOST:PORT, ray://HOST:PORT, or auto for one that runs on this machine"
    if address not in (None, "auto"):
        host, _, port = address.removeprefix("ray://").rpartition(":")
        try:
            socket.create_connection((host, int(port)), timeout=PATIENCE_S).close()
        except (OSError, ValueError) as problem:
            raise ValueError(f"engine 'ray': nobody answers at {address!r} ({problem}): {allowed}") from None
    try:
        ray.init(address or "local", log_to_driver=False, logging_level=logging.ERROR)
    except ConnectionError as problem:
        raise ValueError(f"engine 'ray': no cluster at {address!r} ({problem}): {allowed}") from None


def _play_blocks(ray: ModuleType, blocks: Sequence[Block]) -> Iterator[tuple[Block, list[dict[str, float]]]]:
    for module in {type(block.policy).__module__ for block in blocks}:
        if module.startswith(OF_FILES):  # which workers cannot import
            ray.cloudpickle.register_pickle_by_value(sys.modules[module])
    task = ray.remote(num_cpus=1, max_retries=-1, scheduling_strategy="SPREAD")(_measure_block)
    waiting = list(reversed(blocks))
    running: dict[ObjectRef[Any], Block] = {}
    while waiting or running:
        most = AHEAD * max(1, int(ray.cluster_resources().get("CPU", 1)))
        while waiting and len(running) < most:
            block = waiting.pop()
            running[task.remote(block)] = block
        for done in ray.wait(list(running))[0]:
            try:
                measured, files = ray.get(done)
            except ray.exceptions.RayTaskError as problem:  # the policy's or the world's own error
                raise problem.cause from None
            block = running.pop(done)
            add_noted(type(block.policy).__module__, files)
            yield block, measured


def _measure_block(block: Block) -> tuple[list[dict[str, float]], dict[str, str]]:
    """What `rollout` measured, and the digests of what own code has read for it."""
    module = type(block.policy).__module__
    watch(module)
    return next(in_this_process(threads=1)([block]))[1], noted_files([module])
