"""Particles on the move between ranks, copies of those near a rank's blocks, mirror images of those near a plane."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import product
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np

from distfsi.device.interface import Columns, Device, DualArray
from distfsi.errors import InputError
from distfsi.mesh.blocks import Blocks
from distfsi.mesh.kernels.particles import IMAGES
from distfsi.mesh.route import Route
from distfsi.mesh.rows import Rows, chunks

# How a value changes in an image: "position" is mirrored about the plane; otherwise, for each component, the axes whose
# reflection changes its sign: scalar ((),), vector ((0,), (1,)), symmetric tensor xx, yy, xy ((0, 0), (1, 1), (0, 1)).
Parity = Literal["position"] | tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class Plane:
    """Particles between `low` and `high` [m] along an axis have an image: mirrored in the `end` [m] of the domain, or
    aside by the `shift` [m] of a periodic one."""

    axis: int
    end: float
    low: float
    high: float
    shift: float = 0.0

    @property
    def change(self) -> float:
        """What a position becomes its image by: `shift` or `end`."""
        return self.shift or self.end


class ParticleExchange:
    """Brings particles, and copies of them, to the ranks that need them."""

    def __init__(self, blocks: Blocks, device: Device, kernels: SimpleNamespace) -> None:
        """`kernels`: those of mesh/kernels/rows.py and mesh/kernels/particles.py as built by the device of the
        particles."""
        self.blocks, self.device, self.kernels = blocks, device, kernels
        self.rows = Rows(device, kernels)
        self._grid = blocks.grid_on(device), blocks.table_on(device)
        self._owners = device.array(blocks.owners)
        self._periodic = sum(1 << axis for axis, ends in enumerate(blocks.grid.boundaries) if "periodic" in ends)
        self._key: Key | None = None
        self._images: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
        self.staged: Any = None  # memory that the last exchange may still read

    def migrate(self, columns: Columns, block: DualArray | None = None) -> DualArray:
        """Collective. All particles to the ranks that own their blocks.

        Rows are sorted by (block, id) where particles have come or gone; where they only changed blocks of this rank,
        all stay in their rows, so that what refers to rows remains valid.

        Each column is (n,) or (n, k), with the same names and dtypes on all ranks, among them "id" (n,) int64 and
        "position" (n, dimensions) [m]. Returns the curve index (own,) of each particle's block; `block` is what the
        last call returned, None for particles in any order. It comes back where no particle has changed blocks.
        """
        communicator, device = self.blocks.communicator, self.device
        (position,) = columns.read("position")
        count, unsorted = position.shape[0], block is None
        block = DualArray(device, np.full(count, -1)) if block is None else block
        moved = self._some_moved(position, block)
        now = block.host() if moved else np.empty(0, dtype=np.int64)
        owner = self.blocks.owners[now]
        leaving = np.flatnonzero(owner != communicator.rank)
        leaving = leaving[np.argsort(owner[leaving], kind="stable")]
        route = Route(communicator, owner[leaving])
        if not moved and not route.arriving:
            return block
        now, rows = block.host(), device.array(leaving)
        if not (unsorted or len(leaving) or route.arriving):
            return DualArray(device, now)
        arrived = route.brought(
            {name: device.download(self.rows.taken(columns.read(name)[0], rows)) for name in columns}
        )
        stays = np.flatnonzero(self.blocks.owners[now] == communicator.rank)
        home = np.concatenate([now[stays], self.blocks.block_of(arrived["position"])])
        order = np.lexsort((np.concatenate([columns["id"][stays], arrived["id"]]), home))
        rows = np.concatenate([stays, count + np.arange(len(arrived))])[order]
        if not np.array_equal(rows, np.arange(count)):
            kept = device.array(rows)
            for name in columns:
                others = device.array(np.ascontiguousarray(arrived[name]))
                columns.adopt(name, self.rows.taken(columns.read(name)[0], kept, others))
        return DualArray(device, home[order])

    def _some_moved(self, position: Any, block: DualArray) -> bool:
        """Whether particles are in other blocks than `block` says; then it says which."""
        moved = self.device.empty(chunks(position.shape[0]), np.int64)
        self.rows.reduce(self.kernels.find_moved, position.shape[0], position, block.device, *self._grid, moved)
        return bool(self.device.download(moved).any())

    def ghosts(
        self,
        position: Any,
        id: np.ndarray,
        reach: float,
        bonded: np.ndarray | None = None,
        image_reach: float | None = None,
        mirrors: Collection[str] = ("symmetry",),
    ) -> GhostPlan:
        """Collective. Who needs copies of which particles, and the images at symmetry planes and periodic ends.

        A rank gets as ghosts all particles of others within `reach` [m] (along every axis) of one of its blocks; blocks
        at the ends of the grid extend to infinity. Particles and ghosts within `image_reach` [m], by default `reach`,
        of the domain's ends of a kind among `mirrors` have images.
        `position` (own, dimensions) [m], of the device, and `id` (own,) are those of this rank's particles after
        `migrate`; `bonded`, on all ranks or none, holds the keys (see GhostPlan) of particles and images that this rank
        needs wherever they are. Raises InputError when a particle could have two images along one axis.
        """
        own, device = len(id), self.device
        image_reach = reach if image_reach is None else image_reach
        planes = self.planes(image_reach, mirrors, self._overhang(position))
        border, requested = self._border(position, reach, planes), self._bonded(id, bonded)
        chosen = np.unique(np.concatenate([border, *requested.values(), self._with_images(id, bonded)]))
        near = device.download(self.rows.taken(position, device.array(chosen)))
        pairs = [rank * own + rows for rank, rows in requested.items()] + self._near(near, chosen, own, reach)
        pairs += [pair for at, of in self._aside(near, planes) for pair in self._near(at, chosen[of], own, reach)]
        ranks, rows = np.divmod(np.unique(np.concatenate(pairs)), max(own, 1))
        route = Route(self.blocks.communicator, ranks)
        arrived = route.brought({"position": near[np.searchsorted(chosen, rows)], "id": id[rows]})
        row = np.concatenate([chosen, own + np.arange(len(arrived))])  # of what may have images
        position, known = np.concatenate([near, arrived["position"]]), np.concatenate([id[chosen], arrived["id"]])
        mask, change = self._mirrored(position, known, planes, bonded)
        source, mask = images(mask)
        key = self._known_key(id, np.concatenate([arrived["id"] * IMAGES, known[source] * IMAGES + mask]))
        found = Images(device, row[source], mask, self._periodic, change[source])
        return GhostPlan(own, len(key.host), key, self, route, device.array(rows), found)

    def _border(self, position: Any, reach: float, planes: list[Plane]) -> np.ndarray:
        """The own particles within `reach` of other ranks' blocks, or with images."""
        communicator = self.blocks.communicator
        if communicator.size == 1 and not planes:
            return np.empty(0, dtype=np.int64)
        axes = self.device.array(np.array([plane.axis for plane in planes], dtype=np.int64))
        low, high = (self.device.array(np.array([getattr(p, end) for p in planes])) for end in ("low", "high"))
        mark = self.device.empty(position.shape[0], np.int8)
        given = (position, reach, axes, low, high, *self._grid, self._owners, communicator.rank, mark)
        self.device.run(self.kernels.find_border, position.shape[0], *given)
        return self.device.download(self.rows.marked(mark)[1])

    def _overhang(self, position: Any) -> float:
        """Collective. How far particles are beyond periodic ends [m]."""
        if not self._periodic:
            return 0.0
        grid, bounds = self.blocks.grid, self.rows.bounds(position)
        axes = [axis for axis in range(grid.dimensions) if self._periodic >> axis & 1]
        beyond = [max(grid.lower[a] - bounds[0][a], bounds[1][a] - grid.upper[a], 0.0) for a in axes]
        return float(self.blocks.communicator.maximum(np.array([max(beyond)]))[0])

    def _aside(self, position: np.ndarray, planes: list[Plane]) -> list[tuple[np.ndarray, np.ndarray]]:
        """Where particles at a `position` (n, D) [m] have images aside, (m, D) each with which particles (m,) these are
        of; images of images, too."""
        found = [(position, np.arange(len(position)))]
        for axis in {plane.axis for plane in planes if plane.shift}:
            for at, source in list(found):
                for plane in (plane for plane in planes if plane.axis == axis):
                    close = (plane.low <= at[:, axis]) & (at[:, axis] <= plane.high)
                    moved = at[close].copy()
                    moved[:, axis] += plane.shift
                    found.append((moved, source[close]))
        return found[1:]

    def _mirrored(
        self, position: np.ndarray, id: np.ndarray, planes: list[Plane], bonded: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """The axes (n,), as bits, along which particles have images, and how these are changed (n, dimensions) [m]."""
        near, change = np.zeros(len(id), dtype=np.int64), np.zeros_like(position)
        for plane in planes:
            close = (plane.low <= position[:, plane.axis]) & (position[:, plane.axis] <= plane.high)
            near[close] |= 1 << plane.axis
            change[close, plane.axis] = plane.change
        if bonded is not None:
            self._need_images(position, id, bonded, planes, near, change)
        return near, change

    def _with_images(self, id: np.ndarray, bonded: np.ndarray | None) -> np.ndarray:
        """The own particles of which a bond needs an image; found again when `id` or `bonded` are other arrays."""
        if bonded is None:
            return np.empty(0, dtype=np.int64)
        if self._images is None or self._images[0] is not id or self._images[1] is not bonded:
            wanted = bonded[bonded % IMAGES > 0] // IMAGES
            self._images = id, bonded, np.flatnonzero(np.isin(id, wanted)) if len(wanted) else wanted
        return self._images[2]

    def _known_key(self, id: np.ndarray, others: np.ndarray) -> Key:
        """The keys of the own particles and the others: the same object as last time if they are the same."""
        last = self._key
        if last is None or last.id is not id or not np.array_equal(last.host[len(id) :], others):
            last = self._key = Key(self.device, id, np.concatenate([id * IMAGES, others]))
        return last

    @staticmethod
    def _need_images(
        position: np.ndarray,
        id: np.ndarray,
        bonded: np.ndarray,
        planes: list[Plane],
        near: np.ndarray,
        change: np.ndarray,
    ) -> None:
        """Enter the images that bonds need into `near` (n,) and `change` (n, dimensions): by the nearest ends."""
        bonded = bonded[bonded % IMAGES > 0]
        order = np.argsort(id)
        rows = order[np.searchsorted(id, bonded // IMAGES, sorter=order)]
        np.bitwise_or.at(near, rows, bonded % IMAGES)
        for axis in {plane.axis for plane in planes}:
            ends, changes = (np.array([getattr(p, k) for p in planes if p.axis == axis]) for k in ("end", "change"))
            change[rows, axis] = changes[np.argmin(np.abs(position[rows, axis][:, None] - ends), axis=1)]

    def _bonded(self, id: np.ndarray, bonded: np.ndarray | None) -> dict[int, np.ndarray]:
        """Collective. The own particles whose ids other ranks ask for, by rank."""
        communicator = self.blocks.communicator
        if bonded is None or communicator.size == 1:
            return {}
        requested = communicator.allgather(np.unique(bonded // IMAGES))
        others = (rank for rank in range(communicator.size) if rank != communicator.rank)
        return {rank: np.flatnonzero(np.isin(id, requested[rank])) for rank in others}

    def _near(self, position: np.ndarray, rows: np.ndarray, own: int, reach: float) -> list[np.ndarray]:
        """rank * own + row of the particles (n,) of the `rows` at the positions (n, dimensions) that are within `reach`
        of other ranks' blocks."""
        blocks = self.blocks
        lowest, highest = (blocks.coordinates_of(corner).T for corner in (position - reach, position + reach))
        pairs = [np.empty(0, dtype=np.int64)]
        for offset in product(*(range(n + 1) for n in (highest - lowest).max(axis=1, initial=0))):
            block = lowest + np.array(offset)[:, None]
            inside = (block <= highest).all(axis=0)
            rank = blocks.owners[blocks.index_at(block[:, inside].T)]
            other = rank != blocks.communicator.rank
            pairs.append(rank[other] * own + rows[inside][other])
        return pairs

    def planes(
        self, reach: float = 0.0, mirrors: Collection[str] = ("symmetry",), overhang: float = 0.0
    ) -> list[Plane]:
        """Those of all images. At mirrors particles have one within `reach` [m]; at periodic ends all that may be
        within it of what is up to `overhang` [m] beyond the other end. Raises InputError when a particle could have two
        along one axis."""
        grid, planes = self.blocks.grid, []
        for axis in range(grid.dimensions):
            kinds, ends = grid.boundaries[axis], (grid.lower[axis], grid.upper[axis])
            wide, far = ends[1] - ends[0], reach + overhang
            if "periodic" in kinds:
                if wide <= 2.0 * far:
                    text = f"{wide} m between periodic ends; particles {overhang} m beyond them reach {reach} m"
                    raise InputError([f"domain: {text}, and would meet what they have met"])
                planes.append(Plane(axis, ends[0], -np.inf, ends[0] + far, wide))
                planes.append(Plane(axis, ends[1], ends[1] - far, np.inf, -wide))
            found = [at for kind, at in zip(kinds, ends, strict=True) if kind in mirrors]
            if len(found) == 2 and wide <= 2 * reach:
                raise InputError([f"domain: planes {found} m that mirror are less than {2 * reach} m apart"])
            planes += [Plane(axis, at, at - reach, at + reach) for at in found]
        return planes


def images(near: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(source, mask) of all images of particles that are near the planes of the axes in the bits of `near` (n,)."""
    sources = [np.flatnonzero(near & mask == mask) for mask in range(1, IMAGES)]
    masks = [np.full(len(source), mask) for mask, source in enumerate(sources, start=1)]
    return np.concatenate(sources), np.concatenate(masks)


class Key:
    """Keys (count,) int64 of particles, ghosts and images, on the `host` and on the `device`."""

    def __init__(self, device: Device, id: np.ndarray, host: np.ndarray) -> None:
        self.id, self.host, self.device = id, host, device.array(host)


class Images:
    """On the device: the rows (count,) that images are of, the axes along which they are images, those of them that
    mirror, and how positions change; all images are `shifted` along the axes in these bits."""

    def __init__(self, device: Device, source: np.ndarray, mask: np.ndarray, shifted: int, change: np.ndarray) -> None:
        self.count, self.shifted = len(source), shifted
        self.source, self.mask, self.change = device.array(source), device.array(mask), device.array(change)
        self.mirrored = device.array(mask & ~shifted)


@dataclass
class GhostPlan:
    """This rank's particles, then its ghosts in the order of their ranks and rows there, then the images of both.

    own     number of this rank's particles
    count   number of particles, ghosts and images
    key     (count,) int64: 8 id + the axes along which it is an image (bit a: axis a); unique. One object as long as
            nothing of it changes
    """

    own: int
    count: int
    key: Key
    _exchange: ParticleExchange
    _route: Route
    _rows: Any
    _images: Images

    def exchange(self, arrays: Sequence[tuple[Any, Parity]]) -> list[Any]:
        """Collective. Each (array (own,) or (own, k) of float64, parity) extended to (count, ...) with ghosts and
        images; arrays are the device's."""
        widths = np.array([int(np.prod(array.shape[1:])) for array, _ in arrays])
        columns, stride = np.cumsum(widths) - widths, int(widths.sum())
        packed = self._brought([array for array, _ in arrays], widths, columns, stride)
        return [
            self._extended(array, parity, int(width), stride, int(column), packed)
            for (array, parity), width, column in zip(arrays, widths, columns, strict=True)
        ]

    def _brought(self, arrays: Sequence[Any], widths: np.ndarray, columns: np.ndarray, stride: int) -> Any:
        """The packed rows of the ghosts."""
        exchange, device, route = self._exchange, self._exchange.device, self._route
        if not route.leaving and not route.arriving:
            return device.empty(0)

        def pack(packed: Any) -> None:
            for array, width, column in zip(arrays, widths, columns, strict=True):
                row = (self._rows, int(width), array.reshape(-1), stride, int(column), packed)
                device.run(exchange.kernels.pack_rows, route.leaving, *row)

        arrived, exchange.staged = route.carry(device, stride, np.dtype(np.float64), pack)
        return arrived

    def _extended(self, array: Any, parity: Parity, width: int, stride: int, column: int, packed: Any) -> Any:
        device, kernels, images = self._exchange.device, self._exchange.kernels, self._images
        extended, first = device.empty((self.count, *array.shape[1:])), self.count - images.count
        flat = extended.reshape(-1)
        device.run(kernels.extend, first, self.own, width, array.reshape(-1), stride, column, packed, flat)
        if parity == "position":
            given = (images.source, images.mask, images.shifted, images.change)
            device.run(kernels.position_images, images.count, first, width, *given, flat)
        elif images.count:
            odd = [sum(1 << axis for axis in set(axes) if axes.count(axis) % 2) for axes in parity]
            signs = device.array(np.array(odd))
            device.run(kernels.mirror_values, images.count, first, width, images.source, images.mirrored, signs, flat)
        return extended
