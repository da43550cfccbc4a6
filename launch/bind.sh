#!/usr/bin/env bash
# Gives each rank of a node an equal share of the CPUs that it may use, in order, and runs the command there. For
# launchers that do not bind ranks themselves; CUDA_VISIBLE_DEVICES stays as it is.
#   mpiexec -n 4 launch/bind.sh python -m distfsi run input.toml
# To choose, say to put each rank near its GPU (nvidia-smi topo -m), give one list of CPUs per local rank:
#   CPU_SETS="0-15:32-47:16-31:48-63" mpiexec -n 4 launch/bind.sh python -m distfsi run input.toml
set -euo pipefail

# MPICH and Intel MPI, Open MPI, HPE PALS, Slurm
rank=${MPI_LOCALRANKID:-${OMPI_COMM_WORLD_LOCAL_RANK:-${PALS_LOCAL_RANKID:-${SLURM_LOCALID:-}}}}
size=${MPI_LOCALNRANKS:-${OMPI_COMM_WORLD_LOCAL_SIZE:-${PALS_LOCAL_SIZE:-${SLURM_NTASKS_PER_NODE:-}}}}
if [ -z "$rank" ] || { [ -z "$size" ] && [ -z "${CPU_SETS:-}" ]; }; then
    echo "bind.sh: the launcher does not tell the rank on this node; use the launcher's own binding" >&2
    exit 1
fi

if [ -n "${CPU_SETS:-}" ]; then
    IFS=: read -ra sets <<< "$CPU_SETS"
    if [ "$rank" -ge "${#sets[@]}" ]; then
        echo "bind.sh: CPU_SETS has ${#sets[@]} list(s), none for rank $rank of this node" >&2
        exit 1
    fi
    exec taskset -c "${sets[rank]}" "$@"
fi

cpus=()
IFS=, read -ra ranges <<< "$(taskset -cp $$ | sed 's/.*: //')"
for range in "${ranges[@]}"; do
    mapfile -t -O "${#cpus[@]}" cpus < <(seq "${range%-*}" "${range#*-}")
done
first=$((rank * ${#cpus[@]} / size))
end=$(((rank + 1) * ${#cpus[@]} / size))
if [ "$first" -eq "$end" ]; then # more ranks than CPUs
    end=$((first + 1))
fi
exec taskset -c "$(IFS=,; echo "${cpus[*]:first:end-first}")" "$@"
