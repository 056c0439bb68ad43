"""The symmetric square root of a covariance.

It does not depend on the order of the axes: with a permutation M the root of M P M' is M S M'. Cholesky's factor does,
and so do points spread along its columns. (It does depend on their units, here m and m/s, where Cholesky's does not.
The symmetric root of the correlations depends on neither, but its points were worse from a wide prior.)
"""

import numpy as np

from wsn_env.compiled.kernels import piece

N = 4  # known when compiled: loops are unrolled
SWEEPS = 30  # at most; four or five do
ROUNDING = 1e-16  # a correlation below this counts as none
LEAST = 1e-14  # of the largest variance: a smaller one is lost to rounding


@piece
def symmetric_root(cov, root, inverse):
    """S with S = S' and S S = cov, and its inverse: V sqrt(D) V' and V sqrt(D)^-1 V', where cov = V D V'.

    No variance in D is taken below LEAST of the largest, nor below 1e-30, so that the inverse exists.

    Args:
        cov: (4, 4) symmetric.
        root, inverse: (4, 4) filled.
    """
    left, directions = cov.copy(), np.eye(N)
    for _ in range(SWEEPS):
        if not _sweep(left, directions):
            break
    largest = 0.0
    for k in range(N):
        largest = max(largest, left[k, k])
    root[:], inverse[:] = 0.0, 0.0
    for k in range(N):
        sd = np.sqrt(max(left[k, k], LEAST * largest, 1e-30))
        for i in range(N):
            for j in range(N):
                product = directions[i, k] * directions[j, k]
                root[i, j] += sd * product
                inverse[i, j] += product / sd


@piece
def _sweep(left, directions):
    """One of Jacobi's rotations for each pair of axes, in place; whether there was anything to rotate.

    Golub & Van Loan (2013), sec. 8.5: `left` approaches D, `directions` V.
    """
    rotated = False
    for p in range(N - 1):
        for q in range(p + 1, N):
            if abs(left[p, q]) <= ROUNDING * np.sqrt(abs(left[p, p] * left[q, q])):
                continue
            rotated = True
            tau = 0.5 * (left[q, q] - left[p, p]) / left[p, q]
            tangent = (1.0 if tau >= 0 else -1.0) / (abs(tau) + np.sqrt(1.0 + tau * tau))
            cosine = 1.0 / np.sqrt(1.0 + tangent * tangent)
            sine = tangent * cosine
            for k in range(N):
                a, b = left[k, p], left[k, q]
                left[k, p], left[k, q] = cosine * a - sine * b, sine * a + cosine * b
            for k in range(N):
                a, b = left[p, k], left[q, k]
                left[p, k], left[q, k] = cosine * a - sine * b, sine * a + cosine * b
                a, b = directions[k, p], directions[k, q]
                directions[k, p], directions[k, q] = cosine * a - sine * b, sine * a + cosine * b
            left[p, q] = left[q, p] = 0.0
    return rotated
