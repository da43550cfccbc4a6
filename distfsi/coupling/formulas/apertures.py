"""Apertures of faces and volume fractions of cells: what is open of them, from the signed distances of their nodes.

Distances are positive in the fluid and linear on the pieces into which faces and cells are cut: triangles between the
edges and the middle of a face, tetrahedra between those and the middle of the cell. All parts are continuous in the
distances, 0 where none is positive, 1 where all are, and exact for a plane wall.
"""

from distfsi.formulas.symbols import DIMENSIONS


def segment_fraction(a, b):
    """Open part of an edge between nodes at the distances a and b."""
    high, low = max(a, b), min(a, b)
    if_cut = high / (high - low)
    return 1.0 if low > 0.0 else (0.0 if high <= 0.0 else if_cut)


def triangle_fraction(a, b, c):
    """Open part of a triangle."""
    high, low = max(max(a, b), c), min(min(a, b), c)
    middle = max(min(a, b), min(max(a, b), c))
    corner = high * high / ((high - middle) * (high - low))
    cut_off = low * low / ((middle - low) * (high - low))
    if_cut = 1.0 - cut_off if middle > 0.0 else corner
    return 1.0 if low > 0.0 else (0.0 if high <= 0.0 else if_cut)


def tetrahedron_fraction(a, b, c, d):
    """Open part of a tetrahedron."""
    high_ab, low_ab, high_cd, low_cd = max(a, b), min(a, b), max(c, d), min(c, d)
    first, last = max(high_ab, high_cd), min(low_ab, low_cd)
    x, y = min(high_ab, high_cd), max(low_ab, low_cd)
    second, third = max(x, y), min(x, y)
    corner = first * first * first / ((first - second) * (first - third) * (first - last))
    cut_off = -last * last * last / ((first - last) * (second - last) * (third - last))
    p, q = first / (first - third), first / (first - last)
    r, s = second / (second - third), second / (second - last)
    wedge = p * q + (1.0 - p) * r * s + p * (1.0 - q) * s
    if_cut = 1.0 - cut_off if third > 0.0 else (wedge if second > 0.0 else corner)
    return 1.0 if last > 0.0 else (0.0 if first <= 0.0 else if_cut)


def square_fraction(a, b, c, d):
    """Open part of a square with the corners (low, low), (high, low), (low, high), (high, high)."""
    m = 0.25 * ((a + b) + (c + d))
    near, far = (
        triangle_fraction(m, a, b) + triangle_fraction(m, c, d),
        triangle_fraction(m, a, c) + triangle_fraction(m, b, d),
    )
    if_cut = 0.25 * (near + far)
    minimum = min(min(a, b), min(c, d))
    return 1.0 if minimum > 0.0 else if_cut


def pyramid_fraction(m, a, b, c, d):
    """Open part of a pyramid from a cell's middle, at the distance m, to one of its faces."""
    f = 0.25 * ((a + b) + (c + d))
    near = tetrahedron_fraction(m, f, a, b) + tetrahedron_fraction(m, f, c, d)
    return 0.25 * (near + (tetrahedron_fraction(m, f, a, c) + tetrahedron_fraction(m, f, b, d)))


def cube_fraction(a, b, c, d, e, f, g, h):
    """Open part of a cube; x runs fastest, then y, then z, over its corners."""
    m = 0.125 * (((a + b) + (c + d)) + ((e + f) + (g + h)))
    x = pyramid_fraction(m, a, c, e, g) + pyramid_fraction(m, b, d, f, h)
    y = pyramid_fraction(m, a, b, e, f) + pyramid_fraction(m, c, d, g, h)
    z = pyramid_fraction(m, a, b, c, d) + pyramid_fraction(m, e, f, g, h)
    if_cut = (x + y + z) / 6.0
    minimum = min(min(min(a, b), min(c, d)), min(min(e, f), min(g, h)))
    return 1.0 if minimum > 0.0 else if_cut


def aperture_of(corners):
    """Open part of a face, from its 1, 2 or 4 corners."""
    if DIMENSIONS == 1:
        return 1.0 if corners[0] > 0.0 else 0.0
    if DIMENSIONS == 2:
        return segment_fraction(corners[0], corners[1])
    if DIMENSIONS == 3:
        return square_fraction(corners[0], corners[1], corners[2], corners[3])


def volume_fraction_of(corners):
    """Open part of a cell, from its 2, 4 or 8 corners."""
    if DIMENSIONS == 1:
        return segment_fraction(corners[0], corners[1])
    if DIMENSIONS == 2:
        return square_fraction(corners[0], corners[1], corners[2], corners[3])
    if DIMENSIONS == 3:
        return cube_fraction(
            corners[0], corners[1], corners[2], corners[3], corners[4], corners[5], corners[6], corners[7]
        )
