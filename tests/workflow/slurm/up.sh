#!/usr/bin/env bash
# Start a Slurm of two nodes on this machine, without systemd: up.sh FOLDER
# Needs root and Debian's slurm-wlm and munge. Stop it with down.sh FOLDER.
set -euo pipefail
base=$(realpath -m "${1:?usage: up.sh FOLDER}") # slurmd resolves a relative -f path elsewhere and then hangs
host=$(hostname -s)
memory=$(awk '/MemTotal/ {print int($2 / 1024 / 2)}' /proc/meminfo) # MB per node

mkdir -p "$base"/{state,log,run} "$base"/spool/n{1,2}
chmod 755 "$base" "$base"/*

# munge: signs the daemons' messages; any key will do on one machine
mkdir -p /run/munge /var/log/munge /var/lib/munge /etc/munge
[ -s /etc/munge/munge.key ] || head -c 1024 /dev/urandom >/etc/munge/munge.key
chown -R munge:munge /run/munge /var/log/munge /var/lib/munge /etc/munge
chmod 700 /etc/munge
chmod 600 /etc/munge/munge.key
chmod 755 /run/munge
if ! munge -n >/dev/null 2>&1; then
  runuser -u munge -- /usr/sbin/munged --force --pid-file=/run/munge/munged.pid
  touch "$base/run/own-munged"
fi
for _ in $(seq 50); do munge -n 2>/dev/null | unmunge >/dev/null 2>&1 && break || sleep 0.1; done

cat >"$base/slurm.conf" <<CONF
ClusterName=cccd
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
CryptoType=crypto/munge
SlurmctldPort=16817
StateSaveLocation=$base/state
SlurmdSpoolDir=$base/spool/%n
SlurmctldPidFile=$base/run/slurmctld.pid
SlurmdPidFile=$base/run/slurmd-%n.pid
SlurmctldLogFile=$base/log/slurmctld.log
SlurmdLogFile=$base/log/slurmd-%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
DefMemPerCPU=500
SchedulerParameters=sched_interval=2,bf_interval=2,batch_sched_delay=0,sched_min_interval=100000
# no cgroups in containers: memory is sampled, and a step over its request is killed
JobAcctGatherType=jobacct_gather/linux
JobAcctGatherFrequency=1
JobAcctGatherParams=OverMemoryKill
AccountingStorageType=accounting_storage/none
# squeue must still know finished jobs, for there is no accounting to ask
MinJobAge=3600
SlurmdTimeout=15
KillWait=2
MessageTimeout=10
ReturnToService=2
JobRequeue=0
SlurmdParameters=config_overrides
NodeName=n1 NodeHostname=$host NodeAddr=127.0.0.1 Port=17001 CPUs=2 RealMemory=$memory State=UNKNOWN
NodeName=n2 NodeHostname=$host NodeAddr=127.0.0.1 Port=17002 CPUs=2 RealMemory=$memory State=UNKNOWN
PartitionName=main Nodes=n[1-2] Default=YES MaxTime=INFINITE State=UP
CONF
# the Slurm plugin strips SLURM_CONF from its jobs' environment, so the usual place must serve
mkdir -p /etc/slurm
[ -e /etc/slurm/slurm.conf ] && [ ! -L /etc/slurm/slurm.conf ] && { echo "this machine has a Slurm" >&2; exit 1; }
ln -sfn "$base/slurm.conf" /etc/slurm/slurm.conf

slurmctld -f "$base/slurm.conf" -c
for node in n1 n2; do slurmd -f "$base/slurm.conf" -N "$node"; done
for _ in $(seq 100); do
  [ "$(sinfo -h -N -o %t 2>/dev/null | sort | uniq -c | xargs)" = "2 idle" ] && exit 0
  sleep 0.1
done
sinfo -N -l >&2
echo "Slurm did not come up; see $base/log" >&2
exit 1
