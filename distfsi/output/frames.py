"""What a picture shows of a run at one time: a line, a plane, or a plane through three dimensions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from distfsi.narrowing import present
from distfsi.output.fields import axis_across, field_names, read_axes, read_grid, read_layer, read_particles, series
from distfsi.output.journal import read_journal
from distfsi.output.scales import scaled

AXES = "xyz"
OVERPRESSURE = "overpressure"  # that of a run follows from the pressure and the ambient one
ACROSS = ((1, 2), (0, 2), (0, 1))  # axes of a plane, horizontal and vertical, by its normal

Extent = tuple[float, float, float, float]  # left, right, bottom, top [m]; bottom = top in one dimension
Plane = tuple[int, float]  # axis that it is normal to, position on that axis [m]


@dataclass(frozen=True)
class Frame:
    """A run at one `time` [s]; `cells` or `particles` are empty where it has none.

    cells: fields (ny, nx) or (ny, nx, 3) over `extent`, x and y being the `axes` of the plane; particles: columns of
    those in the plane, typically `spacing` [m] apart; names: those of the axes; location: where a plane through three
    dimensions lies, in words.
    """

    time: float
    extent: Extent
    cells: Mapping[str, np.ndarray]
    particles: Mapping[str, np.ndarray]
    spacing: float
    axes: tuple[int, int] = (0, 1)
    names: str = AXES
    location: str = ""

    @property
    def dimensions(self) -> int:
        """1 for a run along x only, else 2."""
        _, _, bottom, top = self.extent
        return 1 + (top > bottom)

    @property
    def aspect(self) -> float:
        """Height over width."""
        left, right, bottom, top = self.extent
        return (top - bottom) / (right - left)

    @property
    def cell_centers(self) -> np.ndarray:
        """Positions x (nx,) [m] of a row of cells."""
        left, right, _, _ = self.extent
        count = next(iter(self.cells.values())).shape[1]
        return left + (np.arange(count) + 0.5) * (right - left) / count


class Film:
    """The frames of a run, in the order of their `times` [s], loaded one by one.

    plane: where three dimensions are cut; by default where `telling_plane` says or, without particles, through the
    middle, seen along z. mirror: both sides of the axis of an axisymmetric run.
    Raises FileNotFoundError when there are no field files, ValueError when the plane misses the domain or there is no
    axis.
    """

    def __init__(self, directory: Path, plane: Plane | None = None, mirror: bool = False):
        self._cells, self._particles = series(directory, "cells"), series(directory, "particles")
        present = [files for files in (self._cells, self._particles) if files]
        if not present:
            raise FileNotFoundError(f"no field files in {directory}")
        # A run that died between the two kinds of a time has one file less of the second.
        self.times = [time for time, _ in min(present, key=len)]
        self._plane, self._mirror = plane, mirror
        self._ambient: float | None = read_journal(directory).get("ambient pressure [Pa]")
        if not self._cells:
            self._box = self._box_of_particles()
            self._plane = plane or fullest_plane(read_particles(self._particles[0][1])[1])
        elif plane is None and self._particles:
            self._plane = telling_plane(self._cells[0][1], self._particles[0][1])

    def __len__(self) -> int:
        return len(self.times)

    @property
    def cell_fields(self) -> list[str]:
        """Names of the fields of the cells, and of what follows from them."""
        names = field_names(self._cells[0][1]) if self._cells else []
        derived = self._ambient is not None and "pressure" in names and OVERPRESSURE not in names
        return [*names, OVERPRESSURE] if derived else names

    @property
    def particle_fields(self) -> list[str]:
        """Names of the fields of the particles."""
        return field_names(self._particles[0][1]) if self._particles else []

    def frames(self, numbers: Sequence[int], names: Sequence[str] | None = None) -> Iterator[Frame]:
        """The frames of these numbers; `names`: the fields of the cells that are wanted, by default all."""
        for number in numbers:
            particles = self._particles[number][1] if self._particles else None
            if self._cells:
                yield self._with_cells(self._cells[number][1], particles, names)
            else:
                time, columns = read_particles(present(particles))
                normal, at = present(self._plane)
                axes = ACROSS[normal]
                left, right, low, high = (float(corner[axis]) for axis in axes for corner in self._box)
                deep = float(self._box[1][normal] - self._box[0][normal]) > 0.0
                near = _near_plane(columns, normal, at)
                yield Frame(time, (left, right, low, high), {}, *near, axes, location=_location(AXES, normal, at, deep))

    def _with_cells(self, cells: Path, particles: Path | None, names: Sequence[str] | None) -> Frame:
        normal, at = self._plane or (axis_across(cells), None)
        time, fields, (low, high) = read_layer(cells, normal, at, self._in_files(names))
        if names and OVERPRESSURE in names and OVERPRESSURE not in fields:
            fields[OVERPRESSURE] = fields["pressure"] - present(self._ambient)
        axes = ACROSS[normal]
        left, right, below, above = (float(corner[axis]) for axis in axes for corner in (low, high))
        at = 0.5 * (low[normal] + high[normal]) if at is None else at
        near, distance = _near_plane(read_particles(particles)[1], normal, at) if particles else ({}, 0.0)
        names, deep = read_axes(cells), int(read_grid(cells)[0].min()) > 1
        location = _location(names, normal, at, deep)
        frame = Frame(time, (left, right, below, above), fields, near, distance, axes, names, location)
        return mirrored(frame) if self._mirror else frame

    def _in_files(self, names: Sequence[str] | None) -> Sequence[str] | None:
        """The fields from which those of these names come."""
        if names is None or OVERPRESSURE not in names or OVERPRESSURE in field_names(self._cells[0][1]):
            return names
        return list(dict.fromkeys("pressure" if name == OVERPRESSURE else name for name in names))

    def _box_of_particles(self) -> tuple[np.ndarray, np.ndarray]:
        """Low and high corner of the box around all particles at all times, with some room."""
        corners = [read_particles(path)[1]["position"] for _, path in self._particles]
        low = np.min([position.min(axis=0) for position in corners], axis=0)
        high = np.max([position.max(axis=0) for position in corners], axis=0)
        margin = 0.05 * (high - low).max() * (high > low)
        return low - margin, high + margin


def as_line(frame: Frame) -> Frame | None:
    """A frame of one row or one column of cells as one of a line; None where there are more."""
    count = next(iter(frame.cells.values())).shape[:2] if frame.cells else (0, 0)
    left, right, bottom, top = frame.extent
    if count[0] == 1:
        return replace(frame, extent=(left, right, bottom, bottom))
    if count[1] == 1:
        cells = {name: np.swapaxes(values, 0, 1) for name, values in frame.cells.items()}
        return replace(frame, cells=cells, extent=(bottom, top, left, left), axes=frame.axes[::-1])
    return None


def mirrored(frame: Frame) -> Frame:
    """A frame of an axisymmetric run with both sides of its axis. Raises ValueError when it does not reach one."""
    left, right, bottom, top = frame.extent
    if frame.names[:2] != "rz" or left != 0.0:
        raise ValueError("only an axisymmetric run that begins at its axis can be mirrored")

    def both(field: np.ndarray) -> np.ndarray:
        other = field[:, ::-1] * (np.array([-1.0, 1.0, 1.0]) if field.ndim == 3 else 1.0)
        return np.concatenate([other, field], axis=1)

    cells = {name: both(field) for name, field in frame.cells.items()}
    return replace(frame, extent=(-right, right, bottom, top), cells=cells)


def telling_plane(cells: Path, particles: Path) -> Plane | None:
    """The plane that shows most of the bodies in a pair of files: along their longest and their shortest edge, through
    their middle or, where they touch only the low end of the domain (of a half or a quarter, as a rule), along that
    end. None unless there are three dimensions and particles."""
    count, low, edge = read_grid(cells)
    position = read_particles(particles)[1]["position"]
    if count.min() == 1 or len(position) == 0:
        return None
    high = low + count * edge
    first, last = np.clip(position.min(axis=0), low, high), np.clip(position.max(axis=0), low, high)
    extents = np.round((last - first) / (high - low).max(), 2)
    normal = sorted((2, 1, 0), key=lambda axis: extents[axis])[1]
    touches_low, touches_high = first < low + edge, last > high - edge
    at = np.where(touches_low & ~touches_high, low + 0.5 * edge, np.clip(0.5 * (first + last), low, high - 0.5 * edge))
    return normal, float(at[normal])


def fullest_plane(columns: Mapping[str, np.ndarray]) -> Plane:
    """The plane across z that holds most of the particles: through their middle or, as in a half of a body, along an
    end."""
    z = columns["position"][:, 2]
    spacing = _near_plane(columns, 2, 0.0)[1]
    low, high = float(z.min(initial=np.inf)), float(z.max(initial=-np.inf))
    if not high > low:
        return 2, low if z.size else 0.0
    return 2, max((0.5 * (low + high), low, high), key=lambda at: int((np.abs(z - at) <= 0.5 * spacing).sum()))


def load_frames(directory: Path, count: int) -> list[Frame]:
    """Up to `count` frames, evenly chosen from the field files in `directory`, the first and the last among them.

    Raises FileNotFoundError when there are no field files.
    """
    film = Film(directory)
    chosen = sorted(set(np.linspace(0, len(film) - 1, count).round().astype(int).tolist()))
    return list(film.frames(chosen))


def _location(names: str, normal: int, at: float, deep: bool) -> str:
    """Where a plane lies, in words; it needs none unless the run is `deep`: has three dimensions."""
    size, unit = scaled("m", abs(at))
    return f"plane {names[normal]} = {at / size:.4g} {unit}" if deep else ""


def _near_plane(columns: Mapping[str, np.ndarray], normal: int, at: float) -> tuple[dict[str, np.ndarray], float]:
    """The particles within half their spacing of a plane, and their spacing: that of the sparser direction."""
    position = columns["position"]
    if len(position) < 2:
        return dict(columns), 0.0
    some = position[:: max(1, len(position) // 1000)]
    # In a lattice a particle on the surface still has one neighbour more than there are dimensions.
    neighbours = min(int(np.count_nonzero(np.ptp(position, axis=0))) + 1, len(position) - 1)
    spacing = float(np.median(cKDTree(position).query(some, k=neighbours + 1)[0][:, -1]))
    near = np.abs(position[:, normal] - at) <= 0.5 * spacing
    return {name: column[near] for name, column in columns.items()}, spacing
