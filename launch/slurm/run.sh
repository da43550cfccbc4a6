#!/bin/bash
# What the Slurm jobs of this folder have in common: start the ranks, and put the job back into the queue when the run
# stopped early. distfsi exits with 75 then, and has written a restart file; --restart auto continues from it. A task of
# a job array runs its variant of a sweep.
set -euo pipefail
# shellcheck source=/dev/null
source "${VENV:-.venv}/bin/activate"
export OMP_NUM_THREADS=1 # distfsi starts its own threads
export SRUN_CPUS_PER_TASK=$SLURM_CPUS_PER_TASK

# Not --kill-on-bad-exit: the first rank to exit with 75 would have the others killed, and the code would be theirs.
if [ -n "${SLURM_ARRAY_TASK_ID:-}" ]; then
    words=(sweep "$@" --only "$SLURM_ARRAY_TASK_ID")
else
    words=(run "$@" --restart auto)
fi
code=0
srun --cpu-bind=cores --kill-on-bad-exit=0 --wait=30 python -m distfsi "${words[@]}" || code=$?
if [ "$code" -eq 75 ]; then
    scontrol requeue "$SLURM_JOB_ID"
fi
exit "$code"
