"""What of the FOA-GRNN text is rebuilt, and where."""

from wsn_env.papers.coverage import Item

HERE = "wsn_env/papers/grnn"
COVERAGE: tuple[Item, ...] = (
    Item(
        "Eqs. 1-3, fruit fly optimisation (FOA): each anchor a fly, d_min and d_max, smell from the distance to the"
        " origin",
        f"`{HERE}/flies.py`; table width. Our choice: a flight of d_min to d_max (least and greatest distance between"
        " two anchors) from the anchor; smell 1 / distance; lengths in sides of the field, and in metres",
        "interpreted",
    ),
    Item(
        "Step: fruit fly optimisation of the width",
        "`wsn_env/filters/width.py`, with the swarm of Pan (2012); table width",
        "interpreted",
    ),
    Item(
        "General regression network: position from strengths",
        "`wsn_env/filters/fingerprint.py`, `wsn_env/filters/grnn.py`; table rmse. Its map and validation points: ours",
        "interpreted",
    ),
    Item(
        "Strength over distance",
        "`wsn_env/models/measurement/rssi.py`; the text's constants are lost, ours are -40 - 30 lg d dB, 3 dB",
        "interpreted",
    ),
    Item(
        "Step: Kalman smoothing of the strengths before the network",
        f"`{HERE}/strengths.py`; table smoothing. Our choice: a random walk for each anchor",
        "interpreted",
    ),
    Item(
        "Eq. 9: least squares from ranges",
        f"`wsn_env/filters/trilateration.py`, `{HERE}/fixes.py`; table rmse, table comparison. Which anchor is the"
        " reference is not said: first, last and all pairs",
        "interpreted",
    ),
    Item(
        "State and motion: constant velocity, noise of the acceleration",
        "`wsn_env/filters/kalman.py`, `wsn_env/models/motion/prediction.py`; white acceleration of 3 m²/s³ is ours",
        "interpreted",
    ),
    Item("Cubature Kalman filter", "`wsn_env/filters/cubature.py`; table rmse, table poor_start", "covered"),
    Item(
        "Iterated cubature Kalman filter",
        "`wsn_env/filters/cubature.py`: posterior linearisation, which counts a measurement once; table rmse,"
        " table poor_start, table iteration",
        "interpreted",
    ),
    Item(
        "Step: the filter begins with the network's position",
        "`wsn_env/filters/first_fix.py`; table rmse, table poor_start",
        "covered",
    ),
    Item(
        "Step: the combination of network and filter",
        "`wsn_env/filters/grnn.py`: the network's positions are measurements, for which a cubature filter is the Kalman"
        " filter; table rmse",
        "interpreted",
    ),
    Item(
        "Assumption: 200 m x 200 m, eight anchors that hear the target everywhere",
        f"`{HERE}/systems.py`; where they stand is lost: ring8 and mix8 are ours",
        "interpreted",
    ),
    Item(
        "Assumption: the target's path",
        f"`{HERE}/systems.py`: 50 s on four straight legs of our choice",
        "lost in the source",
    ),
    Item(
        "Assumption: the noise of every sample is its own at any T",
        "as read in table rmse; the opposite, an equal information rate, in table equal_information",
        "interpreted",
    ),
    Item(
        "Figs. 1, 2 and 6, Table 1", "our text does not show them; nothing stands in their place", "lost in the source"
    ),
    Item("Fig. 3: the track", "picture fig_track, on our path", "interpreted"),
    Item("Fig. 4: the strengths and their smoothing", "picture fig_strength, on our path", "interpreted"),
    Item(
        "Fig. 5, Tables 2-5: root mean square and mean error over T, also in x and y",
        "table rmse, table mean_error, table axes, picture fig_period. The text's figures are lost for the"
        " greater part",
        "interpreted",
    ),
    Item(
        "Figs. 7-9: comparison with the methods of references that are lost",
        f"`{HERE}/comparison.py`: the best openly described methods instead; table comparison,"
        " picture fig_distribution",
        "lost in the source",
    ),
    Item(
        "Fig. 10: 500 to 5,000 targets",
        f"`{HERE}/targets.py`; table targets: error, and time a target",
        "interpreted",
    ),
    Item(
        "Claim: the error grows with T",
        f"`{HERE}/claims.py`; table rmse, table equal_information, table claims",
        "covered",
    ),
    Item(
        "Claim: the errors in x and y cross over at 0.5 s", f"`{HERE}/claims.py`; table axes, table claims", "covered"
    ),
    Item(
        "Claim: the combination beats the network and ICKF alone",
        f"`{HERE}/claims.py`; table rmse, table claims. ICKF alone begins in the field's middle; another begins"
        " with the network's fix",
        "covered",
    ),
    Item(
        "Claim: iteration improves the filter",
        f"`{HERE}/claims.py`; table poor_start, table iteration, table claims",
        "covered",
    ),
    Item("Claim: the flies find the best width", f"`{HERE}/claims.py`; table width, table claims", "covered"),
)
