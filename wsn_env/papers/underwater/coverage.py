"""What of patent CN103152791 is rebuilt, and where."""

from wsn_env.papers.coverage import Item

COVERAGE: tuple[Item, ...] = (
    Item(
        "step: the first head is the node with the strongest signal",
        '`wsn_env/simulation/search.py` (`start="search"`), table first_head. All others begin with a start known'
        " to 20 m and the node nearest to it: from the 11th time step on it makes no difference",
        "interpreted",
    ),
    Item(
        "step: every node within one hop of the head is a member",
        "`agents/strongest_signal.py`, `wsn_env/models/radio/modem.py`; a hop of 250 m is ours",
        "covered",
    ),
    Item(
        "step: a member sends what it observed when the signal exceeds a threshold",
        "`wsn_env/models/detection/threshold.py`, tables thresholds and energy; 85 dB is ours",
        "covered",
    ),
    Item(
        "step: the head estimates position and variance with a particle filter",
        "`wsn_env/filters/kernels.py`; weights of the levels, the estimate is read before resampling",
        "covered",
    ),
    Item(
        "step: improved resampling: of 2n copies 2(n - 1) are moved, in pairs by plus and minus one offset",
        '`spread_copies_alike` in `wsn_env/filters/resampling.py` (`resampling="common_spread"`), table resampling;'
        " half the sds of the particles' four components as spread, the j-th pair j times as far",
        "interpreted",
    ),
    Item(
        "an odd number of copies",
        "the parent once and pairs about it: `wsn_env/filters/resampling.py`",
        "interpreted",
    ),
    Item(
        "step: the head moves with the target to the node with the strongest signal",
        "`agents/strongest_signal.py`: the strongest signal *reported* in the time step before, which is what a network"
        " can know when it chooses; the target moves 10 m meanwhile",
        "interpreted",
    ),
    Item(
        "step: estimate and variance are sent to the next head, which goes on with them",
        "`redraw_on_handover` in `wsn_env/scenario/tracking.py`, table handover; velocity and covariance with them",
        "covered",
    ),
    Item(
        "step: until the target leaves the network's range",
        "`ends_outside` in `wsn_env/scenario/scenario.py`, table leaving; the range is the field. All others keep"
        " the target inside",
        "covered",
    ),
    Item("claim: particle degeneracy is avoided", "table claims", "covered"),
    Item("claim: tracking performance is improved", "table claims, picture error", "covered"),
    Item(
        "assumption: the received signal",
        "`wsn_env/models/measurement/sonar.py`, `wsn_env/models/acoustics.py`, table acoustics: the sonar equation with"
        " Thorp's absorption, 120 dB at the source, noise of 3 dB",
        "interpreted",
    ),
    Item(
        "assumption: the motion",
        "`wsn_env/models/motion/cruise.py`: nearly constant velocity in two dimensions, depth from a pressure gauge",
        "interpreted",
    ),
    Item(
        "assumption: energy",
        "`wsn_env/models/radio/modem.py`, pictures thresholds and energy: powers and bit rate of a small modem",
        "interpreted",
    ),
    Item(
        "quantities of the experiment (field, nodes, period, particles, noise)",
        "those of `wsn_env/scenario/presets/Underwater_v0.py` and `wsn_env/papers/underwater/systems.py`",
        "lost in the source",
    ),
    Item(
        "drawings and results",
        "no figure of them is known; an independent implementation's stand in `wsn_env/papers/underwater/expected.py`",
        "lost in the source",
    ),
)
