"""Ghost exchange: fills the ghost cells of a field from the same rank, from other ranks and from the boundaries."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from mpi4py import MPI

from distfsi.device.interface import Device
from distfsi.mesh.blocks import Blocks
from distfsi.mesh.regions import Regions
from distfsi.narrowing import present


class Messages:
    """The regions that one message per other rank brings or takes: sorted by rank, then as `Regions.of` sorts them."""

    def __init__(self, regions: Regions, ranks: np.ndarray) -> None:
        """`ranks` (n,): the rank at the other end of each region."""
        self.regions = regions.select(np.argsort(ranks, kind="stable"))
        self.ranks, regions_per_rank = np.unique(ranks, return_counts=True)
        ends = np.cumsum(regions_per_rank)
        cells = np.append(0, np.cumsum(self.regions.volume))
        self.cells = cells[np.append(0, ends)]

    def rank_of_cells(self) -> np.ndarray:
        """The rank (n,) at the other end of each cell."""
        return np.repeat(self.ranks, np.diff(self.cells))

    def buffer(self, variables: int, dtype: np.dtype, device: Device) -> Buffer:
        """A buffer for all messages about a field of so many variables."""
        values = device.message_memory(int(self.cells[-1]) * variables, dtype)
        parts = [values[a:b] for a, b in pairwise((self.cells * variables).tolist())]
        return Buffer(values, device.staging_array(values), list(zip(self.ranks.tolist(), parts, strict=True)))


@dataclass
class Buffer:
    """The flat `values` of all messages where MPI takes them and on the device, and the part that is each rank's."""

    values: Any
    device: Any
    parts: list[tuple[int, Any]]


@dataclass
class Table:
    """Regions to copy, on the device, and how many there are."""

    count: int
    device: Any


@dataclass
class Plan:
    """The tables and buffers to exchange fields of one number of variables and one dtype."""

    local: Table
    inflow: Table
    pack: Table
    unpack: Table
    outgoing: Buffer
    incoming: Buffer


class GhostExchange:
    """Fills the ghost cells of fields of `blocks`, edges and corners included; one exchange at a time.

    local, incoming, outgoing: the regions filled from this rank, and the messages from others and to them.
    ready, waiting: local blocks whose ghosts are complete after `start`, and those that need `finish`.
    """

    def __init__(self, blocks: Blocks, device: Device, copy: Any) -> None:
        """`copy`: `kernels.regions.copy_regions` as built by the device that holds the fields."""
        self.blocks, self.device = blocks, device
        self._copy = copy
        self._world = blocks.communicator.world
        rank = blocks.communicator.rank
        wanted, given = Regions.of(blocks, "block"), Regions.of(blocks, "source")
        self._inflow = wanted.select(wanted.constant)
        wanted, given = wanted.select(~wanted.constant), given.select(~given.constant)
        giver, taker = blocks.owners[wanted.source], blocks.owners[given.block]
        self.local = wanted.select(giver == rank)
        self.incoming = Messages(wanted.select(giver != rank), giver[giver != rank])
        self.outgoing = Messages(given.select(taker != rank), taker[taker != rank])
        self.waiting = np.unique(self.incoming.regions.block) - blocks.first
        self.ready = np.setdiff1d(np.arange(blocks.local_count), self.waiting)
        self._plans: dict[tuple[int, np.dtype], Plan] = {}
        # What start() leaves to finish().
        self._requests: list[MPI.Request] = []
        self._unpack: tuple[Plan, Any, Any] | None = None

    def start(self, field: Any, mirror: np.ndarray, inflow: np.ndarray | None = None) -> None:
        """Send what other ranks need of `field`, and fill the ghosts whose source is on this rank.

        field   (local_count, variables, Z, Y, X), C-contiguous, of the device
        mirror  (variables,) int64: axis whose reflection changes the variable's sign, -1 for none
        inflow  (3, 2, variables): constants per axis and side, needed where a boundary is an inflow
        """
        plan, device = self._plan(field.shape[1], field.dtype), self.device
        flat, mirror = field.reshape(-1), device.array(mirror)
        with device.asynchronous():
            self._run(plan.pack, plan.outgoing.device, flat, mirror)
            device.download_to(plan.outgoing.values, plan.outgoing.device)
        device.finish_asynchronous()  # and the last exchange has read what it received
        self._requests = [self._world.Irecv(part, rank) for rank, part in plan.incoming.parts]
        self._requests += [self._world.Isend(part, rank) for rank, part in plan.outgoing.parts]
        self._run(plan.local, flat, flat, mirror)
        if plan.inflow.count:
            constants = device.array(np.ascontiguousarray(inflow, field.dtype).reshape(-1))
            self._run(plan.inflow, flat, constants, mirror)
        self._unpack = (plan, flat, mirror)

    def finish(self) -> None:
        """Wait for the messages and fill the remaining ghosts."""
        plan, flat, mirror = present(self._unpack)
        MPI.Request.Waitall(self._requests)
        with self.device.asynchronous():
            self.device.upload(plan.incoming.device, plan.incoming.values)
            self._run(plan.unpack, flat, plan.incoming.device, mirror)
        self.device.join_asynchronous()

    def traffic(self, field: np.ndarray) -> tuple[int, int]:
        """Bytes and messages that this rank sends in one exchange of `field`."""
        outgoing = self._plan(field.shape[1], field.dtype).outgoing
        return outgoing.values.shape[0] * outgoing.values.dtype.itemsize, len(outgoing.parts)

    def _run(self, table: Table, destination: Any, source: Any, mirror: Any) -> None:
        self.device.run_few(self._copy, table.count, table.device, destination, source, mirror)

    def _plan(self, variables: int, dtype: np.dtype) -> Plan:
        plan = self._plans.get((variables, dtype))
        if plan is None:
            plan = self._plans[variables, dtype] = self._new_plan(variables, dtype)
        return plan

    def _new_plan(self, variables: int, dtype: np.dtype) -> Plan:
        local, inflow = self.local, self._inflow
        out, into = self.outgoing.regions, self.incoming.regions
        in_field = partial(Regions.in_field, blocks=self.blocks, variables=variables)
        tables = {
            "local": local.table(in_field(local, end="block"), in_field(local, end="source")),
            "inflow": inflow.table(in_field(inflow, end="block"), inflow.in_constants(variables)),
            "pack": out.table(out.in_message(variables), in_field(out, end="source")),
            "unpack": into.table(in_field(into, end="block"), into.in_message(variables), mirrored=False),
        }
        device = self.device
        return Plan(
            **{name: Table(len(table), device.array(table)) for name, table in tables.items()},
            outgoing=self.outgoing.buffer(variables, dtype, device),
            incoming=self.incoming.buffer(variables, dtype, device),
        )
