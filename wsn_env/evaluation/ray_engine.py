"""Plays an evaluation's blocks as tasks of a Ray cluster. Needs the extra `ray`."""

from __future__ import annotations

import logging
import os
import socket
from collections.abc import Callable, Iterator, Sequence
from types import ModuleType
from typing import TYPE_CHECKING, Any

from wsn_env.evaluation.rollout import Block, Engine, in_this_process
from wsn_env.evaluation.versions import sources_digest, versions
from wsn_env.models.own import own_modules, own_place
from wsn_env.models.own_files import add_noted, noted_files, watch

if TYPE_CHECKING:
    from ray import ObjectRef

Measurement = tuple[list[dict[str, float]], dict[str, str]]

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
    except RuntimeError as problem:  # another version of Python or of Ray
        told = " ".join(str(problem).split())
        raise ValueError(f"engine 'ray': cannot join the cluster at {address!r}: {told}") from None


def send_own_code(ray: ModuleType) -> None:
    """Send the code of files given by path along with what is made of it: workers cannot import it."""
    for module in own_modules():
        ray.cloudpickle.register_pickle_by_value(module)


def _play_blocks(ray: ModuleType, blocks: Sequence[Block]) -> Iterator[tuple[Block, list[dict[str, float]]]]:
    send_own_code(ray)
    task = ray.remote(num_cpus=1, max_retries=-1, scheduling_strategy="SPREAD")(_task(os.getcwd(), software()))
    waiting = list(reversed(blocks))
    running: dict[ObjectRef[Any], Block] = {}
    while waiting or running:
        _check_cluster(ray)
        most = AHEAD * max(1, int(ray.cluster_resources().get("CPU", 1)))
        while waiting and len(running) < most:
            block = waiting.pop()
            running[task.remote(ray.cloudpickle.dumps(block))] = block
        for done in ray.wait(list(running), timeout=PATIENCE_S)[0]:
            try:
                measured, files = ray.get(done)
            except ray.exceptions.RayTaskError as problem:  # the policy's or the world's own error
                raise problem.cause from None
            except ray.exceptions.RayError as problem:
                raise _lost(str(problem).partition("\n")[0]) from None
            block = running.pop(done)
            add_noted(type(block.policy).__module__, files)
            yield block, measured


def _check_cluster(ray: ModuleType) -> None:
    """See that the cluster's head still answers: without it Ray ends this process after a minute, in words of its own.

    Raises:
        ValueError: it does not.
    """
    if ray.util.client.ray.is_connected():  # through a proxy, which tells by itself
        return
    host, _, port = ray.get_runtime_context().gcs_address.rpartition(":")
    try:
        socket.create_connection((host, int(port)), timeout=PATIENCE_S).close()
    except OSError as problem:
        raise _lost(f"its head does not answer: {problem.strerror or problem}") from None


def _lost(why: str) -> ValueError:
    kept = "finished blocks are kept where there is a folder for them, and the same command continues"
    return ValueError(f"engine 'ray': the cluster is lost ({why}); {kept}")


def software() -> dict[str, str]:
    """What driver and workers must have in common."""
    return versions() | {"sources of wsn_env": sources_digest()[:12]}


def _task(folder: str, ours: dict[str, str]) -> Callable[[bytes], Measurement]:
    """What a worker does with a block. It is sent by value, and looks at the versions before it opens the block.

    Args:
        folder: of the driver, where relative paths begin.
        ours: the driver's software.
    """

    def measure(sent: bytes) -> Measurement:
        import pickle
        import socket

        try:
            from wsn_env.evaluation.ray_engine import join_driver, measure_block
        except ImportError as problem:
            node = f"the node {socket.gethostname()} has another wsn_env, or none ({problem})"
            raise ValueError(f"engine 'ray': {node}: must be the same on every node") from None
        join_driver(folder, ours)
        return measure_block(pickle.loads(sent))

    return measure


def join_driver(folder: str, ours: dict[str, str]) -> None:
    """On a worker: into the driver's folder, where relative paths begin, if there is one of that name.

    Raises:
        ValueError: this machine has another software than the driver's.
    """
    theirs = software()
    other = [f"{name} {theirs.get(name)} instead of {ours[name]}" for name in ours if theirs.get(name) != ours[name]]
    if other:
        node = f"the node {socket.gethostname()} has {', '.join(other)}"
        raise ValueError(f"engine 'ray': {node}: must be the same on every node")
    if os.path.isdir(folder):
        os.chdir(folder)


def measure_block(block: Block) -> Measurement:
    """What `rollout` measures, and the digests of what own code has read; an error there carries its place along."""
    module = type(block.policy).__module__
    watch(module)
    try:
        return next(in_this_process(threads=1)([block]))[1], noted_files([module])
    except Exception as problem:
        problem.add_note(own_place(problem))  # tracebacks do not travel
        raise
