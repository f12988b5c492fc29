"""A Slurm cluster on this machine: a controller without a database and node daemons, for tests.

Debian: slurm-wlm, munge. Nothing of an installed cluster is used or changed.
"""
import getpass
import os
import shutil
import signal
import socket
import subprocess
import time

PROGRAMS = ("slurmctld", "slurmd", "munged", "sbatch", "squeue")
CONF = """ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={port}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={dir}/munge.socket,cred_expire=10
CredType=cred/munge
StateSaveLocation={dir}/state
SlurmctldPidFile={dir}/slurmctld.pid
SlurmctldLogFile={dir}/slurmctld.log
SlurmdPidFile={dir}/%n.pid
SlurmdLogFile={dir}/%n.log
SlurmdSpoolDir={dir}/spool.%n
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SwitchType=switch/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
SchedulerType=sched/backfill
SchedulerParameters=sched_interval=1,bf_interval=1
SlurmdParameters=config_overrides
ReturnToService=2
SlurmdTimeout=10
KillWait=5
MinJobAge=600
JobRequeue=1
JobAcctGatherType=jobacct_gather/linux
JobAcctGatherFrequency=1
JobAcctGatherParams=OverMemoryKill
AccountingStorageType=accounting_storage/none
{nodes}
PartitionName=main Nodes=ALL Default=YES MaxTime=60 State=UP
PartitionName=other Nodes=ALL MaxTime=60 State=UP
"""


def missing():
    """Programs that are not installed."""
    return [p for p in PROGRAMS if shutil.which(p, path=os.environ["PATH"] + ":/usr/sbin:/sbin") is None]


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


class Cluster:
    """Node daemons node1, node2, ... with CPUs and memory of their own."""

    def __init__(self, folder, nodes=2, cpus=2, memory_mib=6000):
        self.dir = folder
        self.daemons = {}
        os.makedirs(f"{folder}/state")
        os.environ["PATH"] += ":/usr/sbin:/sbin"
        os.environ["SLURM_CONF"] = f"{folder}/slurm.conf"
        lines = [f"NodeName=node{i + 1} NodeHostname={socket.gethostname().split('.')[0]} NodeAddr=127.0.0.1 "
                 f"Port={free_port()} CPUs={cpus} RealMemory={memory_mib} State=UNKNOWN" for i in range(nodes)]
        with open(f"{folder}/slurm.conf", "w", encoding="utf-8") as conf:
            conf.write(CONF.format(host=socket.gethostname().split(".")[0], port=free_port(), dir=folder,
                                   user=getpass.getuser(), nodes="\n".join(lines)))
        with open(f"{folder}/munge.key", "wb") as key:
            key.write(os.urandom(256))
        os.chmod(f"{folder}/munge.key", 0o400)
        self.start("munged", "munged", "--foreground", "--force", f"--key-file={folder}/munge.key",
                   f"--socket={folder}/munge.socket", f"--pid-file={folder}/munged.pid",
                   f"--log-file={folder}/munged.log", f"--seed-file={folder}/munged.seed")
        self.wait_for(lambda: os.path.exists(f"{folder}/munge.socket"), "munged")
        self.start("slurmctld", "slurmctld", "-D")
        for i in range(nodes):
            self.start_node(f"node{i + 1}")
        self.wait_for(lambda: self.run("sinfo", "-h", "-N", "-p", "main", "-t", "idle", "-o", "%N").split() ==
                      [f"node{i + 1}" for i in range(nodes)], "nodes")

    def start(self, name, *words):
        with open(f"{self.dir}/{name}.out", "ab") as out:
            self.daemons[name] = subprocess.Popen(words, stdout=out, stderr=out, stdin=subprocess.DEVNULL)

    def start_node(self, name):
        self.start(name, "slurmd", "-D", "-N", name)

    @staticmethod
    def run(*words):
        """The output of a program of Slurm. The controller may be busy: it is asked again."""
        for _ in range(20):
            done = subprocess.run(words, capture_output=True, text=True, check=False)
            if done.returncode == 0:
                return done.stdout
            time.sleep(0.5)
        raise AssertionError(f"{words}: {done.returncode}\n{done.stderr}")

    @staticmethod
    def wait_for(condition, what, seconds=60):
        until = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < until, f"{what}: not there after {seconds} s"
            time.sleep(0.2)

    def processes_of(self, node):
        """Everything that runs for a node: its daemon, steps and tasks, by the name in their environment."""
        found = [self.daemons[node].pid]
        for pid in filter(str.isdigit, os.listdir("/proc")):
            try:
                with open(f"/proc/{pid}/environ", "rb") as file:
                    environment = file.read().split(b"\0")
                with open(f"/proc/{pid}/cmdline", "rb") as file:
                    command = file.read()
            except OSError:
                continue
            ours = f"SLURM_CONF={self.dir}/slurm.conf".encode() in environment
            # A step leaves its daemon's session and has no parent; it writes to its node's log.
            if ours and (f"SLURMD_NODENAME={node}".encode() in environment or
                         (command.startswith(b"slurmstepd") and f"{self.dir}/{node}.log" in self.files_of(pid))):
                found.append(int(pid))
        return found

    @staticmethod
    def files_of(pid):
        """What a process has open."""
        files = set()
        try:
            for number in os.listdir(f"/proc/{pid}/fd"):
                files.add(os.readlink(f"/proc/{pid}/fd/{number}"))
        except OSError:
            pass
        return files

    def signal_node(self, node, number):
        """To everything that runs for a node, also what that starts meanwhile."""
        reached = set()
        while new := set(self.processes_of(node)) - reached:
            for pid in new:
                try:
                    os.kill(pid, number)
                except ProcessLookupError:
                    pass
            reached |= new

    def freeze_node(self, node):
        """Nothing goes on there any more; the controller does not know yet."""
        self.signal_node(node, signal.SIGSTOP)

    def lose_node(self, node):
        """As if its power were cut."""
        self.signal_node(node, signal.SIGKILL)
        self.daemons[node].wait()

    def tell_of_lost_node(self, node):
        """What the controller finds out by itself after its timeouts."""
        self.run("scontrol", "update", f"NodeName={node}", "State=DOWN", "Reason=lost")

    def stop(self):
        for node in [n for n in self.daemons if n.startswith("node")]:
            self.lose_node(node)
        for daemon in self.daemons.values():
            daemon.terminate()
        for daemon in self.daemons.values():
            try:
                daemon.wait(timeout=10)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()
