#!/usr/bin/env bash
# Makes a virtual environment with distfsi in it and runs two ranks as a self-test. Run it from the repository root:
#   launch/setup.sh [FOLDER]         with an MPI of its own (mpich from PyPI)
#   MPI=site launch/setup.sh [FOLDER]   with the MPI of the machine; load its module first
set -euo pipefail

folder=${1:-.venv}
case ${MPI:-own} in
    own) package=".[mpi]" ;;
    site) package="." ;;
    *) echo "MPI must be own or site, not $MPI" >&2; exit 2 ;;
esac

python3 -m venv "$folder"
# shellcheck source=/dev/null
source "$folder/bin/activate"
python -m pip install --editable "$package"

sizes=$(mpiexec -n 2 python -c "from mpi4py import MPI; print(MPI.COMM_WORLD.size)" | tr '\n' ' ')
if [ "$sizes" != "2 2 " ]; then
    echo "mpiexec and mpi4py do not belong together: two ranks saw these sizes: $sizes" >&2
    echo "mpiexec is $(command -v mpiexec); mpi4py uses:" >&2
    python -c "from mpi4py import MPI; print(MPI.Get_library_version())" >&2
    exit 1
fi
echo "Ready: source $folder/bin/activate"
