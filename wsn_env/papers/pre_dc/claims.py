"""What Xiang & Guo (2013) claim, what is expected of our reading, and how both are judged from the figures measured.

A difference counts when it exceeds two standard errors; differences between systems are paired where both have played
the same runs.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wsn_env.papers.claim import Claim, Expectation, judge_claim
from wsn_env.papers.pre_dc.systems import MOTIONS, NODES, PARTICLES, Results
from wsn_env.papers.rollout import Record, exceeds, keeps_falling
from wsn_env.scenario import Scenario
from wsn_env.scenario.sensing import detection_probability, joint_detection_probability

STABLE = 1.25  # the error is stable while no later quarter of a run exceeds the first by this factor
FLAT = 0.03  # an error that more particles change by less than this share is flat
CLEARLY = 0.8  # an energy below this share of another is clearly below it

_PAPER = {
    "static": (2.245, 1.992, 1.624, 1.457),
    "ekf": (1.017, 1.002, 0.976, 0.971),
    "pre_dc": (0.849, 0.847, 0.828, 0.789),
}
_EXPECTED = {  # from an independent implementation of our reading; 100 runs, static 300
    "static": (2.06, 1.86, 1.67, 1.45),
    "ekf": (1.029, 0.924, 0.883, 0.871),
    "pre_dc": (0.953, 0.914, 0.821, 0.818),
    "pre_dc_joint": (0.894, 0.780, 0.713, 0.713),
}
PAPER_RMS_M = {(name, n): rms for name, row in _PAPER.items() for n, rms in zip(NODES, row, strict=True)}
EXPECTED_RMS_M = {(name, n): rms for name, row in _EXPECTED.items() for n, rms in zip(NODES, row, strict=True)}
EXPECTED_SHARE, PAPER_SHARE = 0.08, 0.15  # tolerances of a cell
PROBABILITIES = ((8.0, 0.6, 1e-9), (10.0, 0.0812, 5e-5), (12.0, 0.0, 1e-9))  # distance m, p(d), tolerance


def list_expectations(results: Results) -> list[Expectation]:
    """Every expected figure: p(d), and each cell of Table 2 against our reading's and the paper's."""
    figures = [
        Expectation(f"p({d:g} m)", p, tolerance, float(detection_probability(d, Scenario())))
        for d, p, tolerance in PROBABILITIES
    ]
    three, two = joint_detection_probability([[0.6, 0.6, 0.6], [0.6, 0.6, 0.0]])
    figures += [
        Expectation("joint probability of three nodes with p = 0.6", 0.936, 1e-9, float(three)),
        Expectation("joint probability of two nodes with p = 0.6", 0.84, 1e-9, float(two)),
    ]
    rms = float(results.as_printed().rms_m().mean())
    figures.append(Expectation("RMS [m] of pre_dc at 225 nodes with Phi0 alone", 1.35, EXPECTED_SHARE * 1.35, rms))
    cluster, pre_dc = (results.same_tracker(name).energy_mj.mean() for name in ("static_cluster", "pre_dc"))
    figures.append(
        Expectation("energy of static_cluster over pre_dc's, same tracker", 4.0, 1.0, float(cluster / pre_dc))
    )
    for label, cells, share in (("our reading", EXPECTED_RMS_M, EXPECTED_SHARE), ("paper", PAPER_RMS_M, PAPER_SHARE)):
        for (name, nodes), rms in cells.items():
            measured = float(results.system_rms_m(name, nodes).mean())
            figures.append(Expectation(f"RMS [m] of {name} at {nodes} nodes, {label}", rms, share * rms, measured))
    return figures


def judge_claims(results: Results) -> list[Claim]:
    """Every claim, judged."""
    return [
        *_static_is_worst(results),
        *_pre_dc_is_best(results),
        *_more_nodes_help(results),
        _energy(results),
        *_stability(results),
        *_particles(results),
    ]


def _errors(results: Results, nodes: int) -> tuple[list[np.ndarray], list[np.ndarray], str, str]:
    """RMS of static, EKF, Pre-DC at a node count: with their own trackers, with one tracker, and both as text."""
    own = [results.system_rms_m(name, nodes) for name in _PAPER]
    common = [results.same_tracker(name, nodes).rms_m() for name in ("static_cluster", "nearest1", "pre_dc")]
    theirs = ", ".join(f"{PAPER_RMS_M[name, nodes]:.3f}" for name in _PAPER)
    ours = ", ".join(f"{rms.mean():.3f}" for rms in own) + " m; with one tracker "
    ours += ", ".join(f"{rms.mean():.3f}" for rms in common) + " m"
    return own, common, f"static, EKF, Pre-DC: {theirs} m", ours


def _static_is_worst(results: Results) -> Iterator[Claim]:
    for nodes in NODES:
        own, common, paper, ours = _errors(results, nodes)
        worst = [all(exceeds(static, other) for other in others) for static, *others in (own, common)]
        what = f"Table 2, {nodes} nodes: static-cluster has a larger error than EKF and Pre-DC"
        yield Claim(what, paper, ours, judge_claim(all(worst), worst[0]))


def _pre_dc_is_best(results: Results) -> Iterator[Claim]:
    for nodes in NODES:
        own, common, paper, ours = _errors(results, nodes)
        best = [all(exceeds(other, pre_dc) for other in others) for *others, pre_dc in (own, common)]
        what = f"Table 2, {nodes} nodes: Pre-DC has the lowest error"
        yield Claim(what, paper, ours, judge_claim(all(best), best[0]))


def _more_nodes_help(results: Results) -> Iterator[Claim]:
    for name, policy in (("static", "static_cluster"), ("ekf", "nearest1"), ("pre_dc", "pre_dc")):
        own = [results.system_rms_m(name, nodes) for nodes in NODES]
        common = [results.same_tracker(policy, nodes).rms_m() for nodes in NODES]
        falls = [keeps_falling(errors) for errors in (own, common)]
        paper = " > ".join(f"{PAPER_RMS_M[name, nodes]:.3f}" for nodes in NODES) + " m"
        ours = ", ".join(f"{rms.mean():.3f}" for rms in own) + " m; with one tracker "
        ours += ", ".join(f"{rms.mean():.3f}" for rms in common) + " m"
        what = f"Table 2: the error of {name} falls as nodes are added (81, 121, 169, 225)"
        yield Claim(what, paper, ours, judge_claim(all(falls), falls[0]))


def _energy(results: Results) -> Claim:
    """Fig. 4, against the static system's reports alone and against the static cluster with the same tracker."""
    ours = results.system("pre_dc").energy_mj.mean(axis=0)
    rivals = [
        results.same_tracker("static_cluster").energy_mj.mean(axis=0),
        results.system("static").report_mj.mean(axis=0),
    ]
    below = [bool(ours.mean() < CLEARLY * rival.mean() and (ours < rival).mean() >= 0.9) for rival in rivals]
    text = (
        f"{ours.mean():.3f} mJ a period; static {rivals[1].mean():.3f} mJ for reports alone, lower in "
        f"{(ours < rivals[1]).sum()} of {len(ours)} periods; static cluster with the same tracker "
        f"{rivals[0].mean():.3f} mJ, {rivals[0].mean() / ours.mean():.1f} times Pre-DC's"
    )
    what = "Fig. 4: the energy of Pre-DC in each period is clearly below that of static-cluster"
    return Claim(what, "below (a figure)", text, judge_claim(all(below), below[1]))


def quarters(record: Record) -> np.ndarray:
    """(4,) RMS over runs and periods of each quarter of the horizon [m]."""
    parts = np.array_split(record.square_error(), 4, axis=1)
    return np.array([np.sqrt(part.mean()) for part in parts])


def _stability(results: Results) -> Iterator[Claim]:
    for motion in MOTIONS:
        fitted, plain = (quarters(results.motion(motion, fitting)) for fitting in (True, False))
        stable = [bool(rms[1:].max() <= STABLE * rms[0]) for rms in (plain, fitted)]
        ours = "RMS by quarter of the run " + ", ".join(f"{rms:.2f}" for rms in fitted) + " m"
        ours += "; with q = 0.02 and no search " + ", ".join(f"{rms:.3g}" for rms in plain) + " m"
        what = f"Figs. 5-6: the error stays stable on the track '{motion}'"
        yield Claim(what, "stable (a figure)", ours, judge_claim(all(stable), stable[1]))


def _particles(results: Results) -> Iterator[Claim]:
    for axis, (figure, name) in enumerate((("Fig. 7", "x"), ("Fig. 8", "y"))):
        errors = {count: results.particles(count).axis_rms_m(axis) for count in PARTICLES}
        last = errors[PARTICLES[-1]].mean()
        flat_from = next(n for i, n in enumerate(PARTICLES) if all(_flat(errors[m], last) for m in PARTICLES[i:]))
        shown = ", ".join(f"{errors[n].mean():.3f} ({n})" for n in PARTICLES if n in (10, 100, 500, 1000, 5000, 10_000))
        ours = f"{shown} m; flat within {FLAT:.0%} from {flat_from} particles on"
        good = exceeds(errors[PARTICLES[0]], errors[5000]) and flat_from <= 5000
        what = f"{figure}: the error in {name} falls with the number of particles and flattens by about 5000"
        yield Claim(what, "falls, flat from about 5000 (a figure)", ours, judge_claim(good, good))


def _flat(errors: np.ndarray, last: float) -> bool:
    return abs(errors.mean() - last) <= FLAT * last
