"""What a scene will cost, told before the run."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from distfsi.scene.description import (
    Ball,
    Body,
    Box,
    Domain,
    Fluid,
    FluidState,
    HalfSpace,
    LinearEos,
    NoStrength,
    Scene,
)
from distfsi.scene.packing import pack
from distfsi.scene.thermodynamics import sound_speed_squared

GHOSTS = 2  # layers on each side of a block
BUFFERS = 3  # copies of the fluid's state
PARTICLE_BYTES = 600
PARTICLE_OUTPUT_BYTES = 48
BEST_SPACING = 0.5  # of a fluid cell
FEWEST_PARTICLES = 4  # through a body's thickness


def report(scene: Scene) -> str:
    """Cells, particles, memory, output and steps of `scene`, and warnings about what looks wrong, as text."""
    domain = scene.domain
    size = " x ".join(f"{b - a:.6g}" for a, b in zip(domain.lower, domain.upper, strict=True))
    cells = " x ".join(map(str, domain.cells))
    lines = [scene.title, f"  domain     {size} m, {cells} cells of {_metres(domain.spacing)}"]
    particles = [_particles(body, domain) for body in (scene.solid.bodies if scene.solid else ())]
    if scene.fluid:
        lines += _fluid_lines(scene, scene.fluid)
    for body, positions in zip(scene.solid.bodies if scene.solid else (), particles, strict=True):
        lines.append(_body_line(body, positions, domain, scene.fluid is not None))
    count = sum(map(len, particles))
    if count:
        lines.append(f"  particles  {count:,}, about {_bytes(count * PARTICLE_BYTES)} of memory")
    lines += [_output_line(scene, count), _steps_line(scene)]
    return "\n".join(lines + [f"  warning    {warning}" for warning in _warnings(scene)])


def _particles(body: Body, domain: Domain) -> np.ndarray:
    return pack(body, domain.lower, domain.upper)[0]


def _fluid_lines(scene: Scene, fluid: Fluid) -> list[str]:
    dimensions, block = scene.domain.dimensions, scene.performance.block_cells
    blocks = math.prod(math.ceil(n / b) for n, b in zip(scene.domain.cells, block, strict=True))
    variables = dimensions + (2 if len(fluid.phases) == 1 else 4)
    value = 8 if fluid.precision == "float64" else 4
    memory = blocks * math.prod(b + 2 * GHOSTS for b in block) * variables * BUFFERS * value
    names = " and ".join(phase.name for phase in fluid.phases)
    shape = " x ".join(map(str, block))
    return [
        f"  fluid      {names}; {math.prod(scene.domain.cells):,} cells, {blocks} block(s) of {shape}, "
        f"about {_bytes(memory)} of memory"
    ]


def _body_line(body: Body, positions: np.ndarray, domain: Domain, in_fluid: bool) -> str:
    line = f"  body       {body.name}: {len(positions):,} particles {_metres((body.spacing,))} apart"
    thickness = _thickness(body, domain)
    if thickness is None:
        return line
    line += f", {thickness:.4g} m thick: {thickness / body.spacing:.3g} particles"
    return line + (f", {thickness / min(domain.spacing):.3g} cells" if in_fluid else "")


def _thickness(body: Body, domain: Domain) -> float | None:
    """Smallest extent of a body inside the domain [m]; None for a half space, which has none."""
    match body.shape:
        case Box(lower, upper):
            low, high = np.maximum(lower, domain.lower), np.minimum(upper, domain.upper)
            return float(np.min(high - low))
        case Ball(_, radius):
            return 2.0 * radius
        case HalfSpace():
            return None
        case tube:
            return tube.outer_radius - tube.inner_radius


def _output_line(scene: Scene, particles: int) -> str:
    values = scene.domain.dimensions + (0 if scene.fluid is None else 1 + len(scene.fluid.phases))
    each = particles * PARTICLE_OUTPUT_BYTES + (math.prod(scene.domain.cells) * values * 4 if scene.fluid else 0)
    every = scene.output.fields_every
    times = 1 + (math.ceil(scene.time.end / every - 1e-9) if every else 1)
    total = f"{_bytes(times * each)} in all, in {scene.output.directory}"
    return f"  output     {times} field outputs of about {_bytes(each)}, {total}"


def _steps_line(scene: Scene) -> str:
    """Number of steps if waves stay as fast as they are at the start."""
    rates = [_fluid_rate(scene)] if scene.fluid else []
    rates += [_solid_rate(body, scene.domain.dimensions) for body in (scene.solid.bodies if scene.solid else ())]
    steps = math.ceil(scene.time.end * max(rates) / scene.time.cfl)
    if scene.time.maximum_steps is not None:
        steps = min(steps, scene.time.maximum_steps)
    return f"  steps      about {steps:,}, if no wave becomes faster than the fastest at the start"


def _fluid_rate(scene: Scene) -> float:
    """max sum_d (|u_d| + c)/h_d over the initial and inflow states [1/s]."""
    fluid = scene.fluid
    rates = []
    for state in _states(fluid):
        c = math.sqrt(sound_speed_squared(fluid.phases[state.phase].eos, state.density, state.pressure))
        rates.append(sum((abs(u) + c) / h for u, h in zip(state.velocity, scene.domain.spacing, strict=True)))
    return max(rates)


def _states(fluid: Fluid) -> list[FluidState]:
    """All states that the fluid starts from or that come in."""
    return [region.state for region in fluid.regions] + [s for sides in fluid.inflow for s in sides if s]


def _solid_rate(body: Body, dimensions: int) -> float:
    """(c + |v|)/spacing with the longitudinal wave speed c [1/s]."""
    bulk = body.eos.bulk_modulus if isinstance(body.eos, LinearEos) else body.density * body.eos.c0**2
    shear = 0.0 if isinstance(body.strength, NoStrength) else body.strength.shear_modulus
    return (math.sqrt((bulk + 4.0 / 3.0 * shear) / body.density) + math.hypot(*body.velocity)) / body.spacing


def _warnings(scene: Scene) -> Iterator[str]:
    domain, fluid = scene.domain, scene.fluid
    longest, shortest = max(domain.spacing), min(domain.spacing)
    if longest > 1.5 * shortest:
        yield f"cells are {longest / shortest:.3g} times longer than wide"
    if scene.output.fields_every > scene.time.end:
        yield "output.fields_every is longer than the run: only the first and the last fields are written"
    if fluid:
        used = {state.phase for state in _states(fluid)}
        absent = [phase.name for n, phase in enumerate(fluid.phases) if n not in used]
        yield from (f"phase '{name}' is nowhere; the run is cheaper without it" for name in absent)
    for body in scene.solid.bodies if scene.solid else ():
        for warning in _body_warnings(body, domain, fluid is not None):
            yield f"body '{body.name}': {warning}"


def _body_warnings(body: Body, domain: Domain, in_fluid: bool) -> Iterator[str]:
    cell, thickness = min(domain.spacing), _thickness(body, domain)
    if in_fluid and body.spacing > BEST_SPACING * cell * (1.0 + 1e-9):
        yield f"particles are {body.spacing / cell:.3g} cells apart; at most {BEST_SPACING} is better"
    if thickness is not None and thickness < (FEWEST_PARTICLES - 0.5) * body.spacing:
        yield f"fewer than {FEWEST_PARTICLES} particles through its thickness"
    if in_fluid and thickness is not None and thickness < math.sqrt(domain.dimensions) * cell:
        yield f"thinner than sqrt({domain.dimensions}) cells: the fluid sees it thicker than it is"


def _metres(lengths: tuple[float, ...]) -> str:
    distinct = lengths if len({f"{h:.6g}" for h in lengths}) > 1 else lengths[:1]
    return " x ".join(f"{h:.6g}" for h in distinct) + " m"


def _bytes(count: float) -> str:
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000.0:
            return f"{count:.3g} {unit}"
        count /= 1000.0
    return f"{count:.3g} TB"
