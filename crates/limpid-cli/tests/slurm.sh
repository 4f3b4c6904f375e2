#!/usr/bin/env bash
# Tests docs/farm.sbatch with a real Slurm on this machine alone: a job array draws a sequence, one of
# its tasks is killed and another is requeued while running, and every frame must be drawn once,
# bit-identical to a single run.
#
# Without slurmctld and munged it installs them (Debian, Ubuntu, as root), or prints a message and passes;
# with LIMPID_REQUIRE_SLURM=1 it then fails. Its daemons communicate over the loopback with their own key,
# keep all files in a temporary folder, and are stopped at the end.
#
#     crates/limpid-cli/tests/slurm.sh [target/release/limpid]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../../.."
export PATH="$PATH:/usr/sbin:/sbin"

limpid=$(realpath "${1:-target/release/limpid}")
job=$PWD/docs/farm.sbatch
frames=24
tasks=4

lacks_slurm() {
    local program
    for program in munged slurmctld slurmd srun sbatch scontrol squeue sacctmgr; do
        command -v "$program" >/dev/null || return 0
    done
    return 1
}
if lacks_slurm && [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    # Prevents the packages from starting their own daemons.
    policy=/usr/sbin/policy-rc.d
    [ -e $policy ] || { printf '#!/bin/sh\nexit 101\n' >$policy && chmod +x $policy && made=$policy; }
    scripts/apt.sh slurm-wlm munge || true
    [ -z "${made:-}" ] || rm -f "$made"
fi
if lacks_slurm; then
    echo "no Slurm here: apt-get install slurm-wlm munge" >&2
    [ "${LIMPID_REQUIRE_SLURM:-}" != 1 ]
    exit
fi

work=$(mktemp -d)
chmod 755 "$work"
daemons=()
finish() {
    local code=$? pid
    trap - EXIT
    if [ $code -ne 0 ]; then
        echo "--- logs of the daemons and the tasks" >&2
        tail -n 15 "$work"/*.log "$work"/project/*.log >&2 || true
    fi
    # Each job has a slurmstepd, which outlives slurmd.
    [ ! -e "$work/slurm.conf" ] || [ $code -eq 0 ] || end_jobs
    for pid in "${daemons[@]}"; do kill "$pid" 2>/dev/null || true; done
    for pid in "${daemons[@]}"; do wait "$pid" 2>/dev/null || true; done
    rm -rf "$work"
    exit $code
}
trap finish EXIT
trap 'exit 130' INT TERM

free_port() {
    local port
    for port in $(shuf -i 20000-32000 -n 100); do
        (exec 3<>"/dev/tcp/127.0.0.1/$port") 2>/dev/null || { echo "$port" && return; }
    done
    return 1
}

# Waits until a command succeeds, at most two minutes.
await() {
    local what=$1
    shift
    for _ in $(seq 600); do
        ! "$@" >/dev/null 2>&1 || return 0
        sleep 0.2
    done
    echo "$what: not within two minutes" >&2
    return 1
}

end_jobs() {
    scancel --user="$(id -un)" 2>/dev/null || return 0
    await "no jobs" no_jobs || true
}
no_jobs() { [ -z "$(squeue --noheader)" ]; }

# ------------------------------------------------------------------------------- the cluster
host=$(hostname -s)
mkdir "$work/state" "$work/spool"
head -c 1024 /dev/urandom >"$work/munge.key"
chmod 600 "$work/munge.key"
cat >"$work/slurm.conf" <<CONF
ClusterName=limpid
SlurmctldHost=$host(127.0.0.1)
SlurmUser=$(id -un)
SlurmdUser=$(id -un)
AuthType=auth/munge
CredType=cred/munge
# A requeued task waits until its credentials have expired.
AuthInfo=socket=$work/munge.socket,cred_expire=5
SlurmctldPort=$(free_port)
SlurmdPort=$(free_port)
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=sched_interval=2,batch_sched_delay=0
SlurmdParameters=config_overrides
ReturnToService=2
KillWait=10
NodeName=$host NodeAddr=127.0.0.1 CPUs=4 State=UNKNOWN
PartitionName=farm Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF=$work/slurm.conf

munged --foreground --force --key-file="$work/munge.key" --socket="$work/munge.socket" \
    --pid-file="$work/munged.pid" --seed-file="$work/munged.seed" --log-file="$work/munged.log" \
    2>"$work/munged.out.log" &
daemons+=($!)
await "munged" test -S "$work/munge.socket"
slurmctld -D -c >"$work/slurmctld.log" 2>&1 &
daemons+=($!)
await "slurmctld" scontrol ping
slurmd -D -c >"$work/slurmd.log" 2>&1 &
daemons+=($!)
idle() { [ "$(sinfo --noheader --format=%T)" = idle ]; }
await "slurmd" idle

# ------------------------------------------------------------------------------ the sequence
project=$work/project
mkdir "$project" "$project/water"
cd "$project"
for frame in $(seq $frames); do
    # A block of liquid that moves from frame to frame.
    awk -v offset="$(((frame * 37) % 100))" 'BEGIN {
        for (i = 0; i < 480; i++)
            print (i % 12) * 0.05 + offset / 1000, int(i / 12) % 5 * 0.05, int(i / 60) * 0.05
    }' >"water/block_$frame.xyz"
done
options=(--size 320x240 --samples 16)
"$limpid" render water -o single/ --frames all "${options[@]}"

# ----------------------------------------------------------------------------------- the job
manifest=$project/manifest.jsonl
id=$(LIMPID=$limpid sbatch --parsable --array=1-$tasks --cpus-per-task=1 "$job" \
    water array/ "${options[@]}" --manifest "$manifest")
echo "job array $id: $tasks tasks, $frames frames"

drawn() { find array -name '*.png' 2>/dev/null | wc -l; }

# One process is killed and its task requeued, as after a node's failure. The process is stopped and
# continued in short slices, so that the kill interrupts it on any machine.
victim() { pgrep -f -- "^$limpid render .*--shard 2/$tasks" | head -n 1; }
running() { [ -n "$(victim)" ]; }
await "task 2" running
pid=$(victim)
until [ -e array/frame_0002.png ]; do
    kill -CONT "$pid"
    sleep 0.1
    kill -STOP "$pid"
done
kill -KILL "$pid"
echo "task 2 killed with $(drawn) frames drawn"
failed() { [ "$(squeue --noheader --array --format=%T --jobs="${id}_2")" != RUNNING ]; }
await "the end of task 2" failed
scontrol requeue "${id}_2"
# Another task is requeued while it runs: it receives SIGTERM, and starts again.
state=$(squeue --noheader --array --format=%T --jobs="${id}_3" 2>/dev/null || true)
echo "task 3 (${state:-done}) requeued with $(drawn) frames drawn"
scontrol requeue "${id}_3"
await "the end of all tasks" no_jobs

# -------------------------------------------------------------------------------- the pictures
ls single >expected
ls -A array >found
diff expected found
for picture in single/*.png; do
    cmp "$picture" "array/${picture#single/}"
done
# The manifest: each frame is drawn once, and existing ones are skipped.
frames_with() { grep -o "\"frame\":[0-9]*,\"file\":\"[^\"]*\",\"status\":\"$1\"" "$manifest" | cut -d, -f1 | sort; }
twice=$(frames_with done | uniq -d)
kept=$(frames_with skipped | wc -l)
[ -z "$twice" ] || { echo "drawn twice: $twice" >&2 && exit 1; }
[ "$kept" -gt 0 ] || { echo "the restarted tasks found nothing to skip: they were not interrupted" >&2 && exit 1; }
echo "all $frames frames are there once, the same as in a single run; restarted tasks kept $kept of them"
