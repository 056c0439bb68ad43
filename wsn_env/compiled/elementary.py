"""Elementary functions whose bits depend on nothing but their argument.

libm, NumPy and vector libraries differ between processors and between the head and the tail of an array. These
are plain sums and products, which IEEE 754 fixes to the bit. The double versions follow the reductions and
minimax coefficients of Sun's fdlibm (errors below 2 ulp); the float32 ones are free of branches and tables, so
that the compiler can turn them into vector instructions (relative errors below 2e-7).
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import config, types
from numba.extending import intrinsic

from wsn_env.compiled.kernels import inline_piece, lean_piece, piece

F = np.float32
I32 = np.int32
LN2 = 0.6931471805599453
LN2_HIGH, LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
HALF_PI = 1.5707963267948966
ROOT_HALF = 0.7071067811865476

# ln(erfc(z) e**(z^2) / t) as a polynomial in 2 t - 1, t = 2 / (2 + z), highest power first: the Chebyshev interpolant
# of degree 24 (absolute error 4e-15), in the form of Numerical Recipes' erfc.
ERFC = (
    -1.37913070917111069e-8,
    2.99232730577075805e-8,
    8.35469423874085521e-8,
    -2.90244399559999255e-7,
    -5.74572411191407616e-8,
    1.2851059663435587e-6,
    -1.38533809612471535e-6,
    -2.96593298591063188e-6,
    8.63948536674403859e-6,
    1.42095099946580649e-7,
    -0.0000302232856041113943,
    0.000031745644525872318,
    0.0000714119742099591563,
    -0.000174303633404306268,
    -0.0000937372484413609842,
    0.000673679012559595357,
    -0.000146246585938197734,
    -0.00234581253445585102,
    0.00175893353833438351,
    0.00882493855975445077,
    -0.00987268936575432916,
    -0.0468956102312684307,
    0.047343306841898187,
    0.672643223977657637,
    -0.671794084056692265,
)


def _bitcast(source: Any, target: Any, llvm_type: Any) -> Any:
    if config.DISABLE_JIT:
        return lambda value: getattr(np, source.name)(value).view(getattr(np, target.name))

    @intrinsic
    def cast(context, value):
        def generate(context, builder, signature, arguments):
            return builder.bitcast(arguments[0], llvm_type)

        return target(source), generate

    return cast


f32_bits: Any = _bitcast(types.float32, types.int32, ir.IntType(32))
f32_from_bits: Any = _bitcast(types.int32, types.float32, ir.FloatType())
f64_bits: Any = _bitcast(types.float64, types.int64, ir.IntType(64))
f64_from_bits: Any = _bitcast(types.int64, types.float64, ir.DoubleType())


@piece
def log(x: Any) -> float:
    """Natural logarithm of a positive normal double."""
    bits = f64_bits(x)
    exponent = (bits - 0x3FE6A09E667F3BCD) >> 52  # so that the mantissa lies in [sqrt(1/2), sqrt(2))
    f = f64_from_bits(bits - (exponent << 52)) - 1.0
    s = f / (2.0 + f)
    z = s * s
    r = z * (
        6.666666666666735130e-01
        + z
        * (
            3.999999999940941908e-01
            + z
            * (
                2.857142874366239149e-01
                + z
                * (
                    2.222219843214978396e-01
                    + z * (1.818357216161805012e-01 + z * (1.531383769920937332e-01 + z * 1.479819860511658591e-01))
                )
            )
        )
    )
    half = 0.5 * f * f
    return exponent * LN2_HIGH - ((half - (s * (half + r) + exponent * LN2_LOW)) - f)


@piece
def exp(x: Any) -> float:
    """e**x for doubles; 0 below -708, clamped at +709."""
    if x < -708.0:
        return 0.0
    x = min(x, 709.0)
    n = np.floor(x / LN2 + 0.5)
    high = x - n * LN2_HIGH
    low = n * LN2_LOW
    r = high - low
    t = r * r
    c = r - t * (
        1.66666666666666019037e-01
        + t
        * (
            -2.77777777770155933842e-03
            + t * (6.61375632143793436117e-05 + t * (-1.65339022054652515390e-06 + t * 4.13813679705723846039e-08))
        )
    )
    y = 1.0 - ((low - (r * c) / (2.0 - c)) - high)
    half = int(n) >> 1  # two factors, since 2**n alone may leave the range of doubles
    return y * f64_from_bits((half + 1023) << 52) * f64_from_bits((int(n) - half + 1023) << 52)


@piece
def sincos(x: Any) -> tuple[float, float]:
    """(sin x, cos x) for |x| < 1e5 rad."""
    n = np.floor(x / HALF_PI + 0.5)
    r = (x - n * 1.57079632673412561417e00) - n * 6.07710050650619224932e-11
    z = r * r
    s = r + r * z * (
        -1.66666666666666324348e-01
        + z
        * (
            8.33333333332248946124e-03
            + z
            * (
                -1.98412698298579493134e-04
                + z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10))
            )
        )
    )
    c = (1.0 - 0.5 * z) + z * z * (
        4.16666666666666019037e-02
        + z
        * (
            -1.38888888888741095749e-03
            + z
            * (
                2.48015872894767294178e-05
                + z * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 - z * 1.13596475577881948265e-11))
            )
        )
    )
    quadrant = int(n) & 3
    if quadrant == 0:
        return s, c
    if quadrant == 1:
        return c, -s
    if quadrant == 2:
        return -s, -c
    return -c, s


@piece
def log32(x: Any) -> Any:
    """Natural logarithm of a positive normal float32."""
    bits = f32_bits(x)
    exponent = I32(I32(bits - I32(0x3F3504F3)) >> I32(23))
    f = f32_from_bits(I32(bits - I32(exponent << I32(23)))) - F(1)
    p = F(7.0376836292e-2)
    p = p * f - F(1.1514610310e-1)
    p = p * f + F(1.1676998740e-1)
    p = p * f - F(1.2420140846e-1)
    p = p * f + F(1.4249322787e-1)
    p = p * f - F(1.6668057665e-1)
    p = p * f + F(2.0000714765e-1)
    p = p * f - F(2.4999993993e-1)
    p = p * f + F(3.3333331174e-1)
    z = f * f
    return F(exponent) * F(LN2) + (f + (p * f * z - F(0.5) * z))


@piece
def exp32(x: Any) -> Any:
    """e**x for float32 x <= 0; clamped at 2**-126, never 0."""
    rest, power = _exp32_parts(x)
    return (rest + F(1)) * power


@piece
def expm1_32(x: Any) -> Any:
    """e**x - 1 for float32 x <= 0, without loss near 0 (relative error below 3e-7)."""
    rest, power = _exp32_parts(x)
    return rest * power + (power - F(1))


@piece
def _exp32_parts(x):
    """r, p with e**x = (1 + r) p, |r| < 0.42 and p a power of 2."""
    t = max(x * F(1.44269504089), F(-126.0))
    n = np.floor(t + F(0.5))
    f = t - n
    r = F(1.535336188319500e-4)
    r = r * f + F(1.339887440266574e-3)
    r = r * f + F(9.618437357674640e-3)
    r = r * f + F(5.550332471162809e-2)
    r = r * f + F(2.402264791363012e-1)
    r = r * f + F(6.931472028550421e-1)
    return r * f, f32_from_bits(I32((I32(n) + I32(127)) << I32(23)))


@piece
def tanh32(x: Any) -> Any:
    """Hyperbolic tangent of a float32 (absolute error below 2e-7)."""
    e = exp32(F(-2) * abs(x))
    y = (F(1) - e) / (F(1) + e)
    return y if x >= 0 else -y


@piece
def normal_cdf(x: Any) -> float:
    """Phi(x), the standard normal distribution function (relative error below 1e-12, 0 below -37.6)."""
    z = ROOT_HALF * abs(x)
    t = 2.0 / (2.0 + z)
    p = 0.0
    for coefficient in ERFC:
        p = p * (2.0 * t - 1.0) + coefficient
    tail = 0.5 * t * exp(p - z * z)
    return tail if x < 0.0 else 1.0 - tail


@inline_piece
def log_normal_cdf32(x: Any) -> Any:
    """ln Phi(x) for float32, finite and at most 0 (absolute error below 2e-7 + 4e-7 |ln Phi|).

    Without a branch; ERFC's polynomial to degree 11.
    """
    z = F(ROOT_HALF) * min(abs(x), F(1e15))
    t = F(2) / (F(2) + z)
    u = F(2) * t - F(1)
    p = F(-9.2464577956e-5)
    p = p * u + F(8.5083166098e-6)
    p = p * u + F(0.00058807168876)
    p = p * u - F(0.00022919226001)
    p = p * u - F(0.0023031434654)
    p = p * u + F(0.0017952014937)
    p = p * u + F(0.0088151569561)
    p = p * u - F(0.0098804316376)
    p = p * u - F(0.046894781015)
    p = p * u + F(0.047343940395)
    p = p * u + F(0.67264321249)
    p = p * u - F(0.67179409278)
    tail = min(log32(F(0.5) * t) + (p - z * z), F(0))  # ln Phi(-|x|)
    below = F(x < F(0))
    return below * tail + (F(1) - below) * log32(-expm1_32(tail))


@lean_piece
def expected_error(p00: float, p01: float, p11: float) -> float:
    """Mean length of a normal vector of two dimensions with this covariance (relative error below 2e-3).

    It is sqrt(2 a / pi) E(1 - b / a), with the complete elliptic integral E and the variances a >= b along the axes:
    sqrt(trace) times something between sqrt(2 / pi) for a line and sqrt(pi) / 2 for a circle, here a cubic.
    """
    trace = max(p00 + p11, 1e-300)
    q = 2.0 * np.sqrt(max(p00 * p11 - p01 * p01, 0.0)) / trace  # 0: a line, 1: a circle
    return np.sqrt(trace) * (0.79660066 + q * (0.03596805 + q * (0.09101999 - q * 0.03750869)))


@inline_piece
def cos_turns32(t: Any) -> Any:
    """cos(2 pi t) in float32, by its series about 0 after taking off whole turns (absolute error below 2e-6)."""
    t -= np.floor(t + F(0.5))
    u = t * t
    high = F(-1.71439e0) + u * F(2.82006e-1)
    high = F(-2.642626e1) + u * (F(7.903536e0) + u * high)
    return F(1) + u * (F(-1.9739209e1) + u * (F(6.4939394e1) + u * (F(-8.545682e1) + u * (F(6.024464e1) + u * high))))
