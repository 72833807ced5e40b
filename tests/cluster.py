"""A PostgreSQL server of the tests' own: in a folder of its own, on a port of its own."""

import os
import pwd
import shutil
import signal
import socket
import subprocess
import tempfile
from itertools import count
from pathlib import Path

import needs

_INSTALLED = "/usr/lib/postgresql"  # where Debian keeps what is not on the path


class Cluster:
    """A server that can be stopped, frozen and begun again."""

    def __init__(self, folder, programs):
        self._folder, self._programs = folder, programs
        self._names = count(1)
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]

    def run(self, program, *words):
        """Run one of its programs, as somebody else if we are root: PostgreSQL refuses root."""
        who = {} if os.geteuid() else {"user": "postgres", "group": "postgres", "extra_groups": []}
        words = [self._programs / program, *map(str, words)]
        with (self._folder / "said.txt").open("ab") as said:
            subprocess.run(words, check=True, cwd=self._folder, stdout=said, stderr=said, **who)

    def begin(self):
        options = f"-p {self.port} -h 127.0.0.1 -k {self._folder} -c fsync=off"
        self.run("pg_ctl", "-D", self._folder / "data", "-w", "-o", options, "start")

    def stop(self):
        """Away at once, as if the machine had been switched off."""
        self.run("pg_ctl", "-D", self._folder / "data", "-w", "-m", "immediate", "stop")

    def database(self):
        """The URL of a new data base."""
        name = f"mission{next(self._names)}"
        self.run("createdb", "-h", "127.0.0.1", "-p", self.port, "-U", "surefix", name)
        return f"postgresql://surefix@127.0.0.1:{self.port}/{name}"

    def signal(self, number):
        """Send a signal to all its processes."""
        first = int((self._folder / "data" / "postmaster.pid").read_text().split()[0])
        words = ["ps", "-o", "pid=", "--ppid", str(first)]
        told = subprocess.run(words, check=True, capture_output=True)
        for pid in [*map(int, told.stdout.split()), first]:
            os.kill(pid, number)


def cluster():
    """Begin a server, give it, and remove it; for a fixture."""
    places = sorted(Path(_INSTALLED).glob("*/bin"), reverse=True)
    path = os.pathsep.join([*map(str, places), os.environ["PATH"]])
    found = shutil.which("initdb", path=path) or needs.tool("initdb")
    folder = Path(tempfile.mkdtemp(prefix="surefix-pg"))
    if os.geteuid() == 0:
        known = pwd.getpwnam("postgres")
        os.chown(folder, known.pw_uid, known.pw_gid)
    made = Cluster(folder, Path(found).resolve().parent)
    try:
        made.run("initdb", "-D", folder / "data", "-A", "trust", "-U", "surefix", "--no-sync")
        made.begin()
        yield made
        made.signal(signal.SIGCONT)
        made.stop()
    finally:
        shutil.rmtree(folder, ignore_errors=True)
