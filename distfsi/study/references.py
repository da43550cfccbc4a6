"""Published and independently computed results to compare with, in SI units."""

from __future__ import annotations

from typing import NamedTuple

from distfsi.laws.fluid.ideal_gas import IdealGas
from distfsi.laws.fluid.jwl import Jwl
from distfsi.laws.fluid.stiffened_gas import StiffenedGas
from distfsi.laws.solid.eos.mie_grueneisen import MieGrueneisen
from distfsi.study.exact import ExactEos, PureState

AIR = IdealGas(gamma=1.4)
WATER = StiffenedGas(gamma=4.4, p_inf=6.0e8)
TNT = Jwl(rho0=1630.0, A=3.712e11, B=3.21e9, R1=4.15, R2=0.95, omega=0.3)
"""Products of TNT (paper, Table 7)."""

TNT_ENERGY = 4.29e6
"""Detonation energy of TNT [J/kg] (paper, Table 7)."""

TNT_PRESSURE = 8.375948642e9
"""Pressure of TNT products at the density of the charge, the energy all released, at rest [Pa]; from the two above."""


class TubeInstant(NamedTuple):
    """The expanding steel tube at one time [s]: radii [m], velocity [m/s], energy [J/m of full ring], pressure [Pa]."""

    time: float
    inner_radius: float
    expansion: float
    thickness: float
    mean_velocity: float
    kinetic_energy: float
    gas_pressure: float


STEEL_TUBE = (
    TubeInstant(2e-6, 30.52e-3, 1.017, 3.90e-3, 427.0, 0.594e6, 5072e6),
    TubeInstant(5e-6, 32.56e-3, 1.085, 3.72e-3, 844.0, 2.25e6, 2964e6),
    TubeInstant(10e-6, 38.09e-3, 1.270, 3.20e-3, 1216.0, 4.66e6, 1315e6),
    TubeInstant(15e-6, 44.97e-3, 1.499, 2.76e-3, 1425.0, 6.40e6, 692e6),
    TubeInstant(20e-6, 52.65e-3, 1.755, 2.38e-3, 1560.0, 7.66e6, 414e6),
    TubeInstant(40e-6, 87.02e-3, 2.901, 1.46e-3, 1782.0, 10.0e6, 70.5e6),
    TubeInstant(60e-6, 123.7e-3, 4.124, 1.03e-3, 1858.0, 10.9e6, 24.8e6),
)
"""The tube of the paper's Sec. 5.5 (charge radius 30 mm, wall 4 mm) without strength and without fracture, all energy
of the charge released at once: an independent 1-D Lagrangian computation (Godunov, exact interfaces, 240 + 80 cells,
air outside; a vacuum outside changes it by less than 0.8 %). `expansion` is inner radius over 30 mm; `gas_pressure` is
at the wall."""


class TubeStrength(NamedTuple):
    """The same tube with strength at one time [s]: inner radius [m], mean velocity [m/s], and the share of the kinetic
    energy that strength has taken."""

    time: float
    inner_radius: float
    mean_velocity: float
    loss: float


STEEL_TUBE_PLASTIC = (
    TubeStrength(5e-6, 32.55e-3, 831.0, 0.0323),
    TubeStrength(10e-6, 37.95e-3, 1194.0, 0.0378),
    TubeStrength(20e-6, 52.19e-3, 1519.0, 0.0530),
    TubeStrength(40e-6, 85.50e-3, 1717.0, 0.0773),
    TubeStrength(60e-6, 120.76e-3, 1779.0, 0.0965),
)
"""With a yield stress of 1 GPa: another 1-D Lagrangian computation (staggered grid of von Neumann and Richtmyer, 240
+ 80 cells; half of them change the loss by 0.07 %). Without strength it gives the table above within 0.3 % up to 40 us
and 0.8 % at 60 us. The work of plastic flow, Y ln(r/r0) per volume, is 6 to 7 % of the kinetic energy at 20 us, but the
gas makes up for a part of it: it pushes harder on a wall that recedes more slowly."""

STEEL_TUBE_JOHNSON_COOK = (
    TubeStrength(5e-6, 32.54e-3, 829.0, 0.0366),
    TubeStrength(10e-6, 37.93e-3, 1189.0, 0.0455),
    TubeStrength(20e-6, 52.09e-3, 1509.0, 0.0657),
    TubeStrength(40e-6, 85.12e-3, 1701.0, 0.0951),
    TubeStrength(60e-6, 120.01e-3, 1759.0, 0.1165),
)
"""With the Johnson-Cook strength of inputs/steel_tube.toml, by the same computation."""


class TubeFragments(NamedTuple):
    """Mean width and thickness [m] of the tube's fragments, and what is told of their speed."""

    source: str
    width: float
    thickness: float
    speed: str


TUBE_FRAGMENTS = (
    TubeFragments("experiment", 7.86e-3, 3.3e-3, "not told; 1.4 to 1.8 km/s by Gurney and by the computations above"),
    TubeFragments("the paper", 7.23e-3, 3.7e-3, "up to 1000 m/s"),
)
"""The paper's Table 9: Tang, Gu, Li, Explosion and Shock Waves 23 (2003) 529, and its own computation."""

GURNEY_VELOCITY = (1695.0, 1786.0)
"""Range of Gurney's final velocity of the same tube for sqrt(2E) = 2316 to 2440 m/s [m/s]."""


class ShockTube(NamedTuple):
    """Two fluids at rest and what the exact solution gives between the waves; `shock` is the right wave's speed."""

    left: PureState
    right: PureState
    eos_left: ExactEos
    eos_right: ExactEos
    p_star: float
    u_star: float
    shock: float


WATER_AIR = ShockTube(
    PureState(1000.0, 1e9), PureState(50.0, 1e5), WATER, AIR, p_star=1.419047721e7, u_star=482.6104121, shock=583.9276
)
"""The water/air tube of Saurel and Abgrall, SIAM J. Sci. Comput. 21 (1999) 1115; values by an independent solver."""

WATER_AIR_INTERFACE, WATER_AIR_TIME = 0.7, 241e-6
"""Where its membrane is on the unit interval [m] and when WATER_AIR_ERRORS were taken [s]."""

WATER_AIR_STIFF = ShockTube(
    PureState(1000.0, 1e9),
    PureState(1.2, 1e5),
    StiffenedGas(gamma=6.12, p_inf=3.43e8),
    AIR,
    p_star=533085.07,
    u_star=486.7530,
    shock=741.4525,
)
"""Water with another fit against air at its usual density; values by an independent solver."""

AIR_WATER = ShockTube(
    PureState(10.0, 1e9), PureState(1000.0, 1e5), AIR, WATER, p_star=951700876.4, u_star=416.9134, shock=2282.490
)
"""Compressed air against water; values by an independent solver."""


class TubeErrors(NamedTuple):
    """Relative L1 errors of another code's density, velocity and pressure on WATER_AIR."""

    code: str
    scheme: str
    cells: int
    density: float
    velocity: float
    pressure: float


WATER_AIR_ERRORS = (
    TubeErrors("ECOGEN 4.0", "MUSCL minmod", 200, 9.65e-3, 1.81e-2, 2.23e-2),
    TubeErrors("ECOGEN 4.0", "MUSCL minmod", 1000, 3.07e-3, 3.05e-3, 4.35e-3),
    TubeErrors("ECOGEN 4.0", "MUSCL van Leer", 1000, 2.24e-3, 2.42e-3, 3.44e-3),
    TubeErrors("MFC", "MUSCL van Leer", 500, 2.6e-3, 3.5e-3, 1.3e-3),
    TubeErrors("MFC", "MUSCL van Leer", 1000, 1.57e-3, 1.8e-3, 0.65e-3),
    TubeErrors("MFC", "WENO5-JS", 500, 16e-3, 63e-3, 6.6e-3),
    TubeErrors("MFC", "WENO5-JS", 1000, 11.6e-3, 30e-3, 3.5e-3),
)
"""Measured by running those codes and comparing with the exact solution; MFC's are over the range of each variable."""


class PeerSpeed(NamedTuple):
    """Speed of another code in two dimensions with two phases: steps of a cell per second of one core's time."""

    code: str
    scheme: str
    cell_steps_per_second: float


PEER_SPEEDS = (
    PeerSpeed("ECOGEN 4.0", "MUSCL", 70e3),
    PeerSpeed("MFC", "MUSCL", 431e3),
    PeerSpeed("MFC", "WENO5-JS", 173e3),
    PeerSpeed("JAX-Fluids 0.2.1", "MUSCL", 131e3),
)
"""Measured on a shock and a bubble of helium in air, float64, on one core of an AMD EPYC of the third generation; the
highest where a code was tried in several ways. ECOGEN makes two stages per step, the others three; JAX-Fluids has five
equations, the others six."""


class FlyerPlate(NamedTuple):
    """Two plates of one material meet at `velocity` [m/s]; behind the shocks: pressure [Pa], shock velocity [m/s]
    against the plate ahead, compression rho/rho0."""

    density: float
    eos: MieGrueneisen
    velocity: float
    pressure: float
    shock_velocity: float
    compression: float


COPPER, COPPER_DENSITY = MieGrueneisen(c0=3940.0, s1=1.489, s2=0.0, s3=0.0, gamma0=2.0, a=0.0), 8930.0
ALUMINIUM, ALUMINIUM_DENSITY = MieGrueneisen(c0=5350.0, s1=1.34, s2=0.0, s3=0.0, gamma0=2.0, a=0.0), 2703.0
STEEL, STEEL_DENSITY = MieGrueneisen(c0=4569.0, s1=1.49, s2=0.0, s3=0.0, gamma0=2.17, a=0.46), 7830.0
"""Shock equations of state of copper, aluminium 6061 and the steel of the paper's Table 5, with densities [kg/m3]."""

FLYER_PLATES = (
    FlyerPlate(COPPER_DENSITY, COPPER, 500.0, 9.627e9, 4312.25, 1.0615),
    FlyerPlate(COPPER_DENSITY, COPPER, 1000.0, 20.916e9, 4684.5, 1.1195),
    FlyerPlate(ALUMINIUM_DENSITY, ALUMINIUM, 800.0, 6.364e9, 5886.0, 1.0729),
    FlyerPlate(STEEL_DENSITY, STEEL, 500.0, 9.673e9, 4941.5, 1.0533),
    FlyerPlate(STEEL_DENSITY, STEEL, 1000.0, 20.80e9, 5314.0, 1.1039),
)
"""Symmetric impact without strength by the jump conditions: u = velocity/2, U = c0 + s1 u, p = rho U u, e = u^2/2."""


class BubbleVelocities(NamedTuple):
    """Velocities [m/s] when a shock of Mach 1.22 in air hits a cylinder of helium 50 mm in diameter.

    Vs incident, VR refracted, VT transmitted shock; Vui, Vdi upstream and downstream interface at first; Vj the jet,
    which is the upstream interface on the axis later on; Vuf the rearmost helium in the end. None: not told.
    """

    source: str
    Vs: float | None
    VR: float | None
    VT: float | None
    Vui: float | None
    Vdi: float | None
    Vj: float | None
    Vuf: float | None


SHOCK_BUBBLE = (
    BubbleVelocities("experiment", 410.0, 900.0, 393.0, 170.0, 145.0, 230.0, 113.0),
    BubbleVelocities("Quirk-Karni", 422.0, 943.0, 377.0, 178.0, 146.0, 227.0, None),
    BubbleVelocities("AMR 5120", 423.2, 953.0, 381.2, None, 141.5, 222.9, None),
    BubbleVelocities("the paper", None, None, None, None, 154.0, 252.0, None),
)
"""Haas and Sturtevant, J. Fluid Mech. 181 (1987) 41, +-10 %; Quirk and Karni, J. Fluid Mech. 318 (1996) 129; a
two-phase computation on 5120 x 1024 cells with the samurai library; in all three the helium holds 28 % of air by mass:
density 0.182 of that of air, gamma 1.645 to 1.648. Last the paper's Table 1: pure helium, 0.138 and 1.67."""


class MeshSpeed(NamedTuple):
    """A row of the paper's Table 2: cell size [mm], nodes, and steps per second on an RTX 4090; and its true number of
    cells: the nodes are those of a mesh one cell thick, 2 (nx + 1)(ny + 1), over 325 x 90 mm."""

    spacing: float
    nodes: int
    steps_per_second: float
    cells: int


SHOCK_BUBBLE_SPEEDS = (
    MeshSpeed(1.0, 59_332, 174.0, 29_250),
    MeshSpeed(0.5, 235_661, 64.6, 117_000),
    MeshSpeed(0.25, 939_322, 14.40, 468_000),
    MeshSpeed(0.125, 3_750_642, 4.30, 1_872_000),
)
"""The steps per second may be pictures per second: the times that the same table gives for 100 steps are 70 times as
long."""


class RadialProfile(NamedTuple):
    """A cylindrical explosion of gas in water at one time [s]: radius of the charge, of the shock and of the gas [m],
    and points (radius [m], pressure [Pa], radial velocity [m/s], density [kg/m3])."""

    charge: float
    time: float
    shock: float
    interface: float
    points: tuple[tuple[float, float, float, float], ...]


UNDEX_2D = (
    RadialProfile(0.5, 0.05e-3, 0.6796, 0.5574, ()),
    RadialProfile(
        0.5,
        0.1e-3,
        0.849,
        0.6168,
        (
            (0.1, 7810.0e6, 0.0, 1630.0),
            (0.2, 7810.0e6, 0.0, 1630.0),
            (0.3, 5601.0e6, 572.4, 1285.7),
            (0.4, 3284.0e6, 1367.5, 878.0),
            (0.5, 3290.9e6, 1265.0, 879.2),
            (0.6, 3280.9e6, 1204.0, 877.2),
            (0.7, 3235.2e6, 1083.7, 1380.3),
            (0.8, 3148.5e6, 977.7, 1389.7),
            (0.9, 0.1e6, 0.0, 1000.0),
        ),
    ),
    RadialProfile(0.4, 0.05e-3, 0.5782, 0.4577, ()),
    RadialProfile(
        0.4,
        0.1e-3,
        0.745,
        0.5174,
        (
            (0.1, 7810.0e6, 0.0, 1630.0),
            (0.2, 5448.0e6, 603.6, 1260.3),
            (0.3, 3038.7e6, 1435.8, 830.5),
            (0.4, 3093.3e6, 1287.1, 841.2),
            (0.5, 3112.1e6, 1208.2, 844.8),
            (0.6, 3081.8e6, 1068.3, 1371.9),
            (0.7, 2994.4e6, 949.1, 1383.1),
        ),
    ),
)
"""The underwater explosion of the paper's Sec. 5.2 (gas 1.4, 1630 kg/m3, 7.81 GPa; water 4.4, 0.6 GPa): an independent
radial Lagrangian computation (Godunov, exact interfaces, 2000 cells per metre; half of them change positions by 0.1 %,
the highest pressure by 1 %)."""


class CentreAt(NamedTuple):
    """Where a body's centre is at a time, in the units of its input."""

    time: float
    x: float
    y: float


LIFTOFF = (CentreAt(0.1641, 0.3602, 0.0830), CentreAt(0.30085, 0.6400, 0.1459))
"""The cylinder of inputs/liftoff.toml by an independent ghost-cell method of first order in the force, h = 0.0025; the
mass is 1.2 % less."""
