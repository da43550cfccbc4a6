"""Run under mpiexec by test_restart.py: the command line, but the last rank gets a signal before step number STOP.

python mpi_restart.py STOP [words of the command line]
"""

import os
import signal
import sys

from distfsi.commands.line import main
from distfsi.simulation import Simulation


def signal_before(stop: int) -> None:
    """From now on this rank, if it is the last, sends itself SIGUSR1 when `stop` - 1 steps are done."""
    step = Simulation.step

    def signalled_step(simulation: Simulation) -> None:
        communicator = simulation.communicator
        if simulation.steps == stop - 1 and communicator.rank == communicator.size - 1:
            os.kill(os.getpid(), signal.SIGUSR1)
        step(simulation)

    Simulation.step = signalled_step


if __name__ == "__main__":
    signal_before(int(sys.argv[1]))
    main(sys.argv[2:])
