#!/usr/bin/env bash
# Stop the Slurm that up.sh started: down.sh FOLDER
set -uo pipefail
base=$(realpath -m "${1:?usage: down.sh FOLDER}")
timeout 10 scancel --user "$(id -un)" 2>/dev/null
sleep 1
for name in slurmd-n1 slurmd-n2 slurmctld; do
  [ -s "$base/run/$name.pid" ] || continue
  pid=$(cat "$base/run/$name.pid")
  kill "$pid" 2>/dev/null && timeout 10 tail --pid="$pid" -f /dev/null
done
[ -e "$base/run/own-munged" ] && kill "$(cat /run/munge/munged.pid)" 2>/dev/null
[ "$(readlink /etc/slurm/slurm.conf)" = "$base/slurm.conf" ] && rm /etc/slurm/slurm.conf
exit 0
