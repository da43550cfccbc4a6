#!/usr/bin/env bash
# Builds h5py on the parallel HDF5 of the machine, which `[output] hdf5 = "mpio"` needs, and tests it on two ranks.
# The virtual environment must use the machine's MPI: make it with `MPI=site launch/setup.sh`.
#   launch/install-parallel-hdf5.sh [FOLDER]
# Debian, Ubuntu:  apt-get install gcc python3-dev libopenmpi-dev openmpi-bin libhdf5-openmpi-dev
# Cluster:         load the modules of Python, MPI and parallel HDF5, and set HDF5_DIR (and CC) unless they do.
set -euo pipefail

folder=${1:-.venv}
compiler=${CC:-mpicc}

fail() {
    echo "$1" >&2
    exit 1
}

[ -x "$folder/bin/python" ] || fail "$folder holds no virtual environment; make it with: MPI=site launch/setup.sh $folder"
[ ! -e "$folder/lib/libmpi.so.12" ] || fail "$folder holds an MPI of its own, which the machine's HDF5 cannot share; \
make another with: MPI=site launch/setup.sh FOLDER"
command -v "$compiler" > /dev/null || fail "no $compiler: install or load an MPI with its compiler, or set CC"

if [ -z "${HDF5_DIR:-${HDF5_ROOT:-}}" ]; then
    case $("$compiler" -show) in
        *openmpi*) flavour=openmpi ;;
        *) flavour=mpich ;;
    esac
    HDF5_DIR=/usr/lib/$(gcc -dumpmachine)/hdf5/$flavour # where Debian has it
fi
HDF5_DIR=${HDF5_DIR:-${HDF5_ROOT:-}}
[ -d "$HDF5_DIR" ] || fail "no parallel HDF5 in $HDF5_DIR: install or load one, or set HDF5_DIR"

# shellcheck source=/dev/null
source "$folder/bin/activate"
# No cache: pip would take any h5py that it once built, parallel or not. No optimizing: h5py hands on to HDF5, and the
# compilation takes a third of the time.
CC=$compiler HDF5_MPI=ON HDF5_DIR=$HDF5_DIR CFLAGS=${CFLAGS:--O0 -g0 -w} \
    python -m pip install --no-cache-dir --no-deps --force-reinstall --no-binary=h5py "h5py>=3.16"

# Open MPI starts no ranks as root and none beyond the cores unless told.
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
export OMPI_MCA_rmaps_base_oversubscribe=1 PRTE_MCA_rmaps_default_mapping_policy=:oversubscribe
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cat > "$scratch/test.py" <<'PYTHON'
import sys

import h5py
from mpi4py import MPI

ranks = MPI.COMM_WORLD
assert h5py.get_config().mpi, "this h5py was built without MPI"
assert ranks.size == 2, f"mpiexec and mpi4py do not belong together: {ranks.size} rank(s) instead of 2"
with h5py.File(sys.argv[1], "w", driver="mpio", comm=ranks) as file:
    data = file.create_dataset("ranks", (ranks.size,), "i8")
    with data.collective:
        data[ranks.rank] = ranks.rank
with h5py.File(sys.argv[1], "r", driver="mpio", comm=ranks) as file:
    assert list(file["ranks"]) == [0, 1]
PYTHON
timeout 60 mpiexec -n 2 python "$scratch/test.py" "$scratch/test.h5" || fail "two ranks could not write a file together"
echo "Ready: h5py $(python -c 'import h5py; print(h5py.version.version, "on HDF5", h5py.version.hdf5_version)') writes in parallel"
