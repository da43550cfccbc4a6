"""Connected pieces: what intact bonds hold together, across ranks."""

from __future__ import annotations

import numpy as np

from distfsi.device.interface import Device
from distfsi.mesh.blocks import Blocks
from distfsi.mesh.communicator import Communicator
from distfsi.mesh.particles import GhostPlan


def label(id: np.ndarray, links: np.ndarray, plan: GhostPlan, device: Device, communicator: Communicator) -> np.ndarray:
    """Collective. (own,) the smallest id in the piece of each particle of this rank.

    `id` (own + ghosts,); `links` (2, n): rows of bonded pairs. Each rank labels what it knows; where a particle has
    different labels on different ranks, these name one piece.
    """
    local = _smallest(id, links)
    (labels,) = plan.exchange([(device.array(local[: plan.own].astype(float)), ((),))])
    same = np.stack([local, device.download(labels)[: len(id)].astype(np.int64)], axis=1)
    same = communicator.concatenate(np.unique(same[same[:, 0] != same[:, 1]], axis=0))
    names, ends = np.unique(same, return_inverse=True)
    merged = _smallest(names, ends.reshape(-1, 2).T)
    found = np.searchsorted(names, local[: plan.own])
    known = np.append(names, -1)[found] == local[: plan.own]
    return np.where(known, np.append(merged, -1)[found], local[: plan.own])


def _smallest(names: np.ndarray, links: np.ndarray) -> np.ndarray:
    """The smallest of the `names` (n,) that each of them is linked with; `links` (2, m) index the `names`."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    n = len(names)
    _, component = connected_components(coo_array((np.ones(links.shape[1], dtype=bool), tuple(links)), (n, n)), False)
    smallest = np.full(n, np.iinfo(np.int64).max)
    np.minimum.at(smallest, component, names)
    return smallest[component]


def table(columns: dict[str, np.ndarray], block: np.ndarray, blocks: Blocks) -> dict[str, np.ndarray]:
    """Collective. The pieces of all ranks, in the order of their labels, each (pieces,) or (pieces, D).

    piece (label), particles (number), mass [kg], center [m] and velocity [m/s] of the center of mass, size [m] (the
    extent along each axis). `block` (own,) is the local block of each particle.
    """
    c, D = columns, columns["position"].shape[1]
    stride = c["piece"].max(initial=0) + 1
    groups, group = np.unique(block * stride + c["piece"], return_inverse=True)
    mass = c["mass"][:, None]
    amounts = np.hstack([np.ones_like(mass), mass, mass * c["position"], mass * c["velocity"]])
    sums = np.zeros((len(groups), amounts.shape[1]))
    np.add.at(sums, group, amounts)
    ends = np.full((len(groups), 2 * D), -np.inf)
    np.maximum.at(ends, group, np.hstack([c["position"], -c["position"]]))
    names = blocks.communicator.concatenate(groups % stride)
    everything = blocks.communicator.concatenate(np.hstack([sums, ends]))
    labels, piece = np.unique(names, return_inverse=True)
    total, extent = np.zeros((len(labels), sums.shape[1])), np.full((len(labels), 2 * D), -np.inf)
    np.add.at(total, piece, everything[:, : sums.shape[1]])
    np.maximum.at(extent, piece, everything[:, sums.shape[1] :])
    count, mass, first, momentum = np.split(total, [1, 2, 2 + D], axis=1)
    return {
        "piece": labels,
        "particles": count[:, 0].astype(np.int64),
        "mass": mass[:, 0],
        "center": first / mass,
        "velocity": momentum / mass,
        "size": extent[:, :D] + extent[:, D:],
    }
