#!/usr/bin/env bash
# A sweep on a SLURM cluster: scheduler and driver on the first node, a worker for every CPU.
#   sbatch experiments/cluster/slurm.sh my_sweep.toml
# Started again, also after a time limit, it goes on where it stopped.
#SBATCH --job-name=asmjax-sweep
#SBATCH --ntasks=64
#SBATCH --cpus-per-task=1
#SBATCH --mem-per-cpu=4G
#SBATCH --time=08:00:00
set -euo pipefail
config=${1:?usage: sbatch slurm.sh CONFIG}
# SLURM runs a copy of this file, so paths start where sbatch was called: the project's folder.
source .venv/bin/activate

# Folders that all nodes see. Of a sweep only the driver writes results.
job=$PWD/out/slurm-$SLURM_JOB_ID
experiments/cluster/certificates.sh "$job/tls"
source "$job/tls/settings.sh"

# Without a dashboard dask serves pages all the same, to everybody unless it is told where.
quiet=(--no-dashboard --dashboard-address 127.0.0.1:0)
dask scheduler --protocol tls --port 0 --scheduler-file "$job/scheduler.json" "${quiet[@]}" &
scheduler=$!
trap 'kill "$scheduler" 2>/dev/null || true; rm -rf "$job"' EXIT
until [ -s "$job/scheduler.json" ]; do
  kill -0 "$scheduler" 2>/dev/null || { echo "the scheduler ended" >&2; exit 1; }
  sleep 1
done

# A worker is a small process; the one that it starts for trials is pinned to a CPU of its task.
srun --overlap dask worker --scheduler-file "$job/scheduler.json" --protocol tls \
  --nworkers 1 --nthreads 1 --memory-limit 0 --death-timeout 60 \
  --local-directory "${TMPDIR:-/tmp}" "${quiet[@]}" &

# What a task has of memory is its trial's, but for its worker. A time limit may end the sweep at any
# point: what is kept is kept.
asmjax sweep "$config" --scheduler-file "$job/scheduler.json" \
  ${SLURM_MEM_PER_CPU:+--max-memory $((SLURM_MEM_PER_CPU - 300))}
