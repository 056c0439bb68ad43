"""Sound in the sea: absorption and ambient noise against frequency. Plain formulas; nothing here knows of networks."""

import math


def absorption_db_per_km(frequency_khz: float) -> float:
    """Absorption of sound in sea water [dB/km].

        alpha = 0.11 f^2 / (1 + f^2) + 44 f^2 / (4100 + f^2) + 2.75e-4 f^2 + 0.003

    Thorp (1967), as usually quoted for f from about 0.4 kHz: relaxation of boric acid and of magnesium sulphate, and
    the viscosity of water. 1.187 dB/km at 10 kHz, 17.47 at 50.

    Args:
        frequency_khz: f.
    """
    squared = frequency_khz * frequency_khz
    boron, magnesium = 0.11 * squared / (1 + squared), 44 * squared / (4100 + squared)
    return boron + magnesium + 2.75e-4 * squared + 0.003


def ambient_noise_db(frequency_khz: float, wind_ms: float = 5.0, shipping: float = 0.5) -> float:
    """Spectral level of the sea's ambient noise [dB re 1 uPa^2/Hz].

    The sum of four sources' powers, after Wenz (1962) in the formulas of Coates (1990):

        turbulence   17 - 30 log f
        shipping     40 + 20 (s - 0.5) + 26 log f - 60 log(f + 0.03)
        waves        50 + 7.5 sqrt(w) + 20 log f - 40 log(f + 0.4)
        thermal      -15 + 20 log f

    A scenario's `noise_db` is another thing: the sd of a measured level, which fading and the estimate's short time
    decide. It is given, not derived from this.

    Args:
        frequency_khz: f.
        wind_ms: w, wind speed [m/s].
        shipping: s, from 0 (no ships) to 1 (many).
    """
    log = math.log10
    levels = (
        17 - 30 * log(frequency_khz),
        40 + 20 * (shipping - 0.5) + 26 * log(frequency_khz) - 60 * log(frequency_khz + 0.03),
        50 + 7.5 * math.sqrt(wind_ms) + 20 * log(frequency_khz) - 40 * log(frequency_khz + 0.4),
        -15 + 20 * log(frequency_khz),
    )
    return 10 * log(sum(10 ** (level / 10) for level in levels))
