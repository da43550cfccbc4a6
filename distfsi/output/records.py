"""All that a run writes into its output directory, each thing when it is due."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from distfsi.errors import InputError
from distfsi.narrowing import present
from distfsi.output.fields import FieldWriter, field_faults
from distfsi.output.history import History, history_faults
from distfsi.output.interfaces import Budget, Origin, Performance, Simulation
from distfsi.output.restart import RestartWriter, Snapshot
from distfsi.output.schedule import Every
from distfsi.output.storage import Storage, on_root

BALANCE_COLUMNS = ("step", "time [s]", "busiest rank over mean", "blocks change hands")


class Records:
    """Field files, history and restart files of a run; at a restart those up to `origin` are continued.

    What a run that died has written after the restart file is removed first, so that in the end the files are those of
    a run that was never interrupted. Where the time goes and how evenly several ranks share the work is in files of
    their own, since no result depends on it: `performance.csv`, `balance.csv`.

    restart  path of the last restart file, or None
    """

    def __init__(self, simulation: Simulation, budget: Budget, performance: Performance, storage: Storage):
        """`budget` gives the history its columns and rows, `performance` those of the file of its name. Nothing is
        touched before `open`."""
        self._simulation, self._storage = simulation, storage
        self._directory = Path(simulation.scene.output.directory)
        self._budget, self._timing = budget, performance
        self._fields_due, self._frame = Every(simulation.scene.output.fields_every), 0
        self._written_at = -1.0
        self.restart: Path | None = None
        self._tables = {"history.csv": budget.columns, "performance.csv": performance.columns}
        if simulation.communicator.size > 1:
            self._tables["balance.csv"] = list(BALANCE_COLUMNS)

    def check(self, origin: Origin) -> None:
        """Collective. Raise InputError on all ranks when what is in the directory cannot be continued."""

        def find() -> list[str]:
            found = field_faults(self._directory, origin.time)
            for name, columns in self._tables.items():
                found += history_faults(self._directory / name, columns, origin.step)
            return found

        faults = on_root(self._simulation.communicator, self._directory, find)
        if faults:
            raise InputError(faults)

    def open(self, run: str, origin: Origin | None) -> None:
        """Collective. Begin the files, or go on with those up to `origin`; `run`: which run it is.

        Raises OutputError on all ranks.
        """
        scene, blocks, communicator = self._simulation.scene, self._simulation.blocks, self._simulation.communicator
        time, step = (origin.time, origin.step) if origin else (None, None)
        # Without its restart files first: they need the other files.
        self._restarts = RestartWriter(self._directory, scene, blocks, communicator, self._storage, run, step)
        self._fields = FieldWriter(self._directory, blocks, communicator, self._storage, time)
        tables = {
            name: History(self._directory / name, columns, communicator, step) for name, columns in self._tables.items()
        }
        self._history, self._performance = tables["history.csv"], tables["performance.csv"]
        self._balance = tables.get("balance.csv")
        self.restart = origin.path if origin else None

    def write(self, always: bool = False) -> None:
        """Write what is due at the simulation's time, or fields and history `always`."""
        simulation = self._simulation
        with simulation.timers("output"):
            if self._fields_due.due(simulation.time) or always:
                self.write_fields()
            if simulation.steps % simulation.scene.output.history_every == 0 or always:
                self._history.append(self._budget.row(simulation))
                self._performance.extend([self._timing.row(simulation.steps, simulation.time)])

    def write_fields(self) -> None:
        """Write the fields, if they are not those written last."""
        simulation = self._simulation
        if simulation.time > self._written_at:
            self._fields.write(self._frame, simulation.time, *simulation.outputs())
            self._frame, self._written_at = self._frame + 1, simulation.time

    def write_restart(self, kept: Mapping[str, Any]) -> Path:
        """Write a restart file with the snapshots of all that is kept; its path."""
        with self._simulation.timers("output"):
            snapshots = {name: part.snapshot() for name, part in kept.items()}
            self.restart = self._restarts.write(self._simulation.steps, snapshots)
        return self.restart

    def write_balance(self, imbalance: float, changes_hands: bool) -> None:
        """Note how evenly the ranks have computed, and whether blocks change hands now."""
        simulation = self._simulation
        present(self._balance).extend([[simulation.steps, simulation.time, imbalance, int(changes_hands)]])

    def left_behind(self) -> str:
        """What an invalid state has left, in words."""
        last = f"the last restart file is {self.restart}" if self.restart else "there is no restart file"
        return f"the state is in the last field files in {self._directory}; {last}"

    def snapshot(self) -> Snapshot:
        """What a restart needs."""
        return {"values": {"frame": np.array(self._frame), "fields_due": np.array(self._fields_due.next)}}

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot."""
        self._frame, self._fields_due.next = int(snapshot["values"]["frame"]), float(snapshot["values"]["fields_due"])
