"""How many pieces an expanding ring breaks into: size against rate, over many seeds, beside two theories.

Where the failure strain scatters and nothing else holds a crack back, the size falls as 1/rate (Mott 1947); where a
crack takes its energy, as rate^(-2/3) (Kipp & Grady 1985). The ring is in plane strain, two particles thick, and the
spacing falls with the expected size, so that a piece is as finely resolved at any rate.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from distfsi.errors import InputError
from distfsi.laws.law import Failure
from distfsi.laws.solid.eos.linear import LinearEos
from distfsi.laws.solid.failure.johnson_cook import JohnsonCookFailure
from distfsi.laws.solid.scatter import Scatter
from distfsi.laws.solid.strength.perfectly_plastic import PerfectlyPlastic
from distfsi.mesh.communicator import Communicator
from distfsi.narrowing import present
from distfsi.output.charts import Chart, Curve, draw_charts
from distfsi.scene.description import Body, Domain, Output, Performance, Scene, Solid, Time, Tube
from distfsi.simulation import Simulation

DIRECTORY = Path("out/study_fragments")
RADIUS, DENSITY, YIELD = 64e-3, 2700.0, 300e6  # m, kg/m3, Pa; aluminium without hardening
EOS, STRENGTH = LinearEos(68.6e9), PerfectlyPlastic(26.3e9, YIELD)
PLANE_YIELD = 2.0 / math.sqrt(3.0) * YIELD  # of plane strain
RATES = tuple(1e4 * 10.0 ** (0.25 * k) for k in range(5))  # 1/s
DUST = 4  # particles: what is smaller is no piece
ROWS = 2  # particles through the thickness
STILL, SETTLED = 0.05, 1.02  # strain over which the breaks of a ring that is done grow by no more than this factor
LONGEST = 0.4  # strain, beyond that of failure, by which all rings are done
SEEDS = 20


@dataclass(frozen=True)
class Law:
    """What breaks the ring: failure strain and its Weibull modulus, energy of a crack [J/m2]; q: theory's exponent;
    and how many particles a piece of the expected size is long."""

    name: str
    strain: float
    modulus: float
    energy: float
    q: float
    particles: float

    def size(self, rate: float) -> float:
        """Mean length [m] of a piece by theory: 1.5 of Mott's lengths, or Grady's."""
        if self.energy > 0.0:
            return (24.0 * self.energy / (DENSITY * rate**2)) ** (1.0 / 3.0)
        return 1.5 * math.sqrt(2.0 * PLANE_YIELD * self.strain / (DENSITY * self.modulus)) / rate

    def failure(self, thickness: float, seed: int) -> Failure:
        """As scattered over a length of 1 mm of the ring, whatever its thickness [m]."""
        scatter = Scatter(self.modulus, math.sqrt(1e-3 * thickness), seed)
        return JohnsonCookFailure(self.strain, 0.0, 0.0, 0.0, 0.0, 1.0, None, self.energy, scatter)


SCATTER = Law("scatter of the failure strain", 0.2, 15.0, 0.0, 1.0, 12.0)
SOFTENING = Law("softening by the crack energy", 0.05, 15.0, 8e3, 2.0 / 3.0, 30.0)


def ring(rate: float, thickness: float, rows: int, failure: Failure | None) -> Simulation:
    """A quarter of a ring that expands at a rate [1/s]; its symmetry planes stand for the rest."""
    shape = Tube((0.0, 0.0), RADIUS - 0.5 * thickness, RADIUS + 0.5 * thickness)
    body = Body(
        "ring",
        shape,
        thickness / rows,
        DENSITY,
        (0.0, 0.0),
        EOS,
        STRENGTH,
        None,
        failure,
        radial_velocity=rate * RADIUS,
    )
    size = 4.0 * RADIUS
    scene = Scene(
        "ring",
        Domain((0.0, 0.0), (size, size), (8, 8), (("symmetry", "outflow"),) * 2),
        Time(1.0, 0.5, None),
        None,
        Solid((body,), 1.3, 0.5, 1.0),
        Output("", 0.0, 1),
        Performance((8, 8), (8, 8)),
    )
    return Simulation.of(scene, Communicator(), 1)


def expand(simulation: Simulation, rate: float, strain: float) -> None:
    """By a strain that the initial rate gives."""
    solid, time = present(simulation.solid), 0.0
    while time < strain / rate:
        solid.prepare()
        dt = solid.time_step()[0]
        solid.advance(dt)
        solid.migrate()
        time += dt


def breaks(law: Law, rate: float, seed: int, finer: int = 1) -> int:
    """In a quarter of the ring, which is ROWS particles thick, or `finer` times as many, once there are no more."""
    thickness = ROWS * law.size(rate) / law.particles
    simulation = ring(rate, thickness, ROWS * finer, law.failure(thickness, seed))
    before, now, strain = 0, 0, 0.0
    while (now == 0 or now > SETTLED * before) and strain < law.strain + LONGEST:
        expand(simulation, rate, STILL)
        strain += STILL
        before, now = now, int((present(present(simulation.solid).pieces())["particles"] >= DUST * finer**2).sum()) - 1
    return now


@dataclass(frozen=True)
class Sizes:
    """Mean length [m] of the pieces at the moment of the mean break, by rate [1/s], and its standard error."""

    law: Law
    finer: int
    rates: np.ndarray
    counts: np.ndarray  # (rates, seeds) breaks of a quarter

    @property
    def mean(self) -> np.ndarray:
        """2 pi R over the number of pieces of a whole ring."""
        return 0.5 * math.pi * RADIUS / self.counts.mean(axis=1)

    @property
    def error(self) -> np.ndarray:
        """Standard error of the mean; breaks are whole numbers, so that their deviation is at least half a break."""
        counts = self.counts
        deviation = np.maximum(counts.std(axis=1, ddof=1), 0.5)
        return self.mean * deviation / math.sqrt(counts.shape[1]) / counts.mean(axis=1)

    @property
    def exponent(self) -> tuple[float, float]:
        """q of size ~ rate^-q by weighted least squares, and its standard error."""
        x, y, weight = np.log(self.rates), np.log(self.mean), (self.mean / self.error) ** 2
        x0 = (weight * x).sum() / weight.sum()
        spread = (weight * (x - x0) ** 2).sum()
        return -float((weight * (x - x0) * y).sum() / spread), float(1.0 / math.sqrt(spread))


def sizes(law: Law, rates: Sequence[float], seeds: int, finer: int = 1) -> Sizes:
    """Break rings of all rates with all seeds."""
    counts = [[breaks(law, rate, seed, finer) for seed in range(1, seeds + 1)] for rate in rates]
    return Sizes(law, finer, np.array(rates), np.array(counts))


def whole_without_failure() -> tuple[int, float]:
    """Pieces of a ring that cannot fail at a strain of 100 %, and the relative spread of its plastic strain."""
    simulation = ring(1e4, RADIUS / 32.0, ROWS, None)
    expand(simulation, 1e4, 1.0)
    solid = present(simulation.solid)
    strain = solid.columns["plastic_strain"]
    return len(present(solid.pieces())["piece"]), float(strain.std() / strain.mean())


def table(found: Sizes) -> str:
    """A table of sizes."""
    lines = [f"{found.law.name}, {ROWS * found.finer} particles thick"]
    if len(found.rates) > 1:
        q, error = found.exponent
        lines[0] += f": q = {q:.2f} ± {error:.2f} (theory {found.law.q:.2f})"
    for rate, mean, spread, counts in zip(found.rates, found.mean, found.error, found.counts, strict=True):
        lines.append(
            f"  {rate:9.3g} /s  {1e3 * mean:6.2f} ± {1e3 * spread:.2f} mm  theory {1e3 * found.law.size(rate):6.2f} mm"
            f"  {4.0 * counts.mean():6.1f} pieces of a ring"
        )
    return "\n".join(lines)


def quick(communicator: Communicator, overrides: Sequence[str]) -> None:
    """Two seeds at the two lowest rates, one spacing."""
    _study(communicator, overrides, RATES[:2], 2, RATES[:0])


def main(communicator: Communicator, overrides: Sequence[str]) -> None:
    """All rates and seeds, softening with half the spacing at one rate; leave a CSV file and a chart in DIRECTORY."""
    _study(communicator, overrides, RATES, SEEDS, RATES[2:3])


def _study(
    communicator: Communicator,
    overrides: Sequence[str],
    rates: Sequence[float],
    seeds: int,
    fine_rates: Sequence[float],
) -> None:
    if communicator.size > 1 or overrides:
        raise InputError(["study fragments: runs on one rank and takes no overrides"])
    DIRECTORY.mkdir(parents=True, exist_ok=True)
    with threadpool_limits(1):
        pieces, spread = whole_without_failure()
        print(f"without failure: {pieces} piece at a strain of 100 %, plastic strain equal within {100 * spread:.2g} %")
        found = []
        for law, some, finer in ((SCATTER, rates, 1), (SOFTENING, rates, 1), (SOFTENING, fine_rates, 2)):
            if some:
                found.append(sizes(law, some, seeds, finer))
                draw(found)
                write(found)
                print(table(found[-1]), flush=True)
    print(f"\ntable and chart in {DIRECTORY}", flush=True)


def draw(found: Sequence[Sizes]) -> None:
    """Sizes and theory over the rate, logarithms of both."""
    curves = []
    for each in found:
        name = f"{each.law.name}, {ROWS * each.finer} particles thick"
        curves.append(Curve(np.log10(each.rates), np.log10(1e3 * each.mean), name, "o" if each.finer == 1 else "x"))
        if each.finer == 1:
            theory = np.array([each.law.size(rate) for rate in each.rates])
            curves.append(Curve(np.log10(each.rates), np.log10(1e3 * theory), f"theory, q = {each.law.q:.2f}", "-"))
    chart = Chart("Pieces of an expanding ring", "log10 of the rate [1/s]", "log10 of the mean length [mm]", curves)
    draw_charts(DIRECTORY / "sizes.png", [chart], 1)


def write(found: Sequence[Sizes]) -> None:
    """The number of breaks of each run as CSV."""
    with (DIRECTORY / "fragments.csv").open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["law", "particles thick", "rate [1/s]", "seed", "breaks of a quarter"])
        for each in found:
            for rate, counts in zip(each.rates, each.counts, strict=True):
                rows = enumerate(counts, 1)
                table.writerows([each.law.name, ROWS * each.finer, f"{rate:.4g}", seed, n] for seed, n in rows)
