"""Vectors, square matrices by rows and symmetric tensors by components, of DIMENSIONS dimensions.

A symmetric tensor is the tuple of its COMPONENTS: (xx), (xx, yy, xy) or (xx, yy, zz, xy, xz, yz).
"""

from math import sqrt

from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS

SWEEPS = 5  # of Jacobi's rotations, until the eigenvalues of a matrix of three rows are exact to round-off


def dot(a, b):
    """Scalar product of two vectors."""
    return sum(a[d] * b[d] for d in static_range(DIMENSIONS))


def times(matrix, vector):
    """Matrix times vector."""
    return tuple(dot(matrix[a], vector) for a in static_range(DIMENSIONS))


def product(first, second):
    """Product of two matrices."""
    return tuple(
        tuple(sum(first[a][c] * second[c][b] for c in static_range(DIMENSIONS)) for b in static_range(DIMENSIONS))
        for a in static_range(DIMENSIONS)
    )


def transposed(matrix):
    """The matrix with rows and columns exchanged."""
    return tuple(tuple(matrix[b][a] for b in static_range(DIMENSIONS)) for a in static_range(DIMENSIONS))


def trace(matrix):
    """Sum of the diagonal."""
    return sum(matrix[a][a] for a in static_range(DIMENSIONS))


def contraction(first, second):
    """first : second."""
    return sum(dot(first[a], second[a]) for a in static_range(DIMENSIONS))


def scaled(factor, matrix):
    """`factor` times a matrix."""
    return tuple(tuple(factor * matrix[a][b] for b in static_range(DIMENSIONS)) for a in static_range(DIMENSIONS))


def identity_plus(factor, matrix):
    """Unit matrix plus `factor` times a matrix."""
    return tuple(
        tuple((1.0 if a == b else 0.0) + factor * matrix[a][b] for b in static_range(DIMENSIONS))
        for a in static_range(DIMENSIONS)
    )


def determinant(m):
    """Determinant of a matrix."""
    if DIMENSIONS == 1:
        return m[0][0]
    if DIMENSIONS == 2:
        return m[0][0] * m[1][1] - m[0][1] * m[1][0]
    if DIMENSIONS == 3:
        return sum(
            m[0][a] * (m[1][(a + 1) % 3] * m[2][(a + 2) % 3] - m[1][(a + 2) % 3] * m[2][(a + 1) % 3])
            for a in static_range(3)
        )


def minimum_eigenvalue(m):
    """Lower bound of the eigenvalues of a symmetric positive matrix, tight if the others are equal; NaN for zero."""
    if DIMENSIONS == 1:
        return m[0][0]
    if DIMENSIONS == 2:
        return determinant(m) / trace(m)
    if DIMENSIONS == 3:
        return 4.0 * determinant(m) / (trace(m) * trace(m))


def inverse(m):
    """Inverse of a matrix."""
    scale = 1.0 / determinant(m)
    if DIMENSIONS == 1:
        return ((scale,),)
    if DIMENSIONS == 2:
        return ((scale * m[1][1], -scale * m[0][1]), (-scale * m[1][0], scale * m[0][0]))
    if DIMENSIONS == 3:
        return tuple(
            tuple(
                scale
                * (
                    m[(b + 1) % 3][(a + 1) % 3] * m[(b + 2) % 3][(a + 2) % 3]
                    - m[(b + 1) % 3][(a + 2) % 3] * m[(b + 2) % 3][(a + 1) % 3]
                )
                for b in static_range(3)
            )
            for a in static_range(3)
        )


def rows(tensor):
    """The matrix of a symmetric tensor."""
    if DIMENSIONS == 1:
        return ((tensor[0],),)
    if DIMENSIONS == 2:
        return ((tensor[0], tensor[2]), (tensor[2], tensor[1]))
    if DIMENSIONS == 3:
        return (
            (tensor[0], tensor[3], tensor[4]),
            (tensor[3], tensor[1], tensor[5]),
            (tensor[4], tensor[5], tensor[2]),
        )


def components(matrix):
    """The symmetric tensor whose matrix is given."""
    if DIMENSIONS == 1:
        return (matrix[0][0],)
    if DIMENSIONS == 2:
        return (matrix[0][0], matrix[1][1], matrix[0][1])
    if DIMENSIONS == 3:
        return (matrix[0][0], matrix[1][1], matrix[2][2], matrix[0][1], matrix[0][2], matrix[1][2])


def positive_part(m):
    """The part of a symmetric matrix with positive eigenvalues: it and its axes by Jacobi's rotations, which need no
    care where eigenvalues are equal."""
    axes = identity_plus(0.0, m)
    for _ in static_range(1 if DIMENSIONS < 3 else SWEEPS):
        for p in static_range(DIMENSIONS):
            for q in static_range(p + 1, DIMENSIONS):
                gap = m[q][q] - m[p][p]
                twice = (2.0 if gap >= 0.0 else -2.0) * m[p][q]
                tangent = twice / (abs(gap) + sqrt(gap * gap + twice * twice) + 1e-300)
                cosine = 1.0 / sqrt(1.0 + tangent * tangent)
                sine = tangent * cosine
                turn = tuple(
                    tuple(
                        (cosine if a == p or a == q else 1.0)
                        if a == b
                        else (sine if a == p and b == q else (-sine if a == q and b == p else 0.0))
                        for b in static_range(DIMENSIONS)
                    )
                    for a in static_range(DIMENSIONS)
                )
                m = product(transposed(turn), product(m, turn))
                axes = product(axes, turn)
    return tuple(
        tuple(
            sum(max(m[c][c], 0.0) * axes[a][c] * axes[b][c] for c in static_range(DIMENSIONS))
            for b in static_range(DIMENSIONS)
        )
        for a in static_range(DIMENSIONS)
    )
