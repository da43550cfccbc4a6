"""Scenes of a blast by a charge of TNT and a distance, as commented text: `distfsi new`."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, pi
from pathlib import Path

from distfsi.air_blast import FREE_AIR, SURFACE, AirBlast, air_blast
from distfsi.errors import InputError
from distfsi.narrowing import present
from distfsi.scene.materials import find

CELLS_OF_RADIUS = (
    20  # of the charge, in spherical coordinates: peaks then are within some percent (`check` warns below 8)
)
BESIDE = 0.85  # of the distance: where the front is when the run goes on in three dimensions
LASTING = 1.3  # positive phases for which the run goes on behind the arrival
SPEED = 450.0  # [m/s] of waves behind a reflected front: how far away open ends must be not to be felt
NARROWEST = 0.4  # of the distance: width and height at least


@dataclass(frozen=True)
class Blast:
    """A charge of so much TNT [kg] at a distance [m]: a sphere in free air or, where a wall stands at that distance, a
    hemisphere on the ground; `cells`: how many of them there are between charge and wall."""

    tnt: float
    distance: float
    wall: bool = False
    cells: int = 125

    @property
    def curves(self) -> AirBlast:
        """What UFC 3-340-02 gives. Raises InputError out of range."""
        try:
            found = air_blast(self.tnt, self.distance, SURFACE if self.wall else FREE_AIR)
        except ValueError as error:
            raise InputError([f"--range {self.distance:g} m: {error}"]) from error
        if found.duration is None:
            raise InputError([f"--range {self.distance:g} m: is within or at the charge; choose a larger distance"])
        return found

    @property
    def radius(self) -> float:
        """[m] of the charge; of a hemisphere that of the sphere with its image in the ground."""
        density = present(present(find("TNT")).detonation).density
        return float((3.0 * self.tnt * (2.0 if self.wall else 1.0) / (4.0 * pi * density)) ** (1.0 / 3.0))

    def text(self) -> str:
        """The scene, as TOML with comments."""
        return self._before_a_wall() if self.wall else self._in_free_air()

    def _in_free_air(self) -> str:
        curves, upper = self.curves, 1.1 * self.distance
        cells = ceil(CELLS_OF_RADIUS * upper / self.radius)
        end = curves.arrival + LASTING * present(curves.duration)
        return f'''\
# {self.tnt:g} kg of TNT in free air, and the blast {self.distance:g} m away, in spherical coordinates.
# {cells} cells: {CELLS_OF_RADIUS} of them across the radius of the charge, {1e3 * self.radius:.3g} mm.
#
# UFC 3-340-02 there: {_of_curves(curves, "incident")}.
# `distfsi report` puts the run beside it. What TNT burns with air afterwards is left out:
# impulses are 20 to 30 % low.

title = "{self.tnt:g} kg of TNT, {self.distance:g} m away"

[domain]
symmetry = "spherical"
lower = 0
upper = "{upper:.4g} m"
cells = {cells}
x = ["axis", "outflow"]

[time]
end = "{1e3 * end:.3g} ms" # the arrival and {LASTING:g} positive phases

[fluid]
reconstruction = "van_leer"

[fluid.phases.air]
material = "air"

[[fluid.regions]]
phase = "air"

[[charges]]
material = "TNT"
mass = "{self.tnt:g} kg"
center = 0

[gauges.target]
kind = "point"
position = "{self.distance:g} m"

[output]
fields_every = "{1e3 * end / 4.0:.2g} ms"
'''

    def _before_a_wall(self) -> str:
        curves, R = self.curves, self.distance
        duration, h = present(curves.duration), R / self.cells
        wide = ceil(max(NARROWEST * R, SPEED * duration) / h)
        end, mapped = curves.arrival + LASTING * duration, air_blast(self.tnt, BESIDE * R, SURFACE).arrival
        radial = ceil(CELLS_OF_RADIUS * R / self.radius)
        middle, share, fine = 0.5 * h, 100.0 * BESIDE, CELLS_OF_RADIUS
        return f'''\
# {self.tnt:g} kg of TNT on the ground, {R:g} m before a wall.
# {self.cells} x {wide} x {wide} cells of {1e3 * h:.3g} mm, and {radial} in spherical coordinates before.
#
# x goes from the charge to the wall, y along the wall, z up; what is left of the charge's middle is its mirror image.
# The ground is hard: the hemisphere with its image in it is a sphere of twice the mass. It is computed in spherical
# coordinates, with {fine} cells across its radius, until the front has gone {share:.0f} % of the way; then in 3D.
#
# UFC 3-340-02 at the foot of the wall: {_of_curves(curves, "reflected")}.
# `distfsi report` puts the run beside it. Of the peak 25 % are missing with 72 cells to the wall, and less the finer
# they are; the impulse is within a few percent with 50 already.

title = "{self.tnt:g} kg of TNT on the ground, {R:g} m before a wall"

[domain]
lower = [0, 0, 0]
upper = ["{R:g} m", "{wide * h:.6g} m", "{wide * h:.6g} m"] # so far that the open ends are felt too late to matter
cells = [{self.cells}, {wide}, {wide}]
x = ["symmetry", "wall"]
y = ["symmetry", "outflow"]
z = ["wall", "outflow"]

[time]
end = "{1e3 * end:.3g} ms" # the arrival and {LASTING:g} positive phases

[fluid]
reconstruction = "van_leer"

[fluid.phases]
tnt = {{ material = "TNT" }}
air = {{ material = "air" }}

[fluid.detonation]
phase = "tnt"
detonators = [{{ kind = "point", position = [0, 0, 0] }}]

[[fluid.regions]]
phase = "air"

# ---- the blast before it meets the wall ----

[[stages]]
time = {{ end = "{1e3 * mapped:.4g} ms" }}
detonators = [{{ kind = "point", position = 0 }}]

[stages.domain]
symmetry = "spherical"
lower = 0
upper = "{R:g} m"
cells = {radial}
x = ["axis", "outflow"]

[[stages.regions]]
phase = "air"

[[stages.regions]]
phase = "tnt"
shape = {{ kind = "ball", center = 0, radius = "{1e3 * self.radius:.6g} mm" }} # {2.0 * self.tnt:g} kg

# ---- what is measured ----

[gauges.foot_of_wall] # in the middle of the cell beside wall and ground
kind = "point"
position = [{R - middle:.6g}, {middle:.6g}, {middle:.6g}]

[gauges.wall] # maps of peak overpressure and impulse, force and its impulse; beside the open ends they are too high
kind = "surface"
side = "x_high"

[output]
fields_every = "{1e3 * (end - mapped) / 4.0:.2g} ms"
'''


def write_scene(blast: Blast, path: Path) -> Path:
    """Write the scene of a blast into a new file; returns its path. Raises InputError, with all that is wrong."""
    faults = [f"{path}: is there already; name another file with --output"] if path.exists() else []
    try:
        text = blast.text()
    except InputError as error:
        raise InputError([*faults, *error.faults]) from error
    if faults:
        raise InputError(faults)
    path.write_text(text, encoding="utf-8")
    return path


def _of_curves(blast: AirBlast, kind: str) -> str:
    peak, impulse = getattr(blast, f"{kind}_pressure"), getattr(blast, f"{kind}_impulse")
    return f"peak {1e-3 * peak:.4g} kPa {kind}, impulse {impulse:.4g} Pa s, arrival {1e3 * blast.arrival:.3g} ms"
