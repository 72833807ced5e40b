"""The live service in a process that is killed: at a named point, or at any time from outside.

A process that has everything loaded forks for each run, so that a thousand of them take minutes.
It reads ``POINT N``, runs the service until the point has been passed N times and kills itself
there; ``- 0`` runs until it is killed. It answers with the number of the process, then with how it
ended. The product knows nothing of this: its functions are wrapped here.
"""

import asyncio
import os
import signal
import sys
import threading
import time

from sqlalchemy import event
from sqlalchemy.engine import Engine

from service.test_station import CLEAN, recorded, station_of
from surefix.io import journal
from surefix.io.journal import Journal, Received
from surefix.service import live as service
from surefix.service import outputs, station
from surefix.service.live import begin_live, run_live
from surefix.service.options import read_live

POINTS = {
    "taken from the inbox": (service, "step", "before"),
    "cleaned": (service, "receive", "after"),
    "before the journal": (Journal, "write", "before"),
    "amid the transaction": (journal, "_insert", "after"),
    "before the commit": (None, "commit", "before"),
    "during the commit": (None, "commit", "during"),
    "between journal and output": (Journal, "write", "after"),
    "before it is put out": (outputs._Datagrams, "send", "before"),
    "put out": (outputs._Datagrams, "send", "after"),
    "during a snapshot": (station, "snapshot", "before"),
    "between snapshot and journal": (service, "stored", "after"),
    "while it resumes": (service, "resumed", "after"),
    "while it catches up": (service, "begin_station", "after"),
}


def die():
    os.kill(os.getpid(), signal.SIGKILL)


def arm(point, passes):
    """Kill this process when the point has been passed so often."""
    owner, name, when = POINTS[point]
    left = [passes]

    def passed():
        left[0] -= 1
        if left[0] == 0:
            if when == "during":
                threading.Thread(target=lambda: (time.sleep(2e-4 * (passes % 8)), die())).start()
            else:
                die()

    if owner is None:
        event.listen(Engine, name, lambda connection: passed())
        return
    whole = getattr(owner, name)

    def wrapped(*given, **more):
        if when == "before":
            passed()
        done = whole(*given, **more)
        if when == "after":
            passed()
        return done

    setattr(owner, name, wrapped)


def serve(options):
    asyncio.run(run_live(begin_live(options), asyncio.Event()))


def main(place):
    options = read_live(place)
    warm = station_of("warm", clean=CLEAN)
    warm, _ = station.receive(warm, [Received(1, 0, float("nan"), recorded(80))])
    station.latest(warm, 2e9)
    print("ready", flush=True)
    for line in sys.stdin:
        point, passes = line.rsplit(" ", 1)
        child = os.fork()
        if child == 0:
            if point != "-":
                arm(point, int(passes))
            serve(options)
            os._exit(0)
        print(child, flush=True)
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
