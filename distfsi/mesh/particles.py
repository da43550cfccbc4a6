"""Particles on the move between ranks, copies of those near a rank's blocks, mirror images of those near a plane."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from mpi4py import MPI

from distfsi.errors import InputError
from distfsi.mesh.blocks import Blocks
from distfsi.mesh.communicator import Communicator

IMAGES = 8  # an id and its images: bit a of an image's number says that it is mirrored along axis a

# How a value changes in an image: "position" is mirrored about the plane; otherwise, for each component, the axes whose
# reflection changes its sign: scalar ((),), vector ((0,), (1,)), symmetric tensor xx, yy, xy ((0, 0), (1, 1), (0, 1)).
Parity = str | tuple[tuple[int, ...], ...]


class Route:
    """Who sends how many rows to whom: found once, then used for any number of transfers."""

    def __init__(self, communicator: Communicator, ranks: np.ndarray) -> None:
        """Collective. `ranks` (n,) ascending: where each of the rows to come goes; never this rank."""
        self._world = communicator.world
        leaving = np.bincount(ranks, minlength=communicator.size)
        arriving = np.empty_like(leaving)
        self._world.Alltoall(leaving, arriving)
        self._leaving, self._arriving = self._slices(leaving), self._slices(arriving)
        self.arriving = int(arriving.sum())

    @staticmethod
    def _slices(counts: np.ndarray) -> list[tuple[int, slice]]:
        ends = np.cumsum(counts)
        return [(int(r), slice(ends[r] - counts[r], ends[r])) for r in np.flatnonzero(counts)]

    def transfer(self, rows: np.ndarray) -> np.ndarray:
        """Send `rows` (n,) of a structured dtype; the rows from all others, in rank order. One message per pair."""
        arrived = np.empty(self.arriving, dtype=rows.dtype)
        requests = [self._world.Irecv(arrived[part].view(np.uint8), rank) for rank, part in self._arriving]
        requests += [self._world.Isend(rows[part].view(np.uint8), rank) for rank, part in self._leaving]
        MPI.Request.Waitall(requests)
        return arrived


def pack(columns: dict[str, np.ndarray], rows: np.ndarray) -> np.ndarray:
    """The `rows` of all columns as one structured array."""
    packed = np.empty(len(rows), dtype=[(name, c.dtype, c.shape[1:]) for name, c in columns.items()])
    for name, column in columns.items():
        packed[name] = column[rows]
    return packed


def ascending(block: np.ndarray, id: np.ndarray) -> bool:
    """Whether the pairs (block, id) are in order."""
    same = block[1:] == block[:-1]
    return bool(((block[1:] > block[:-1]) | (same & (id[1:] > id[:-1]))).all())


class ParticleExchange:
    """Brings particles, and copies of them, to the ranks that need them."""

    def __init__(self, blocks: Blocks) -> None:
        self.blocks = blocks

    def migrate(self, columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Collective. All particles on the ranks that own their blocks, sorted by (block, id).

        Each column is (n,) or (n, k), with the same names and dtypes on all ranks, among them "id" (n,) int64 and
        "position" (n, dimensions) [m]. Where nothing changes, the columns returned are the ones given.
        """
        communicator = self.blocks.communicator
        block = self.blocks.block_of(columns["position"])
        owner = self.blocks.owners[block]
        stays = owner == communicator.rank
        leaving = np.flatnonzero(~stays)
        leaving = leaving[np.argsort(owner[leaving], kind="stable")]
        route = Route(communicator, owner[leaving])
        arrived = route.transfer(pack(columns, leaving))
        if len(leaving) or route.arriving:
            columns = {name: np.concatenate([column[stays], arrived[name]]) for name, column in columns.items()}
            block = self.blocks.block_of(columns["position"])
        if ascending(block, columns["id"]):
            return columns
        order = np.lexsort((columns["id"], block))
        return {name: column[order] for name, column in columns.items()}

    def ghosts(
        self,
        position: np.ndarray,
        id: np.ndarray,
        reach: float,
        bonded: np.ndarray | None = None,
        image_reach: float | None = None,
        mirrors: Collection[str] = ("symmetry",),
    ) -> GhostPlan:
        """Collective. Who needs copies of which particles, and the images at symmetry planes.

        A rank gets as ghosts all particles of others within `reach` [m] (along every axis) of one of its blocks; blocks
        at the ends of the grid extend to infinity. Particles and ghosts within `image_reach` [m], by default `reach`,
        of the domain's ends of a kind among `mirrors` have images.
        `position` (own, dimensions) [m] and `id` (own,) are those of this rank's particles after `migrate`; `bonded`,
        on all ranks or none, holds the keys (see GhostPlan) of particles and images that this rank needs wherever they
        are. Raises InputError when a particle could have two images along one axis.
        """
        own = len(id)
        image_reach = reach if image_reach is None else image_reach
        planes = self.planes(image_reach, mirrors)
        pairs = self._near(position, reach)
        if bonded is not None and self.blocks.communicator.size > 1:
            pairs += self._bonded(id, np.unique(bonded // IMAGES))
        ranks, rows = np.divmod(np.unique(np.concatenate(pairs)), max(own, 1))
        route = Route(self.blocks.communicator, ranks)
        arrived = route.transfer(pack({"position": position, "id": id}, rows))
        position, id = np.concatenate([position, arrived["position"]]), np.concatenate([id, arrived["id"]])
        near = np.zeros(len(id), dtype=np.int64)
        plane = np.zeros_like(position)
        for axis, place in planes:
            close = np.abs(position[:, axis] - place) <= image_reach
            near[close] |= 1 << axis
            plane[close, axis] = place
        if bonded is not None:
            self._need_images(position, id, bonded, planes, near, plane)
        source, mask = images(near)
        key = np.concatenate([id * IMAGES, id[source] * IMAGES + mask])
        return GhostPlan(own, len(key), key, route, rows, source, mask, plane[source])

    @staticmethod
    def _need_images(
        position: np.ndarray,
        id: np.ndarray,
        bonded: np.ndarray,
        planes: list[tuple[int, float]],
        near: np.ndarray,
        plane: np.ndarray,
    ) -> None:
        """Enter the images that bonds need into `near` (n,) and `plane` (n, dimensions): in the nearest planes."""
        bonded = bonded[bonded % IMAGES > 0]
        order = np.argsort(id)
        rows = order[np.searchsorted(id, bonded // IMAGES, sorter=order)]
        np.bitwise_or.at(near, rows, bonded % IMAGES)
        for axis in {axis for axis, _ in planes}:
            places = np.array([place for a, place in planes if a == axis])
            nearest = places[np.argmin(np.abs(position[rows, axis][:, None] - places), axis=1)]
            plane[rows, axis] = nearest

    def _bonded(self, id: np.ndarray, bonded: np.ndarray) -> list[np.ndarray]:
        """rank * own + row of the own particles whose ids other ranks ask for."""
        communicator = self.blocks.communicator
        asked = communicator.allgather(bonded)
        others = (rank for rank in range(communicator.size) if rank != communicator.rank)
        return [rank * len(id) + np.flatnonzero(np.isin(id, asked[rank])) for rank in others]

    def _near(self, position: np.ndarray, reach: float) -> list[np.ndarray]:
        """rank * own + row of the own particles within `reach` of other ranks' blocks."""
        blocks = self.blocks
        lowest, highest = blocks.coordinates_of(position - reach), blocks.coordinates_of(position + reach)
        near = np.flatnonzero(blocks.index_at(lowest) != blocks.index_at(highest))
        lowest, highest = lowest.T[:, near], highest.T[:, near]
        pairs = [np.empty(0, dtype=np.int64)]
        for offset in product(*(range(n + 1) for n in (highest - lowest).max(axis=1, initial=0))):
            block = lowest + np.array(offset)[:, None]
            inside = (block <= highest).all(axis=0)
            rank = blocks.owners[blocks.index_at(block[:, inside].T)]
            other = rank != blocks.communicator.rank
            pairs.append(rank[other] * len(position) + near[inside][other])
        return pairs

    def planes(self, reach: float = 0.0, mirrors: Collection[str] = ("symmetry",)) -> list[tuple[int, float]]:
        """(axis, place [m]) of the planes that mirror; raises InputError when two are less than twice `reach` apart."""
        grid = self.blocks.grid
        planes = []
        for axis in range(grid.dimensions):
            ends = zip(grid.boundaries[axis], (grid.lower[axis], grid.upper[axis]), strict=True)
            places = [place for kind, place in ends if kind in mirrors]
            if len(places) == 2 and places[1] - places[0] <= 2 * reach:
                raise InputError([f"domain: planes {places} m that mirror are less than {2 * reach} m apart"])
            planes += [(axis, place) for place in places]
        return planes


def images(near: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(source, mask) of all images of particles that are near the planes of the axes in the bits of `near` (n,)."""
    sources = [np.flatnonzero(near & mask == mask) for mask in range(1, IMAGES)]
    masks = [np.full(len(source), mask) for mask, source in enumerate(sources, start=1)]
    return np.concatenate(sources), np.concatenate(masks)


@dataclass
class GhostPlan:
    """This rank's particles, then its ghosts in (block, id) order, then the images of both.

    own     number of this rank's particles
    count   number of particles, ghosts and images
    key     (count,) int64: 8 id + the axes an image is mirrored along (bit a: axis a); unique
    """

    own: int
    count: int
    key: np.ndarray
    _route: Route
    _rows: np.ndarray
    _image_source: np.ndarray
    _image_mask: np.ndarray
    _image_plane: np.ndarray

    def exchange(self, arrays: Sequence[tuple[np.ndarray, Parity]]) -> list[np.ndarray]:
        """Collective. Each (array (own,) or (own, k), parity) extended to (count, ...) with ghosts and images."""
        columns = {str(i): array for i, (array, _) in enumerate(arrays)}
        arrived = self._route.transfer(pack(columns, self._rows))
        return [self._extend(array, arrived[str(i)], parity) for i, (array, parity) in enumerate(arrays)]

    def _extend(self, array: np.ndarray, ghosts: np.ndarray, parity: Parity) -> np.ndarray:
        extended = np.empty((self.count, *array.shape[1:]), dtype=array.dtype)
        particles = self.own + len(ghosts)
        extended[: self.own] = array
        extended[self.own : particles] = ghosts
        if particles < self.count:
            extended[particles:] = self._mirror(extended[self._image_source], parity)
        return extended

    def _mirror(self, values: np.ndarray, parity: Parity) -> np.ndarray:
        """The `values` of the images' sources as seen in the mirrors."""
        if parity == "position":
            mirrored = self._image_mask[:, None] >> np.arange(values.shape[1]) & 1 == 1
            return np.where(mirrored, 2.0 * self._image_plane - values, values)
        flips = np.stack([self._image_mask >> axis & 1 for axis in range(3)])
        odd = np.stack([flips[list(axes)].sum(axis=0) % 2 == 1 for axes in parity], axis=1)
        return np.where(odd.reshape(values.shape), -values, values)
