"""Blasts by the curves of Kingery and Bulmash on the faces of bodies."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from distfsi.air_blast import FREE_AIR, SURFACE, air_blast, friedlander_decay
from distfsi.narrowing import present
from distfsi.scene.description import BlastLoad, Domain, Scene, Solid
from distfsi.scene.facets import Facets, facets_of
from distfsi.scene.packing import pack

BURSTS = {"free_air": FREE_AIR, "surface": SURFACE}
SMALLEST_DECAY = 0.01  # below, a wave is a straight line but for what rounding leaves of it


class Wave(NamedTuple):
    """Friedlander's waves of a blast at a point: arrival and duration [s], pressures [Pa] and decays."""

    arrival: float
    duration: float
    reflected: float
    reflected_decay: float
    incident: float
    incident_decay: float


def wave_at(load: BlastLoad, distance: float) -> Wave:
    """The waves at a `distance` [m]; raises ValueError, in words, where the curves have none."""
    blast = air_blast(load.mass, distance, BURSTS[load.burst])
    z = f"at a distance of {distance:.4g} m, Z = {blast.scaled_distance:.4g} m/kg^(1/3)"
    if blast.duration is None:
        first = BURSTS[load.burst].first_duration
        raise ValueError(f"{z}, the curves have no duration; they have one from {first:g} on")
    decays = []
    for pressure, impulse in (
        (blast.reflected_pressure, blast.reflected_impulse),
        (blast.incident_pressure, blast.incident_impulse),
    ):
        decay = friedlander_decay(pressure, blast.duration, impulse)
        if decay is None or decay < SMALLEST_DECAY:
            raise ValueError(f"{z}, no decay of Friedlander's wave reaches the impulse of the curves")
        decays.append(decay)
    return Wave(
        load.start + blast.arrival,
        blast.duration,
        blast.reflected_pressure,
        decays[0],
        blast.incident_pressure,
        decays[1],
    )


class LoadedParticles(NamedTuple):
    """What a blast does to each of a scene's particles, in the order of their ids: waves (n, 6), without duration where
    it meets no face; areas times the direction of the force (n, D) of the reflected and of the incident part."""

    wave: np.ndarray
    reflected: np.ndarray
    incident: np.ndarray


def loaded_particles(scene: Scene, load: BlastLoad) -> LoadedParticles:
    """Raises ValueError, in words, where the curves do not hold or a body has no lattice.

    On a face met at an angle of incidence a presses p_r cos^2 a + p_i (1 + cos^2 a - 2 cos a), on one that looks away
    p_i (Randers-Pehrson and Bannister, ARL-TR-1310, 1997).
    """
    D, center, parts = scene.domain.dimensions, np.array(load.center), []
    for facets in facets_of_bodies(present(scene.solid), scene.domain):
        way = center - facets.center
        distance = np.linalg.norm(way, axis=1)
        cosine = np.maximum((way * facets.normal).sum(axis=1) / np.maximum(distance, 1e-300), 0.0)
        waves, each = _waves(load, distance)
        wave = np.zeros((facets.particles, len(Wave._fields)))
        reflected, incident = (np.zeros((facets.particles, D)) for _ in range(2))
        # A particle at an edge has several faces: the wave is that of the nearest.
        order = np.argsort(-distance, kind="stable")
        wave[facets.particle[order]] = waves[each[order]]
        force = -facets.area[:, None] * facets.outward
        np.add.at(reflected, facets.particle, force * (cosine**2)[:, None])
        np.add.at(incident, facets.particle, force * (1.0 + cosine**2 - 2.0 * cosine)[:, None])
        parts.append((wave, reflected, incident))
    return LoadedParticles(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def facets_of_bodies(solid: Solid, domain: Domain) -> Iterator[Facets]:
    """The free sides of the particles of each body. Raises ValueError, in words, where one has no lattice."""
    for body in solid.bodies:
        position, volume = pack(body, domain.lower, domain.upper)
        yield facets_of(body, position, volume, domain, [other.shape for other in solid.bodies if other is not body])


def _waves(load: BlastLoad, distance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The waves at all different distances, and which one each has."""
    different, each = np.unique(distance, return_inverse=True)
    return np.array([wave_at(load, float(r)) for r in different]).reshape(-1, len(Wave._fields)), each
