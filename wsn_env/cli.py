"""The command `wsn`, also `python -m wsn_env`: evaluate, benchmark, train, replay, calibrate, reproduce, compile."""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from wsn_env.envs.registration import STANDARD
from wsn_env.evaluation.files import alone_in
from wsn_env.evaluation.progress import progress_bar
from wsn_env.evaluation.rollout import Engine
from wsn_env.models.own import own_error, own_place
from wsn_env.models.recordings.files import DatasetWarning
from wsn_env.reports.terminal import NOBODY_READS, any_terminal
from wsn_env.scenario import Scenario
from wsn_env.scenario.options import make_scenario
from wsn_env.training.settings import Training

FILES = (  # that commands write into their folders
    "report.html evaluation.blocks.jsonl evaluation.csv evaluation.json evaluation.md front.csv front.json front.png"
    " tracks.csv tracks.json tracks.md tracks.png benchmark.md benchmark.csv"
    " calibration.json calibration.md calibration.png"
).split()


@dataclass
class Evaluate:
    """Compare policies on common random episodes: a table, and evaluation.csv, .json and .md; with --pareto their
    fronts."""

    scenario: str = "PreDC-v0"
    """Scenario id."""
    policies: list[str] = field(default_factory=lambda: ["pre_dc", "centroid", "static_cluster"])
    """Policies by name, FILE.py:CLASS, or paths of a saved policy.json, also as label=path; parameters after a colon.
    The first is the reference of the differences."""
    lam: list[float] | None = None
    """Trade-offs between error and energy [m/mJ]; left out: the scenario's, or with --pareto nine about it."""
    pareto: bool = False
    """The fronts of error against energy over the lams, their hypervolumes with paired differences, and front.csv,
    .json and .png. Name the policy of interest first: it is compared with each other and with all others together."""
    episodes: int = 100
    """Episodes for each policy and lam; of a recorded dataset, filter seeds for each track."""
    seed: int = 0
    """Which episodes: evaluation seeds are 2^31 + seed * 10^5 + episode."""
    tracks: list[Path] = field(default_factory=list)
    """CSV files of recorded motion (t, x, y in s and m) instead of the scenario's motion. With Ble-v0 the folder of a
    published Bluetooth dataset: each track is replayed, calibrated on the others (or by --set calibration=FILE)."""
    set: list[str] = field(default_factory=list)
    """Scenario quantities, as name=value: nodes=400 particles=1000 tracker=ekf."""
    engine: Literal["local", "ray"] = "local"
    """Where the episodes are played: in this process, or as tasks of a Ray cluster. The rows are the same."""
    address: str | None = None
    """Of a running Ray cluster, such as auto or HOST:6379; left out: one on this machine."""
    out: Path | None = None
    """Folder for the files; left out: only the table. A run that was stopped continues from it."""


@dataclass
class Benchmark:
    """The standard benchmark: every scenario at its trade-offs, on 1,000 fixed episodes each. A score a scenario, 0 for
    random choices and 1 for the best policy known, and a table to paste."""

    policy: list[str]
    """Policies, as for evaluate."""
    scenarios: list[str] = field(default_factory=lambda: list(STANDARD))
    """Which; an aggregate is of all."""
    episodes: int = 1000
    """How many of the 1,000, a multiple of 50: for a first look."""
    engine: Literal["local", "ray"] = "local"
    """As for evaluate."""
    address: str | None = None
    """As for evaluate."""
    out: Path = Path("out/benchmark")
    """Folder for benchmark.md, benchmark.csv and each scenario's rows. A run that was stopped continues from it."""


@dataclass
class Replay:
    """An episode as a page to play: one self-contained HTML file, one policy or two on the same random numbers."""

    policy: list[str]
    """One policy or two, as for evaluate."""
    scenario: str = "PreDC-v0"
    """Scenario id."""
    seed: int = 2**31
    """Of the episode: that of `reset(seed=...)`, and of the rows of an evaluation."""
    lam: float | None = None
    """Trade-off [m/mJ]; left out: the scenario's."""
    set: list[str] = field(default_factory=list)
    """Scenario quantities, as name=value."""
    recording: Path | None = None
    """With Ble-v0 a recorded track (*.mbd), calibrated on the others of its folder if there are any."""
    out: Path = Path("replay.html")
    """The page."""


@dataclass
class Calibrate:
    """Fit receivers, noise and losses to recorded Bluetooth tracks: parameter files for --set calibration=FILE, and a
    report."""

    tracks: Path
    """Folder of the published format: tetam.dev and *.mbd."""
    out: Path
    """Folder for calibration.json, without_TRACK.json for each track left out, calibration.md and .png."""
    leave_out: str | None = None
    """Calibrate without this track only; left out: all together, and without each one."""
    maps: bool = False
    """Maps of what each receiver's level is off by, too (Gaussian process regression)."""


@dataclass
class Reproduce:
    """Rebuild a published system's tables and figures, with a verdict for each of its claims."""

    paper: Annotated[str, tyro.conf.Positional]
    """Which: pre_dc, binary, grnn, underwater; all: each into a folder of its own."""
    out: Path
    """Folder for the tables and pictures; papers share names of files, so give each one of its own."""
    runs: int = 100
    """Monte Carlo runs a cell."""


@dataclass
class Compile:
    """Compile all kernels now and keep them, so that nothing has to wait for it later."""


def main(arguments: list[str] | None = None, prog: str = "wsn") -> int:
    """Run a command; bad input is one line on stderr and exit status 2, Ctrl-C is 130.

    Args:
        arguments: of the command line; None: the process's.
        prog: what messages begin with.
    """
    commands: dict[str, tuple[Any, Callable[[Any], None]]] = {
        "evaluate": (Evaluate, run_evaluate),
        "benchmark": (Benchmark, run_benchmark),
        "train": (Training, run_train),
        "replay": (Replay, run_replay),
        "calibrate": (Calibrate, run_calibrate),
        "reproduce": (Reproduce, run_reproduce),
        "compile": (Compile, run_compile),
    }
    kinds, runs = {name: kind for name, (kind, _) in commands.items()}, dict(commands.values())
    command: Any = None
    try:
        with any_terminal():
            command = tyro.extras.subcommand_cli_from_dict(kinds, prog="wsn", args=arguments)
            folder = command.out if isinstance(command, (Evaluate, Benchmark, Calibrate)) else None
            with warnings_on_one_line(), nullcontext() if folder is None else alone_in(folder, FILES):
                runs[type(command)](command)
    except BrokenPipeError:
        return NOBODY_READS
    except (ValueError, OSError, MemoryError) as problem:
        print(f"{prog}: {own_place(problem)}{problem}", file=sys.stderr)
        return 2
    except Exception as problem:
        if not own_place(problem):
            raise
        print(f"{prog}: {own_error(problem)}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        more = ""
        if isinstance(command, Training):
            more = f"; the same command with --resume continues {command.folder}"
        elif isinstance(command, (Evaluate, Benchmark)) and command.out:
            more = "; the same command continues where it was"
        print(f"{prog}: stopped{more}", file=sys.stderr)
        return 130
    return 0


@contextmanager
def warnings_on_one_line() -> Iterator[None]:
    """What a recording must say is a line on stderr, above the table; other warnings are shown as ever."""
    with warnings.catch_warnings():
        others = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *place: Any) -> None:
            if issubclass(category, DatasetWarning):
                print(f"wsn: {message}", file=sys.stderr)
            else:
                others(message, category, *place)

        warnings.showwarning = show  # type: ignore[assignment]
        yield


def engine_of(command: Evaluate | Benchmark) -> Engine | None:
    """Where the episodes are played.

    Raises:
        ValueError: an address without a cluster.
    """
    from wsn_env.evaluation.ray_engine import on_ray

    if command.address and command.engine != "ray":
        raise ValueError(f"--address {command.address}: only with --engine ray")
    return on_ray(command.address) if command.engine == "ray" else None


def run_evaluate(command: Evaluate) -> None:
    """`wsn evaluate`."""
    from wsn_env.evaluation.comparison import evaluate
    from wsn_env.evaluation.front import check_front_libraries, lam_sweep
    from wsn_env.evaluation.kept_blocks import remove_kept_blocks
    from wsn_env.evaluation.policies import named_policies
    from wsn_env.reports.front_tables import FRONT_FILES, save_and_print_fronts
    from wsn_env.reports.pages.evaluation_page import write_report
    from wsn_env.reports.pictures import can_draw
    from wsn_env.reports.tables import print_tables, save_markdown

    engine = engine_of(command)
    if command.tracks and Scenario.named(command.scenario).measurement.lasting_errors:
        run_evaluate_recorded(command)
        return
    scenario = make_scenario(command.scenario, command.set, command.tracks)
    lams: Sequence[float] | None = command.lam
    if command.pareto:
        check_front_libraries(pictures=command.out is not None)
        lams = lams or lam_sweep(scenario)
    policies = named_policies(command.policies, scenario)
    with progress_bar() as progress:
        evaluation = evaluate(
            policies,
            scenario,
            lams,
            command.episodes,
            command.seed,
            keep=command.out,
            progress=progress,
            engine=engine,
        )
    names: list[str] = []
    if command.out:  # first: whatever the terminal is, nothing is lost
        evaluation.save(command.out)
        save_markdown(evaluation, command.out)
        names = ["evaluation.csv", "evaluation.json", "evaluation.md", *(FRONT_FILES if command.pareto else ())]
        if can_draw():
            with progress_bar() as progress:
                names.append(write_report(command.out, evaluation, policies, progress=progress).name)
    if command.pareto:
        save_and_print_fronts(evaluation, command.out)
    else:
        print_tables(evaluation)
    if command.out:
        remove_kept_blocks(command.out)
        print(f"written: {', '.join(str(command.out / name) for name in names)}")


def run_benchmark(command: Benchmark) -> None:
    """`wsn benchmark`."""
    from wsn_env.evaluation.kept_blocks import remove_kept_blocks
    from wsn_env.evaluation.policies import named_policies
    from wsn_env.evaluation.standard import play_standard, scores, standard_scenario
    from wsn_env.reports.standard_tables import print_standard, save_standard

    engine = engine_of(command)
    for name in command.scenarios:  # before anything is played
        named_policies(command.policy, standard_scenario(name))
    evaluations = []
    for name in command.scenarios:
        with progress_bar() as progress:
            evaluation = play_standard(command.policy, name, command.episodes, command.out / name, progress, engine)
        evaluation.save(command.out / name)
        evaluations.append(evaluation)
    found = scores(evaluations)
    written = save_standard(found, command.out)
    print_standard(found)
    for name in command.scenarios:
        remove_kept_blocks(command.out / name)
    print(f"written: {', '.join(map(str, written))}")


def run_train(command: Training) -> None:
    """`wsn train`."""
    try:
        from wsn_env.training.trainer import train
    except ImportError as problem:
        raise ValueError(f"train: pip install 'wsn_env[train]' ({problem})") from None
    train(command)


def run_evaluate_recorded(command: Evaluate) -> None:
    """`wsn evaluate --scenario Ble-v0 --tracks FOLDER`."""
    from wsn_env.bluetooth.recorded_evaluation import evaluate_recorded, remove_recorded_blocks
    from wsn_env.reports.pages.recorded_page import write_recorded_report
    from wsn_env.reports.pictures import can_draw
    from wsn_env.reports.recorded_tables import print_recorded_tables, save_recorded

    if command.pareto or len(command.tracks) != 1:
        raise ValueError("--tracks: must be one folder with tetam.dev and *.mbd, without --pareto")
    with progress_bar() as progress:
        evaluation = evaluate_recorded(
            command.policies,
            make_scenario(command.scenario, command.set, []),
            command.tracks[0],
            command.lam,
            command.episodes,
            command.seed,
            keep=command.out,
            progress=progress,
            engine=engine_of(command),
            calibrated=any(pair.startswith("calibration=") for pair in command.set),
        )
    names: list[str] = []
    if command.out:
        names = save_recorded(evaluation, command.out)
        if can_draw():
            with progress_bar() as progress:
                names.append(write_recorded_report(command.out, evaluation, command.policies, progress).name)
        remove_recorded_blocks(command.out)
    print_recorded_tables(evaluation)
    if command.out:
        print(f"written: {', '.join(str(command.out / name) for name in names)}")


def run_replay(command: Replay) -> None:
    """`wsn replay`."""
    from wsn_env.bluetooth.recorded_evaluation import replay_scenario
    from wsn_env.reports.pages.replay_page import replay

    lam = {} if command.lam is None else {"lam": command.lam}
    scenario = make_scenario(command.scenario, command.set, [], **lam)
    if command.recording:
        calibrated = any(pair.startswith("calibration=") for pair in command.set)
        scenario = replay_scenario(scenario, command.recording, calibrated)
    recording = replay(command.policy, scenario, command.seed, command.out)
    for episode in recording.episodes:
        print(f"{episode.policy}: RMS {episode.rms_m:.3f} m, {episode.energy_mj:.4g} mJ a time step")
    print(f"written: {command.out} ({command.out.stat().st_size / 1000:.0f} kB)")


def run_calibrate(command: Calibrate) -> None:
    """`wsn calibrate`."""
    from wsn_env.bluetooth.calibration_files import calibrate_with_and_without, save_calibrations
    from wsn_env.models.recordings.dataset import read_dataset
    from wsn_env.reports.calibration_tables import CALIBRATION_FILES, print_calibration, save_calibration_report
    from wsn_env.reports.tables import wide_console

    tracks = read_dataset(command.tracks)
    whole, parts = calibrate_with_and_without(tracks, command.leave_out)
    shown = [whole, *(part for part in parts if command.leave_out in (None, part.left_out))]
    names = save_calibrations(tracks, shown, command.out, command.maps)
    save_calibration_report(tracks, whole, parts, command.out)
    print_calibration(whole, parts)
    written = f"{command.out}: {', '.join([*names, *CALIBRATION_FILES])}"
    wide_console().print(written, markup=False, highlight=False)


def run_reproduce(command: Reproduce) -> None:
    """`wsn reproduce`."""
    from wsn_env.papers import reproduce

    reproduce(command.paper, command.out, command.runs)


def run_compile(command: Compile) -> None:
    """`wsn compile`."""
    from wsn_env.compiled.store import check_store, store_folder
    from wsn_env.evaluation.warm_up import compile_everything

    check_store()
    started = time.perf_counter()
    with progress_bar() as report:
        count = compile_everything(report)
    print(f"{count} kernels compiled in {time.perf_counter() - started:.0f} s; they are in {store_folder()}")
