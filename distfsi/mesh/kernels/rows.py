"""Loops over the rows of arrays: reductions in chunks, rows that are marked, rows from elsewhere.

A reduction gives one number per `chunk` of so many rows; the host makes one of them (mesh/rows.py). Arrays of several
columns are flat here, `width` values per row.
"""

from distfsi.device.markers import driver

# ---- reductions -----------------------------------------------------------------------------------------------------


@driver
def find_largest(begin, end, chunk, values, largest):
    """largest[c] = largest of the values in chunk c; NaN if there is one."""
    for c in range(begin, end):
        greatest = values[c * chunk]
        for i in range(c * chunk + 1, min((c + 1) * chunk, len(values))):
            greatest = greatest if greatest >= values[i] or greatest != greatest else values[i]
        largest[c] = greatest


@driver
def find_minimum(begin, end, chunk, values, lowest, index):
    """lowest[c] = first of the smallest values in chunk c, or of its NaN; index[c] = where it is."""
    for c in range(begin, end):
        first = c * chunk
        smallest = values[first]
        for i in range(first + 1, min(first + chunk, len(values))):
            if values[i] < smallest or (values[i] != values[i] and smallest == smallest):
                smallest, first = values[i], i
        lowest[c] = smallest
        index[c] = first


@driver
def find_bounds(begin, end, chunk, values, width, bounds):
    """bounds[c] = smallest, then largest value of each column of the rows in chunk c; a NaN does not count."""
    rows = len(values) // width
    for c in range(begin, end):
        for k in range(width):
            low, high = values[c * chunk * width + k], values[c * chunk * width + k]
            for i in range(c * chunk + 1, min((c + 1) * chunk, rows)):
                value = values[i * width + k]
                low = low if low <= value or value != value else value
                high = high if high >= value or value != value else value
            bounds[c, k] = low
            bounds[c, width + k] = high


@driver
def add_rows(begin, end, first, rows, width, values, sums):
    """sums[c] = sum of the values in rows[first[c]] … rows[first[c + 1] - 1], one after the other."""
    for c in range(begin, end):
        for k in range(width):
            total = 0.0
            for i in range(first[c], first[c + 1]):
                total += values[rows[i] * width + k]
            sums[c, k] = total


# ---- rows that are marked -------------------------------------------------------------------------------------------


@driver
def count_marked(begin, end, chunk, mark, counts):
    """counts[c] = how many of the marks in chunk c are not 0."""
    for c in range(begin, end):
        found = 0
        for i in range(c * chunk, min((c + 1) * chunk, len(mark))):
            if mark[i] > 0:
                found += 1
        counts[c] = found


@driver
def list_marked(begin, end, chunk, mark, first, rows):
    """rows[first[c] …] = the rows in chunk c whose marks are not 0."""
    for c in range(begin, end):
        n = first[c]
        for i in range(c * chunk, min((c + 1) * chunk, len(mark))):
            if mark[i] > 0:
                rows[n] = i
                n += 1


# ---- rows from elsewhere --------------------------------------------------------------------------------------------


@driver
def take_rows(begin, end, rows, own, width, source, others, taken):
    """taken[n] = row rows[n] of the `own` rows of the source and, behind them, of the others."""
    for n in range(begin, end):
        i = rows[n]
        for k in range(width):
            taken[n * width + k] = source[i * width + k] if i < own else others[(i - own) * width + k]


@driver
def pack_rows(begin, end, rows, width, source, stride, column, packed):
    """Row n of `packed`, `stride` values long, gets row rows[n] of the source from its `column` on."""
    for n in range(begin, end):
        for k in range(width):
            packed[n * stride + column + k] = source[rows[n] * width + k]


@driver
def extend(begin, end, own, width, source, stride, column, packed, extended):
    """The `own` rows of the source, then those that are packed as pack_rows() does."""
    for i in range(begin, end):
        for k in range(width):
            value = source[i * width + k] if i < own else packed[(i - own) * stride + column + k]
            extended[i * width + k] = value


REDUCTIONS = (find_largest, find_minimum, find_bounds, add_rows)
