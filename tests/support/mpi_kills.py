"""Run under mpiexec by test_kills.py: the command line, with a restart file every ten steps; a rank is killed in step
number LAST, or a moment after its end. 0: none is.

python mpi_kills.py LAST [words of the command line]
"""

import os
import random
import signal
import sys
import threading

from distfsi.commands.line import main
from distfsi.output.requests import Request, Requests
from distfsi.simulation import Simulation

STEPS_BETWEEN_FILES = 10
LATEST = 0.01  # seconds after the start of the last step


def kill() -> None:
    """End this process as a power cut would."""
    os.kill(os.getpid(), signal.SIGKILL)


def kill_in(last: int) -> None:
    """From now on restart files are due every ten steps, and a rank dies in step number `last`."""
    step = Simulation.step

    def counted_step(simulation: Simulation) -> None:
        due = (simulation.steps + 1) % STEPS_BETWEEN_FILES == 0
        Requests.strongest = lambda _: Request.RESTART_FILE if due else Request.NOTHING
        communicator = simulation.communicator
        victim = communicator.broadcast(random.randrange(communicator.size)) if simulation.steps == last - 1 else None
        if victim == communicator.rank:
            threading.Timer(random.uniform(0.0, LATEST), kill).start()
        step(simulation)
        if last and simulation.steps == last + STEPS_BETWEEN_FILES:
            kill()

    Simulation.step = counted_step


if __name__ == "__main__":
    kill_in(int(sys.argv[1]))
    main(sys.argv[2:])
