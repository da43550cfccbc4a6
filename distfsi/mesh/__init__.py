"""Ranks, blocks and what they exchange. Importing it does not start MPI; the first Communicator does."""

import mpi4py

mpi4py.rc.initialize = False
mpi4py.rc.finalize = True
