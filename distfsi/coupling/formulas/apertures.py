"""How much of an edge, a face and a cell is open, from the signed distances of their corners to the wall.

Distances are positive in the fluid and linear on the pieces into which faces and cells are cut: triangles between the
edges and the middle of a face, tetrahedra between those and the middle of the cell. All parts are continuous in the
distances, 0 where none is positive, 1 where all are, and exact for a plane wall.
"""

from distfsi.formulas.symbols import DIMENSIONS


def open_segment(a, b):
    """Part of an edge between corners at the distances a and b."""
    high, low = max(a, b), min(a, b)
    if_cut = high / (high - low)
    return 1.0 if low > 0.0 else (0.0 if high <= 0.0 else if_cut)


def open_triangle(a, b, c):
    """Part of a triangle."""
    high, low = max(max(a, b), c), min(min(a, b), c)
    middle = max(min(a, b), min(max(a, b), c))
    corner = high * high / ((high - middle) * (high - low))
    cut_off = low * low / ((middle - low) * (high - low))
    if_cut = 1.0 - cut_off if middle > 0.0 else corner
    return 1.0 if low > 0.0 else (0.0 if high <= 0.0 else if_cut)


def open_tetrahedron(a, b, c, d):
    """Part of a tetrahedron."""
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


def open_square(a, b, c, d):
    """Part of a square with the corners (low, low), (high, low), (low, high), (high, high)."""
    m = 0.25 * ((a + b) + (c + d))
    near, far = open_triangle(m, a, b) + open_triangle(m, c, d), open_triangle(m, a, c) + open_triangle(m, b, d)
    if_cut = 0.25 * (near + far)
    least = min(min(a, b), min(c, d))
    return 1.0 if least > 0.0 else if_cut


def open_pyramid(m, a, b, c, d):
    """Part of a pyramid from a cell's middle, at the distance m, to one of its faces."""
    f = 0.25 * ((a + b) + (c + d))
    near = open_tetrahedron(m, f, a, b) + open_tetrahedron(m, f, c, d)
    return 0.25 * (near + (open_tetrahedron(m, f, a, c) + open_tetrahedron(m, f, b, d)))


def open_cube(a, b, c, d, e, f, g, h):
    """Part of a cube; x runs fastest, then y, then z, over its corners."""
    m = 0.125 * (((a + b) + (c + d)) + ((e + f) + (g + h)))
    x = open_pyramid(m, a, c, e, g) + open_pyramid(m, b, d, f, h)
    y = open_pyramid(m, a, b, e, f) + open_pyramid(m, c, d, g, h)
    z = open_pyramid(m, a, b, c, d) + open_pyramid(m, e, f, g, h)
    if_cut = (x + y + z) / 6.0
    least = min(min(min(a, b), min(c, d)), min(min(e, f), min(g, h)))
    return 1.0 if least > 0.0 else if_cut


def open_face(corners):
    """Part of a face that is open, from its 1, 2 or 4 corners."""
    if DIMENSIONS == 1:
        return 1.0 if corners[0] > 0.0 else 0.0
    if DIMENSIONS == 2:
        return open_segment(corners[0], corners[1])
    if DIMENSIONS == 3:
        return open_square(corners[0], corners[1], corners[2], corners[3])


def open_cell(corners):
    """Part of a cell that is open, from its 2, 4 or 8 corners."""
    if DIMENSIONS == 1:
        return open_segment(corners[0], corners[1])
    if DIMENSIONS == 2:
        return open_square(corners[0], corners[1], corners[2], corners[3])
    if DIMENSIONS == 3:
        return open_cube(corners[0], corners[1], corners[2], corners[3], corners[4], corners[5], corners[6], corners[7])
