"""Vectors, square matrices by rows and symmetric tensors by components, of DIMENSIONS dimensions.

A symmetric tensor is the tuple of its COMPONENTS: (xx), (xx, yy, xy) or (xx, yy, zz, xy, xz, yz).
"""

from distfsi.physics.subset import static_range
from distfsi.physics.symbols import DIMENSIONS


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
