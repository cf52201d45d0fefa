#!/usr/bin/env bash
# A campaign as a job array of eight shards, on a Slurm of this machine alone: one shard is killed and requeued, and the
# merged table must be that of one process, byte for byte.
# Usage: ARMCAL=target/release/armcal tests/cluster/slurm.sh [FOLDER]   (as root; needs Debian's slurm-wlm and munge)
set -euo pipefail
repo=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
ARMCAL=$(realpath "${ARMCAL:-$repo/target/release/armcal}")
work=$(realpath -m "${1:-$(mktemp -d)}")
mkdir -p "$work"/{state,spool,out} /run/munge
export ARMCAL SLURM_CONF=$work/slurm.conf
say() { printf '%s  %s\n' "$(date +%T)" "$*" | tee -a "$work/log.txt"; }

cat >"$SLURM_CONF" <<CONF
ClusterName=loopback
SlurmctldHost=$(hostname -s)(127.0.0.1)
SlurmctldPort=16817
SlurmdPort=16818
SlurmUser=root
AuthType=auth/munge
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
MinJobAge=3600
SchedulerParameters=sched_interval=2
NodeName=$(hostname -s) NodeAddr=127.0.0.1 CPUs=$(nproc) RealMemory=$(free -m | awk "/Mem:/ {print \$2}") State=UNKNOWN
PartitionName=all Nodes=$(hostname -s) Default=YES MaxTime=INFINITE State=UP
CONF

stop() {
    for daemon in slurmd slurmctld; do
        [ -f "$work/$daemon.pid" ] && kill "$(cat "$work/$daemon.pid")" 2>/dev/null || true
    done
    [ -z "${munge_started:-}" ] || munged --stop >/dev/null 2>&1 || true
}
trap stop EXIT
[ -f /etc/munge/munge.key ] || mungekey --create
chown -R munge /etc/munge /run/munge /var/lib/munge /var/log/munge
if ! munge -n >/dev/null 2>&1; then
    runuser -u munge -- munged
    munge_started=yes
fi
slurmctld -L "$work/slurmctld.log"
slurmd -L "$work/slurmd.log"
for _ in $(seq 60); do [ "$(sinfo -h -o %T 2>/dev/null)" = idle ] && break || sleep 1; done
say "slurm $(sinfo --version | cut -d' ' -f2), node $(sinfo -h -o '%n %T')"

export ROUTINE=$repo/routines/regression.toml SEEDS=${SEEDS:-1..8} OUT=$work/out
cd "$repo"
array=$(sbatch --parsable --array=1-8 --cpus-per-task=1 --output="$work/shard-%a.log" docs/guide/clusters/shard.sbatch)
merge=$(sbatch --parsable --dependency="afterok:$array" --output="$work/merge.log" docs/guide/clusters/merge.sbatch)
say "array $array of 8 shards, then $merge"

# Killed as by a node that fails: no signal that armcal could answer, and the job requeued.
victim="$OUT/shard-3.csv"
for _ in $(seq 600); do [ -f "$victim.partial" ] && break || sleep 0.2; done
pkill -KILL -f -- "--out $victim" || { say "shard 3 was over before it could be killed"; exit 1; }
say "shard 3 killed with -9"
scontrol requeue "${array}_3" 2>/dev/null || true
for _ in $(seq 100); do
    state=$(squeue -h -j "${array}_3" -t all -o %T)
    case "$state" in FAILED | CANCELLED) scontrol requeue "${array}_3" && break ;; PENDING | COMPLETED) break ;; esac
    sleep 0.2
done
say "shard 3 requeued: restarts $(scontrol show job "${array}_3" | grep -o 'Restarts=[0-9]*')"

while squeue -h -j "$array,$merge" -t PENDING,RUNNING,COMPLETING | grep -q .; do sleep 1; done
squeue -t all -j "$array,$merge" -o '%i %j %T' | tee -a "$work/log.txt"
say "in one process"
"$ARMCAL" campaign "$ROUTINE" --seeds "$SEEDS" --out "$work/one.csv" >/dev/null 2>&1 || [ $? -eq 4 ]
for end in .csv .parquet -summary.json -summary.md -report.html; do
    cmp "$OUT/all$end" "$work/one$end"
done
say "all five files are the same, byte for byte"
