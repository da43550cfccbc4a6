"""Fluids that several test modules use."""

from types import SimpleNamespace

from distfsi.coordinates import coordinates_of
from distfsi.fluid.model import FluidModel, fluid_model
from distfsi.laws.fluid.ideal_gas import IdealGas
from distfsi.laws.fluid.jwl import Jwl
from distfsi.laws.fluid.stiffened_gas import StiffenedGas
from distfsi.laws.law import FluidEos
from distfsi.scene.description import Fluid, Phase

AIR = IdealGas(1.4)
HELIUM = IdealGas(1.667)
WATER = StiffenedGas(4.4, 6e8)
TNT = Jwl(rho0=1630.0, A=3.712e11, B=3.231e9, R1=4.15, R2=0.95, omega=0.3)

MATERIALS = {"air": AIR, "helium": HELIUM, "water": WATER, "tnt": TNT}
PAIRS = tuple((a, b) for a in ("air", "water", "tnt") for b in ("helium", "water", "tnt"))
TRACE = 1e-6


def model_of(
    *names: str | FluidEos,
    dimensions: int = 1,
    sources=(),
    limiter: str = "minmod",
    riemann: str = "hllc",
    symmetry: str = "planar",
    **method,
) -> FluidModel:
    """The model of a fluid made of `MATERIALS`, or of other laws."""
    phases = tuple(Phase(str(name), name if isinstance(name, FluidEos) else MATERIALS[name]) for name in names)
    fluid = Fluid(phases, (), limiter, TRACE, (), "float64", riemann, **method)
    domain = SimpleNamespace(dimensions=dimensions, coordinates=coordinates_of(symmetry))
    return fluid_model(SimpleNamespace(fluid=fluid, solid=None, domain=domain, sources=sources))
