"""The conservation budget: masses, momentum and energy of fluid and solid, what has left the domain, and what the
coupling has created, by cause."""

from __future__ import annotations

import numpy as np

from distfsi.coupling.protocol import Coupling
from distfsi.diagnostics.watched import Watched
from distfsi.fluid.fluid import Fluid
from distfsi.gauges import per_extent
from distfsi.mesh.blocks import Snapshot
from distfsi.narrowing import present
from distfsi.solid.solid import Solid

SLOW = 1e-3  # of the speed of sound: where all is slower, errors of the momentum are measured by this speed


class Budget:
    """Of a run: fluid + solid + left through boundaries - given to the fluid by the body force - created by the
    coupling is constant, but for the conservation error.

    `columns` are the names of the history's columns; `row(simulation)` gives their values.
    """

    def __init__(self, fluid: Fluid | None, solid: Solid | None, coupling: Coupling | None):
        self.fluid, self.solid, self.coupling = fluid, solid, coupling
        self.dimensions = (fluid.blocks if fluid else present(solid).blocks).grid.dimensions
        self.phases = fluid.model.phases if fluid else 0
        grid = (fluid.blocks if fluid else present(solid).blocks).grid
        spanned = grid.dimensions + grid.coordinates.turns
        self._kg, impulse, self._joule = (per_extent(unit, spanned) for unit in ("kg", "N s", "J"))
        self._momentum = [f"momentum_{axis} [{impulse}]" for axis in grid.coordinates.axes[: self.dimensions]]
        masses = [f"mass_{k + 1} [{self._kg}]" for k in range(self.phases)]
        self.conserved = [*masses, *self._momentum, f"energy [{self._joule}]"]
        self._names = {n: name.split(" [")[0] for n, name in enumerate(self.conserved)}
        if fluid and fluid.blocks.grid.coordinates.radial:  # momentum along r is not conserved: all around it is zero
            del self._names[self.phases]
        self._start = np.full(len(self.conserved), np.nan)
        self._scale = np.zeros(len(self.conserved))
        self.columns = ["step", "time [s]", "time step [s]", "limited by"]
        if fluid:
            self.columns += ["limited faces", "rejected steps", *(f"fluid {name}" for name in self.conserved)]
            self.columns += [f"held by {share} [{self._joule}]" for share in fluid.model.carried]
        self.columns += [f"left {name}" for name in self.conserved]
        if fluid and fluid.force:
            self.columns += [f"body force {name}" for name in self.conserved]
        if solid:
            self.columns += [
                f"solid mass [{self._kg}]",
                *(f"solid {name}" for name in self._momentum),
                f"solid kinetic energy [{self._joule}]",
                f"solid internal energy [{self._joule}]",
                *(["solid pieces"] if "piece" in solid.columns else []),
                *solid.reported(),
            ]
        if coupling:
            self.columns += ["sub-steps", "sub-steps limited by"]
            self.columns += [f"trapped {name}" for name in self.conserved[: self.phases]]
            self._created = [cause for cause in coupling.causes if cause not in coupling.at_ends]
            self.columns += [f"coupling {cause} {name}" for cause in self._created for name in self.conserved]
        self.columns += [f"drift {name}" for name in self._names.values()]

    def row(self, simulation: Watched) -> dict[str, float | int | str]:
        """Values of all columns; collective. Drifts are relative to the largest sum of absolute values so far; of the
        momentum at least to that of a slow motion."""
        masses = self.phases
        values: dict[str, float | int | str] = {
            "step": simulation.steps,
            "time [s]": simulation.time,
            "time step [s]": simulation.dt,
            "limited by": simulation.name_limit(),
        }
        balance, size = np.zeros(len(self.conserved)), np.zeros(len(self.conserved))

        def add(label: str, amounts: np.ndarray, sign: float = 1.0, magnitude: np.ndarray | None = None) -> None:
            nonlocal balance, size
            values.update({f"{label} {name}": amount for name, amount in zip(self.conserved, amounts, strict=True)})
            balance, size = balance + sign * amounts, size + (np.abs(amounts) if magnitude is None else magnitude)

        left = np.zeros(len(self.conserved))
        if self.fluid:
            totals, magnitude = self.fluid.totals(self.coupling.volume if self.coupling else None)
            magnitude[masses:-1] += SLOW * np.sqrt(2.0 * magnitude[:masses].sum() * magnitude[-1])
            add("fluid", totals, magnitude=magnitude)
            values |= {"limited faces": self.fluid.limited_faces(), "rejected steps": self.fluid.rejected_steps}
            left = left + self.fluid.left_domain()
            if self.fluid.force:
                add("body force", self.fluid.force.totals(), -1.0)
            if self.fluid.model.carried:
                energies = zip(self.fluid.model.carried, self.fluid.held_energies(), strict=True)
                values |= {f"held by {share} [{self._joule}]": float(energy) for share, energy in energies}
        if self.solid:
            held = self.solid.totals()
            amounts = np.array([*[0.0] * masses, *held["momentum"], held["kinetic"] + held["internal"]])
            magnitude = np.abs(amounts)  # of the momentum: at most this by Cauchy and Schwarz
            magnitude[masses:-1] = np.sqrt(2.0 * held["mass"] * held["kinetic"]) + SLOW * held["acoustic"]
            balance, size = balance + amounts, size + magnitude
            values[f"solid mass [{self._kg}]"] = float(held["mass"])
            values |= {f"solid {name}": m for name, m in zip(self._momentum, held["momentum"], strict=True)}
            values[f"solid kinetic energy [{self._joule}]"] = float(held["kinetic"])
            values[f"solid internal energy [{self._joule}]"] = float(held["internal"])
            if (pieces := self.solid.pieces()) is not None:
                values["solid pieces"] = len(pieces["piece"])
            values |= self.solid.reported()
            left = left - np.array([*[0.0] * masses, *self.solid.boundary_impulse(), self.solid.gravity_work()])
        made = self.coupling.budget_by_cause() if self.coupling else {}
        left = left - sum(made[cause] for cause in (self.coupling.at_ends if self.coupling else ()))
        add("left", left)
        if self.coupling:
            step = simulation.last_step
            limit = step.name_particle(simulation.communicator) if step.sub_steps > 1 else ""
            values |= {"sub-steps": step.sub_steps, "sub-steps limited by": limit}
            values |= {f"trapped {n}": m for n, m in zip(self.conserved, self.coupling.trapped(), strict=False)}
            for cause in self._created:
                add(f"coupling {cause}", made[cause], -1.0)
        if np.isnan(self._start).all():
            self._start = balance
        size[masses:-1] = size[masses:-1].max()  # a component that stays near zero is measured by the others
        self._scale = np.maximum(self._scale, size)
        drift = (balance - self._start) / np.where(self._scale > 0.0, self._scale, 1.0)
        return values | {f"drift {name}": drift[n] for n, name in self._names.items()}

    def snapshot(self) -> Snapshot:
        """What a restart needs."""
        return {"values": {"start": self._start, "scale": self._scale}}

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot."""
        self._start, self._scale = snapshot["values"]["start"], snapshot["values"]["scale"]

    def summary(self, simulation: Watched) -> str:
        """Collective. One sentence on the conservation error, and on what the coupling has created."""
        row = self.row(simulation)
        worst = max(abs(float(row[f"drift {name}"])) for name in self._names.values())
        text = f"Conservation error {worst:.1e}."
        if self.coupling:
            energy = sum(float(row[f"coupling {cause} {self.conserved[-1]}"]) for cause in self._created)
            share = 100 * energy / self._scale[-1]
            text += f" The coupling created {energy:.4g} {self._joule} ({share:.2g} % of the energy)."
        return text
