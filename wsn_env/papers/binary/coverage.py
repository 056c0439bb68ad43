"""What of Zhou, Cheng & Xing (2009) is rebuilt, and where."""

from wsn_env.papers.coverage import Item

COVERAGE: tuple[Item, ...] = (
    # the network
    Item("sensing model: one bit, 1 within R", "`wsn_env/models/measurement/binary.py`, a hard disc", "covered"),
    Item(
        "boundary node: its bit has changed since the last time step; no other transmits",
        "`wsn_env/models/measurement/binary.py`, reports='changes'",
        "covered",
    ),
    Item(
        "the sink and what it knows",
        "it keeps the bitmap of the bits last reported, `wsn_env/models/measurement/binary.py`",
        "interpreted",
    ),
    Item(
        "assumption: all nodes have the same R",
        "eqs. 3-8 need it, since R is to drop out; radii that differ, known or not: `unequal.csv`,"
        " `wsn_env/models/detection/unequal.py`",
        "interpreted",
    ),
    Item(
        "assumption: all nodes awake, in step",
        "all nodes in every trial, `wsn_env/papers/binary/systems.py`",
        "covered",
    ),
    Item(
        "assumption: every bit is right and every report arrives",
        "all tables but `faults.csv`, which shows what it hangs on",
        "covered",
    ),
    # the fix
    Item(
        "eqs. 3-5, 7, 8: differences of the nodes' circles, by linear least squares",
        "all pairs of boundary nodes, `wsn_env/filters/least_squares.py`; other choices of pairs: `readings.csv`",
        "interpreted",
    ),
    Item(
        "eq. 6: the right-hand side",
        "its last row with the minus signs that the print lacks, `wsn_env/papers/binary/readings.py`",
        "interpreted",
    ),
    Item(
        "section 3.2: a fix is moved on by half a period of v",
        "by + (T/2) v for nodes entered and left alike, `wsn_env/filters/boundary.py`; other signs: `readings.csv`",
        "interpreted",
    ),
    Item(
        "fewer than four boundary nodes",
        "the centroid of all nodes known to detect; without any, only the prediction, `wsn_env/filters/boundary.py`",
        "interpreted",
    ),
    # the recursion
    Item("eqs. 9, 10: constant velocity, a fix measures the position", "`wsn_env/filters/boundary.py`", "covered"),
    Item(
        "eq. 11: the prediction",
        "F x(k) on the right-hand side, where the print has x(k+1), `wsn_env/filters/boundary.py`",
        "interpreted",
    ),
    Item(
        "eqs. 12, 13: gain and covariance",
        "after P = F P F', `wsn_env/filters/boundary.py`; as printed: `readings.csv`, the last claim",
        "interpreted",
    ),
    Item(
        "start of the recursion",
        "the first fix, at rest, P0 = 1e4 I, no forgetting; its own velocity moves the next fix,"
        " `wsn_env/filters/boundary.py`",
        "interpreted",
    ),
    # the experiments
    Item(
        "setting: 600 nodes in 500 m x 500 m, R = 60 m, T = 1 s, the target from (0, 500) m at (10, -10) m/s, 100 runs",
        "`wsn_env/papers/binary/systems.py`",
        "covered",
    ),
    Item(
        "what counts as the steady part",
        "15 to 40 s, the whole disc inside the field, `wsn_env/papers/binary/systems.py`",
        "interpreted",
    ),
    Item(
        "energy is the mean number of transmitting nodes per period (ANTNP)",
        "`nodes_antnp.csv`, `radius_antnp.csv`, `period_antnp.csv`; mJ beside it: `systems.csv`",
        "covered",
    ),
    Item(
        "the method compared with",
        "the mean of all nodes that detect, each of which reports in every time step; filtered, too: `systems.csv`",
        "covered",
    ),
    Item("figures before Fig. 3", "the geometry in words, `wsn_env/filters/boundary.py`", "lost in the source"),
    Item(
        "Figs. 3a-d: error and ANTNP over N, R and T",
        "which of them is a, b, c or d is not told: both over each, `nodes.png`, `radius.png`, `period.png`; error"
        " over time: `error.png`",
        "interpreted",
    ),
    Item(
        "the values of their curves",
        "only how they run, in the claims; ours: `nodes.csv`, `radius.csv`, `period.csv`",
        "lost in the source",
    ),
    # the claims
    Item("claim: boundary nodes locate better than the centroid", "`claims.csv`, `systems.csv`", "covered"),
    Item(
        "claims: the error falls with N and with R; the centroid's grows with R",
        "`claims.csv`, `nodes.csv`, `radius.csv`",
        "covered",
    ),
    Item("claim: fewer nodes transmit", "`claims.csv`, `systems.csv`", "covered"),
    Item(
        "lifetime of the network",
        "no figure; `claims.csv`: small batteries and random waypoints, until nodes have died",
        "interpreted",
    ),
    Item(
        "claims: ANTNP grows slowly with N and R, the centroid's steeply",
        "`claims.csv`: slowly by number and by factor, `nodes_antnp.csv`, `radius_antnp.csv`",
        "interpreted",
    ),
    Item("claims: ANTNP grows with T, the centroid's does not", "`claims.csv`, `period_antnp.csv`", "covered"),
    Item(
        "claim: from T = 3.5 s on the centroid is better",
        "by RMS, the filter started at the edge or inside: `claims.csv`, `crossings.csv`",
        "interpreted",
    ),
    Item("its explanation: long periods blur the fixes", "`claims.csv`, `crossings.csv`", "covered"),
)
