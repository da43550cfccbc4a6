"""Coupled scenes for the tests, and the run that every rank makes; started by test_coupling.py.

mpi_coupling.py    runs the cases with 1 and 2 threads and other blocks; rank 0 prints what must not depend on the ranks
"""

import hashlib
import math
from dataclasses import replace
from itertools import product

import numpy as np

from distfsi.laws.fluid.ideal_gas import IdealGas
from distfsi.laws.fluid.stiffened_gas import StiffenedGas
from distfsi.laws.solid.eos.linear import LinearEos
from distfsi.laws.solid.strength.elastic import Elastic
from distfsi.mesh.communicator import Communicator, install_abort_on_exception
from distfsi.scene import description as d
from distfsi.scene.bars import Bars, Bond
from distfsi.scene.motion import Free, Motion
from distfsi.simulation import Simulation

SCHEMES = ("immersed_boundary", "cut_cells")
AIR = (d.Phase("air", IdealGas(1.4)),)
AIR_AND_WATER = (*AIR, d.Phase("water", StiffenedGas(4.4, 60.0)))


def gas(density, pressure, velocity, phase=0):
    return d.FluidState(phase, density, pressure, tuple(map(float, velocity)))


def body(shape, spacing, density, velocity, fixed=None, stiffness=50.0):
    """An elastic body; sound speeds near those of the gas keep the steps long."""
    return d.Body(
        "body",
        shape,
        spacing,
        density,
        tuple(map(float, velocity)),
        LinearEos(stiffness),
        Elastic(0.4 * stiffness),
        fixed,
    )


def rigid(shape, spacing, density, velocity, name="body", **free):
    """A free rigid body; as stiff where it meets others as an elastic one."""
    return replace(body(shape, spacing, density, velocity), name=name, motion=Free(**free))


def shock(mach):
    """Density, pressure and speed of the gas (gamma 1.4) behind a shock into rho = p = 1, its speed, and the pressure
    behind its reflection from a wall."""
    g, c = 1.4, math.sqrt(1.4)
    pressure = 1.0 + 2.0 * g / (g + 1.0) * (mach**2 - 1.0)
    density = (g + 1.0) * mach**2 / ((g - 1.0) * mach**2 + 2.0)
    velocity = 2.0 * c / (g + 1.0) * (mach - 1.0 / mach)
    reflected = pressure * ((3.0 * g - 1.0) * pressure - (g - 1.0)) / ((g - 1.0) * pressure + g + 1.0)
    return density, pressure, velocity, mach * c, reflected


class Coupled:
    """Fluid, solid and coupling of a scene, and the step that joins them."""

    def __init__(
        self,
        bodies,
        regions,
        lower,
        upper,
        cells,
        kinds=None,
        block=8,
        threads=1,
        phases=AIR,
        precision="float64",
        scheme="immersed_boundary",
        cfl=0.4,
        runge_kutta="rk3",
        form="updated_lagrangian",
        drop_below=None,
    ):
        D = len(lower)
        kinds = kinds or (("wall", "wall"),) * D
        regions = tuple(d.Region(state, shape) for state, shape in regions)
        scene = d.Scene(
            title="test",
            domain=d.Domain(lower, upper, cells, kinds),
            time=d.Time(1e9, cfl, None, scheme=runge_kutta),
            fluid=d.Fluid(phases, regions, "minmod", 1e-6, ((None, None),) * D, precision),
            solid=d.Solid(tuple(bodies), 1.3, 1.0, 2.0, form=form),
            output=d.Output("", 0.0, 1),
            performance=d.Performance((block,) * D, (block,) * D),
            coupling=d.Coupling(scheme, drop_below=drop_below),
        )
        self.communicator = Communicator()
        self.simulation = Simulation.of(scene, self.communicator, threads)
        self.blocks, self.fluid = self.simulation.blocks, self.simulation.fluid
        self.solid, self.coupling = self.simulation.solid, self.simulation.coupling

    def step(self):
        """One stable step; returns its length and the impulse (D,) on all particles."""
        self.simulation.step()
        return self.simulation.dt, self.blocks.sum(self.solid.given.sum(axis=1))

    def balance(self):
        """Masses, momentum and energy that nothing may change."""
        fluid, solid, coupling = self.fluid, self.solid, self.coupling
        t = solid.totals()
        particles = [0.0] * fluid.model.phases + [
            *t["momentum"] - solid.boundary_impulse(),
            t["kinetic"] + t["internal"] - solid.gravity_work(),
        ]
        created = sum(coupling.budget_by_cause().values())
        return fluid.totals(coupling.volume)[0] + fluid.left_domain() + np.array(particles) - created

    def grid_of(self, field):
        """(variables, z, y, x): the cells of all ranks of a field (local blocks, variables, Z, Y, X), on every rank."""
        cells = self.blocks.grid.cells[::-1]
        whole, ghosts = np.zeros((field.shape[1], *cells)), self.blocks.grid.ghosts[::-1]
        for b in range(self.blocks.local_count):
            origin, extent = self.blocks.origin[b][::-1], self.blocks.extent[b][::-1]
            inner = tuple(slice(g, g + n) for g, n in zip(ghosts, extent, strict=True))
            whole[(slice(None), *(slice(o, o + n) for o, n in zip(origin, extent, strict=True)))] = field[
                (b, slice(None), *inner)
            ]
        return self.communicator.concatenate(whole[None]).sum(axis=0)

    @property
    def covered(self):
        """(z, y, x) of the whole grid."""
        return self.grid_of(self.coupling.covered[:, None])[0] > 0

    def particles(self):
        """All particles of all ranks by id: positions, velocities, energies, densities."""
        c = self.solid.columns
        rows = np.column_stack([c["position"], c["velocity"], c["energy"], c["density"]])
        rows, ids = self.communicator.concatenate(rows), self.communicator.concatenate(c["id"])
        return rows[np.argsort(ids)]

    def digest(self):
        """Hash of all that must not depend on ranks, threads and blocks."""
        rest = self.covered
        state = np.where(rest, 0.0, self.grid_of(self.fluid.state) * self.grid_of(self.coupling.volume[:, None]))
        return hashlib.sha256(state.tobytes() + rest.tobytes() + self.particles().tobytes()).hexdigest()


# ---- cases ----------------------------------------------------------------------------------------------------------


def flying_discs(threads, block, scheme):
    """Two discs, one of them clamped, hit by a shock near a symmetry plane and an outflow."""
    free = body(d.Ball((0.3, 0.05), 0.15), 0.02, 3.0, (0.8, 0.1))
    clamped = body(d.Ball((0.75, 0.4), 0.1), 0.02, 3.0, (0.0, 0.0), d.HalfSpace((0.75, 0.4), (1.0, 0.0)))
    regions = [(gas(1.0, 1.0, (0, 0)), None), (gas(2.0, 4.0, (1.0, 0)), d.Box((0.0, 0.0), (0.1, 1.0)))]
    kinds = (("wall", "outflow"), ("symmetry", "wall"))
    return Coupled([free, clamped], regions, (0.0, 0.0), (1.0, 0.6), (25, 15), kinds, block, threads, scheme=scheme), 80


def sinking_plate(threads, block, scheme):
    """A plate with both phases around it in three dimensions, a quarter of it; lighter than both with cut cells."""
    density = 3.0 if scheme == "immersed_boundary" else 0.1
    plate = body(d.Box((0.3, 0.0, 0.0), (0.5, 0.25, 0.3)), 0.05, density, (1.5, 0, 0))
    regions = [(gas(1.0, 1.0, (0, 0, 0)), None), (gas(5.0, 4.0, (0, 0, 0), 1), d.Box((0.6, 0.0, 0.0), (1.0, 1.0, 1.0)))]
    kinds = (("wall", "outflow"), ("symmetry", "wall"), ("symmetry", "outflow"))
    lower, upper, cells = (0.0, 0.0, 0.0), (1.2, 0.6, 0.6), (12, 6, 6)
    return Coupled([plate], regions, lower, upper, cells, kinds, block, threads, AIR_AND_WATER, scheme=scheme), 25


def speck(place, side, density, velocity):
    """A lone particle."""
    upper = tuple(x + side for x in place)
    return body(d.Box(tuple(place), upper), side, density, velocity, stiffness=1.0)


def stretched_plate(threads, block, scheme):
    """A plate of bonds, pulled to three times its length across all blocks; gas on one side, and four lone particles,
    two of them in one cell."""
    plate = body(d.Box((0.35, -0.1), (0.5, 1.1)), 0.05, 100.0, (0, 0), stiffness=1.0)
    places = ((0.21, 0.52), (0.26, 0.56), (0.9, 0.38), (0.72, 0.61))
    dust = [speck(place, 0.02, 30.0, (3.0 * (place[0] - 0.5), -1.0)) for place in places]
    regions = [(gas(1.0, 1e-2, (0, 0)), None), (gas(1.0, 1.0, (0, 0)), d.Box((0.0, 0.0), (0.4, 1.0)))]
    case = Coupled(
        [plate, *dust],
        regions,
        (0.0, 0.0),
        (1.0, 1.0),
        (10, 10),
        None,
        block,
        threads,
        scheme=scheme,
        form="total_lagrangian",
    )
    c = case.solid.columns
    c["velocity"][c["body"] == 0, 1] = 10.0 * (c["position"][c["body"] == 0, 1] - 0.48)
    return case, 25


def among_others(threads, block, scheme):
    """A soft ball with a bar in it between a free block, an obstacle that moves towards them and a wall, in a blast."""
    bars = Bars(
        0.01, 0.1, 0.05, (0,), "high", 20.0, 500.0, 5.0, 0.0, 0.1, Bond(1.0, (0.01, 0.02, 0.05), 0.4, 0.4), 0.025
    )
    ball = replace(body(d.Ball((0.3, 0.5), 0.1), 0.025, 3.0, (0.5, 0.0)), name="ball", bars=bars)
    block_of = rigid(d.Box((0.45, 0.4), (0.6, 0.6)), 0.025, 2.0, (-0.5, 0.1), "block", spin=(1.0,))
    told = Motion((0.0, 10.0), ((0.0, 0.0), (-3.0, 0.0)), (0.0, 1.0), (0.75, 0.4))
    ram = replace(body(d.Box((0.65, 0.3), (0.85, 0.5)), 0.025, 3.0, (0, 0)), name="ram", motion=told)
    regions = [(gas(1.0, 1.0, (0, 0)), None), (gas(2.0, 5.0, (0, 0)), d.Box((0.0, 0.0), (0.15, 1.0)))]
    bodies, box = [ball, block_of, ram], ((0.0,) * 2, (1.0,) * 2, (20, 20))
    given = {"scheme": scheme, "form": "total_lagrangian"}
    return Coupled(bodies, regions, *box, None, block, threads, **given), 60


def main():
    communicator = Communicator()
    install_abort_on_exception(communicator)
    cases = ((flying_discs, (4, 7)), (sinking_plate, (3, 4)), (stretched_plate, (3, 4)))
    runs = [*product(SCHEMES, cases), ("cut_cells", (among_others, (6, 10)))]
    for scheme, (case, blocks) in runs:
        digests = []
        for threads, block in ((1, blocks[0]), (2, blocks[1])):
            coupled, steps = case(threads, block, scheme)
            before, scale = coupled.balance(), 0.0
            sub_steps = 0
            for _ in range(steps):
                coupled.step()
                sub_steps += coupled.solid.sub_steps
                scale = max(scale, np.abs(coupled.fluid.totals()[0]).max())
            created = coupled.coupling.budget_by_cause()
            assert np.abs(coupled.balance() - before).max() < 1e-12 * scale
            made = {cause: np.abs(amounts[-1]) for cause, amounts in created.items()}
            if case is stretched_plate:  # it reaches through the ends of the domain, and pushes against them
                assert all(np.isfinite(amount) for amount in made.values())
            elif scheme == "immersed_boundary":
                assert all(made[cause] > 0.0 for cause in ("wall", "covered", "fresh"))
            else:
                assert made["wall"] < 1e-12 * scale
            assert case is not flying_discs or (sub_steps > steps) == (scheme == "cut_cells")
            digests.append(coupled.digest())
        assert digests[0] == digests[1], case.__name__
        if communicator.rank == 0:
            print(
                scheme, case.__name__, digests[0], [amounts.tobytes().hex() for amounts in created.values()], flush=True
            )


if __name__ == "__main__":
    main()
