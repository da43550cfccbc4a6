"""What comes in through the ends of kind inflow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from distfsi.fluid.initial import InitialState
from distfsi.scene.description import Fluid, FluidState


class Incoming:
    """The states beyond the ends, of which some have a pressure that changes in time.

    states  (3, 2, variables) conserved states per axis and side
    """

    def __init__(self, given: Fluid, initial: InitialState, variables: int):
        self._given, self._initial = given, initial
        self.states = np.zeros((3, 2, variables))
        self._changing: list[tuple[int, int, FluidState]] = []
        for axis, sides in enumerate(given.inflow):
            for side, state in enumerate(sides):
                if state is None:
                    continue
                self.states[axis, side] = initial.of(state)
                if state.history is not None:
                    self._changing.append((axis, side, state))

    def set_time(self, time: float) -> None:
        """From now on the states are those of a `time` [s]."""
        for axis, side, state in self._changing:
            self.states[axis, side] = self._initial.of(self._behind_wave(state, axis, side, time))

    def _behind_wave(self, state: FluidState, axis: int, side: int, time: float) -> FluidState:
        """The state that a wave of the overpressure of a `time` leaves: a shock, or a fan, running into the domain."""
        from distfsi.scene.waves import Side, behind

        assert state.history is not None
        p, eos = state.pressure + state.history.overpressure(time), self._given.phases[state.phase].eos
        if p == state.pressure:
            return state
        density, push = behind(Side(eos, state.density, state.pressure, 0.0), p)
        velocity = list(state.velocity)
        velocity[axis] += push if side == 0 else -push
        return replace(state, density=density, pressure=p, velocity=tuple(velocity))
