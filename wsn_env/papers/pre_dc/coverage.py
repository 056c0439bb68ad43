"""What of Xiang & Guo (2013) is rebuilt, and where."""

from wsn_env.papers.coverage import Item

COVERAGE = (
    Item(
        "Table 1: field, nodes, period, particles, radius, thresholds, energies",
        "defaults of `wsn_env/scenario/presets/PreDC_v0.py`, `wsn_env/models/detection/radius.py`,"
        " `wsn_env/models/radio/radio.py`, `agents/pre_dc.py`",
        "covered",
    ),
    Item(
        "eq. 1: received strength",
        "measurements of their own: the power in `wsn_env/models/measurement/rssi_power.py`, in dB in"
        " `wsn_env/models/measurement/rssi.py`; here it names a head (step a)",
        "covered",
    ),
    Item(
        "eqs. 2-3: detection probability p(d)",
        "`wsn_env/models/detection/radius.py`; picture `detection.png`, three values in `expected.csv`",
        "covered",
    ),
    Item(
        "eq. 4: joint detection probability", "`wsn_env/scenario/sensing.py`; two values in `expected.csv`", "covered"
    ),
    Item(
        "eq. 5: energy of a bit",
        "`wsn_env/models/radio/radio.py`; the sender pays e1 + e2 d², the receiver e_r, each from its own battery",
        "covered",
    ),
    Item(
        "eqs. 6, 8: motion and its noise",
        "`wsn_env/models/motion/prediction.py`; the noise is an acceleration, G a with G = (T²/2, T) an axis",
        "interpreted",
    ),
    Item(
        "eq. 7: measurement",
        "`wsn_env/models/measurement/position.py`; each node that detects measures a position, with noise of its own",
        "interpreted",
    ),
    Item(
        "eqs. 9-13, 15: particle filter of a cluster",
        '`wsn_env/filters/particle.py`, `wsn_env/filters/kernels.py`; fusion="pooled": each member weighs its share of'
        ' the particles, the head pools the sums. fusion="joint", which weighs every particle with all reports, is'
        " shown beside it",
        "covered",
    ),
    Item(
        "eq. 14: resampling below N_eff = 2N/3",
        "`wsn_env/filters/kernels.py`, `wsn_env/filters/resampling.py`; systematic; the head's broadcast costs energy",
        "covered",
    ),
    Item(
        "eq. 16: prediction and its uncertainty E",
        "`wsn_env/models/motion/prediction.py`; as printed it leaves out the spread of the particles, so that E would"
        " be constant and never exceed Φ0: we take the total covariance",
        "interpreted",
    ),
    Item("eq. 17: RMS of a run", "`wsn_env/papers/rollout.py`", "covered"),
    Item(
        "step a: nodes exchange strength and distance to find the head",
        "`wsn_env/simulation/search.py`; the exchange costs no energy here. After a search the node with the strongest"
        " (noisy) received signal leads. The experiments start with a known target, so that the node nearest to the"
        " prediction leads first",
        "interpreted",
    ),
    Item(
        "the steps between a and g",
        "in the order of the flow chart, `wsn_env/papers/pre_dc/flow_chart.py`, with the equations that they use",
        "lost in the source",
    ),
    Item(
        "step g: when a cluster is kept",
        "`agents/pre_dc.py`; E < Φ0, and the joint probability at the prediction at least θ: with Φ0 alone a cluster"
        " is kept although the target has left it (a row of `same_tracker.md`)",
        "interpreted",
    ),
    Item(
        "a new cluster that cannot reach θ",
        "`agents/pre_dc.py`; every node with p > 0 joins; a head needs the energy of a handover and one time step",
        "interpreted",
    ),
    Item(
        "handover: the estimate, or the particles",
        "`wsn_env/models/radio/base.py`; the text has both, `handover` chooses; here the estimate",
        "interpreted",
    ),
    Item(
        "assumption d: a collided packet is sent again, three times at most",
        "`retries` of `wsn_env/models/radio/base.py`; every try costs. In these experiments no packet collides",
        "covered",
    ),
    Item(
        "assumptions a-c",
        "as in the simulator: nodes stand still, know where they are, keep one clock and reach any head in one hop;"
        " `wsn_env/simulation/period.py`",
        "lost in the source",
    ),
    Item(
        "lost tracks",
        "the text is silent; the search of `wsn_env/simulation/search.py`, off for Table 2",
        "interpreted",
    ),
    Item(
        "noise, q, track and start of the experiments",
        "the text leaves them open; `wsn_env/papers/pre_dc/systems.py` has the values under which all rows of Table 2"
        " come out",
        "interpreted",
    ),
    Item(
        "the static-cluster system",
        "every node awake, a plain mean without memory; its energy in three readings, `energy.md`",
        "interpreted",
    ),
    Item(
        "the EKF system",
        "the two nodes nearest to the prediction; q = 0.03 m/s² fitted, and Pre-DC's own on two and three nodes",
        "interpreted",
    ),
    Item("Table 2: RMS of three systems at four densities", "`table2.md`, paired in `against_ekf.md`", "covered"),
    Item("claim: static-cluster has the largest error", "`claims.md`", "covered"),
    Item("claim: Pre-DC has the lowest error", "`claims.md`; `against_ekf.md`", "covered"),
    Item("claim: more nodes lower the error", "`claims.md`; `table2.md`", "covered"),
    Item(
        "a sentence under Table 2",
        "it contradicts the table's figures; the figures are taken (`wsn_env/papers/pre_dc/expected.py`)",
        "interpreted",
    ),
    Item(
        "Fig. 1: the cluster at k = 50",
        "`fig1.png`, `wsn_env/papers/pre_dc/cluster.py`; the first run of our fields",
        "covered",
    ),
    Item("Fig. 2: flow chart", "`fig2.png`; the steps as built", "covered"),
    Item("Fig. 3: error over time", "`fig3.png`", "covered"),
    Item(
        "claim: Pre-DC is steadier than the others",
        "`claims.md`; the error's sd over the time steps, `systems.md`",
        "interpreted",
    ),
    Item("Fig. 4: energy over time", "`fig4.png`", "covered"),
    Item(
        "claim: 30 to 50 % of static-cluster's energy",
        "`claims.md`; of reports alone and of a static cluster with the same tracker, `energy.md`",
        "interpreted",
    ),
    Item(
        "lifetime of the network",
        "no figure; `lifetime.md`: small batteries and random waypoints, until the target is lost for good",
        "interpreted",
    ),
    Item(
        "Fig. 5: four trajectories",
        "`fig5.png`; a diagonal, a sine, a circle and random turns",
        "interpreted",
    ),
    Item("Fig. 6: error on them", "`fig6.png`", "covered"),
    Item(
        "claim: the error is stable on every trajectory",
        "`claims.md`; in time on each track, and in level across tracks, `stability.md`",
        "interpreted",
    ),
    Item("Figs. 7-8: error in x and y by particles", "`fig7.png`, `fig8.png`; `particles.md`", "covered"),
    Item("claim: 5,000 particles are optimal", "`claims.md`; what they gain over fewer, `particles.md`", "covered"),
)
