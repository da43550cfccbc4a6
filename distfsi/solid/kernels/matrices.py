"""Vectors, matrices and tensors in the rows of arrays."""

from distfsi.device.markers import helper
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import COMPONENTS, DIMENSIONS


@helper
def difference(A, column, i, j):
    """Vector of A[i] minus that of A[j], from `column` on."""
    return tuple(A[i, column + d] - A[j, column + d] for d in static_range(DIMENSIONS))


@helper
def vector_of(A, i):
    """Vector whose components are A[i]."""
    return tuple(A[i, d] for d in static_range(DIMENSIONS))


@helper
def matrix_of(A, i):
    """Matrix whose rows lie one after the other in A[i]."""
    return tuple(tuple(A[i, a * DIMENSIONS + b] for b in static_range(DIMENSIONS)) for a in static_range(DIMENSIONS))


@helper
def tensor_of(A, i):
    """Symmetric tensor whose components are A[i]."""
    return tuple(A[i, c] for c in static_range(COMPONENTS))


@helper
def store_vector(A, i, vector):
    """A[i] = components of the vector."""
    for d in static_range(DIMENSIONS):
        A[i, d] = vector[d]


@helper
def store_matrix(A, i, matrix):
    """A[i] = rows of the matrix, one after the other."""
    for a in static_range(DIMENSIONS):
        for b in static_range(DIMENSIONS):
            A[i, a * DIMENSIONS + b] = matrix[a][b]


@helper
def store_tensor(A, i, tensor):
    """A[i] = components of the symmetric tensor."""
    for c in static_range(COMPONENTS):
        A[i, c] = tensor[c]


@helper
def zero_vector():
    """Vector of zeros."""
    return tuple(0.0 for _ in static_range(DIMENSIONS))


@helper
def zero_matrix():
    """Matrix of zeros."""
    return tuple(tuple(0.0 for _ in static_range(DIMENSIONS)) for _ in static_range(DIMENSIONS))


@helper
def matrix_sum(first, second):
    """Sum of two matrices."""
    return tuple(tuple(first[a][b] + second[a][b] for b in static_range(DIMENSIONS)) for a in static_range(DIMENSIONS))


@helper
def outer_product(a, b):
    """Matrix a b^T."""
    return tuple(tuple(a[m] * b[n] for n in static_range(DIMENSIONS)) for m in static_range(DIMENSIONS))
