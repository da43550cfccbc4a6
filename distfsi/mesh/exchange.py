"""Ghost exchange: fills the ghost cells of a field from the same rank, from other ranks and from the boundaries."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from mpi4py import MPI

from distfsi.mesh.blocks import Blocks
from distfsi.mesh.regions import Regions

Copy = Callable[[int, int, np.ndarray, np.ndarray, np.ndarray, np.ndarray], None]


class Messages:
    """The regions that one message per other rank brings or takes: sorted by rank, then as `Regions.of` sorts them."""

    def __init__(self, regions: Regions, ranks: np.ndarray) -> None:
        """`ranks` (n,): the rank at the other end of each region."""
        self.regions = regions.select(np.argsort(ranks, kind="stable"))
        self.ranks, regions_per_rank = np.unique(ranks, return_counts=True)
        ends = np.cumsum(regions_per_rank)
        cells = np.append(0, np.cumsum(self.regions.volume))
        self.cells = cells[np.append(0, ends)]

    def buffer(self, variables: int, dtype: np.dtype) -> Buffer:
        """A buffer for all messages about a field of so many variables."""
        values = np.empty(self.cells[-1] * variables, dtype=dtype)
        parts = [values[a:b] for a, b in pairwise((self.cells * variables).tolist())]
        return Buffer(values, list(zip(self.ranks.tolist(), parts, strict=True)))


@dataclass
class Buffer:
    """The flat `values` of all messages, and the part of it that is each rank's message."""

    values: np.ndarray
    parts: list[tuple[int, np.ndarray]]


@dataclass
class Plan:
    """The tables and buffers to exchange fields of one number of variables and one dtype."""

    local: np.ndarray
    inflow: np.ndarray
    pack: np.ndarray
    unpack: np.ndarray
    outgoing: Buffer
    incoming: Buffer


class GhostExchange:
    """Fills the ghost cells of fields of `blocks`, edges and corners included; one exchange at a time.

    ready, waiting: local blocks whose ghosts are complete after `start`, and those that need `finish`.
    """

    def __init__(self, blocks: Blocks, copy: Copy) -> None:
        """`copy` is the compiled `kernels.regions.copy_regions`."""
        self.blocks = blocks
        self._copy = copy
        self._world = blocks.communicator.world
        rank = blocks.communicator.rank
        wanted, given = Regions.of(blocks, "block"), Regions.of(blocks, "source")
        self._inflow = wanted.select(wanted.constant)
        wanted, given = wanted.select(~wanted.constant), given.select(~given.constant)
        giver, taker = blocks.owners[wanted.source], blocks.owners[given.block]
        self._local = wanted.select(giver == rank)
        self._incoming = Messages(wanted.select(giver != rank), giver[giver != rank])
        self._outgoing = Messages(given.select(taker != rank), taker[taker != rank])
        self.waiting = np.unique(self._incoming.regions.block) - blocks.first
        self.ready = np.setdiff1d(np.arange(blocks.local_count), self.waiting)
        self._plans: dict[tuple[int, np.dtype], Plan] = {}

    def start(self, field: np.ndarray, mirror: np.ndarray, inflow: np.ndarray | None = None) -> None:
        """Send what other ranks need of `field`, and fill the ghosts whose source is on this rank.

        field   (local_count, variables, Z, Y, X), C-contiguous
        mirror  (variables,) int64: axis whose reflection changes the variable's sign, -1 for none
        inflow  (3, 2, variables): constants per axis and side, needed where a boundary is an inflow
        """
        plan = self._plan(field.shape[1], field.dtype)
        flat = field.reshape(-1, copy=False)
        self._requests = [self._world.Irecv(part, rank) for rank, part in plan.incoming.parts]
        self._run(plan.pack, plan.outgoing.values, flat, mirror)
        self._requests += [self._world.Isend(part, rank) for rank, part in plan.outgoing.parts]
        self._run(plan.local, flat, flat, mirror)
        if len(plan.inflow):
            self._run(plan.inflow, flat, np.ascontiguousarray(inflow, field.dtype).reshape(-1), mirror)
        self._unpack = (plan.unpack, flat, plan.incoming.values, mirror)

    def finish(self) -> None:
        """Wait for the messages and fill the remaining ghosts."""
        MPI.Request.Waitall(self._requests)
        self._run(*self._unpack)

    def traffic(self, field: np.ndarray) -> tuple[int, int]:
        """Bytes and messages that this rank sends in one exchange of `field`."""
        outgoing = self._plan(field.shape[1], field.dtype).outgoing
        return outgoing.values.nbytes, len(outgoing.parts)

    def _run(self, table: np.ndarray, destination: np.ndarray, source: np.ndarray, mirror: np.ndarray) -> None:
        if len(table):
            self._copy(0, len(table), table, destination, source, mirror)

    def _plan(self, variables: int, dtype: np.dtype) -> Plan:
        plan = self._plans.get((variables, dtype))
        if plan is None:
            plan = self._plans[variables, dtype] = self._new_plan(variables, dtype)
        return plan

    def _new_plan(self, variables: int, dtype: np.dtype) -> Plan:
        local, inflow = self._local, self._inflow
        out, into = self._outgoing.regions, self._incoming.regions
        in_field = partial(Regions.in_field, blocks=self.blocks, variables=variables)
        return Plan(
            local=local.table(in_field(local, end="block"), in_field(local, end="source")),
            inflow=inflow.table(in_field(inflow, end="block"), inflow.in_constants(variables)),
            pack=out.table(out.in_message(variables), in_field(out, end="source")),
            unpack=into.table(in_field(into, end="block"), into.in_message(variables), mirrored=False),
            outgoing=self._outgoing.buffer(variables, dtype),
            incoming=self._incoming.buffer(variables, dtype),
        )
