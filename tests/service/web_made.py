"""A live service with its web side, in a thread of its own, fed by the test."""

import asyncio
import threading
from contextlib import contextmanager

import httpx
import numpy as np

from service.test_station import minutes, recorded, sentence
from surefix.service.inbox import Arrived
from surefix.service.live import begin_live, step
from surefix.service.options import read_live
from surefix.service.web_server import open_web

NOON = 1_785_585_600.0  # 2026-08-01T12:00:00Z, when `recorded` begins
VIEWER, OPERATOR = "viewer-token-0123456789", "operator-token-0123456789"
TOKENS = f'viewer_token = "{VIEWER}"\noperator_token = "{OPERATOR}"\n'
_LIVE = """
[clean]
settle_rows = 40
reorder_s = 2.0

[[input]]
name = "boat"
from = "udp://127.0.0.1:9"

[journal]
url = "sqlite:///mission.db"

[web]
address = "{address}"
{more}
"""


class Served:
    """The service; `loop` is where it lives, `now` what its clock says."""

    def __init__(self, options):
        self.options, self.now = options, NOON
        self._clients = []
        self.live = None
        self.loop = asyncio.new_event_loop()
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self.loop.run_until_complete, args=[self._run()])

    async def _run(self):
        try:
            self.live = begin_live(self.options)
            self.web = open_web(self.live, self.options.web, lambda: self.now)
            self.live.watchers.append(self.web.notice)
        finally:
            self._ready.set()
        await self.web.run()
        self.live.journal.close()

    def start(self):
        self._thread.start()
        assert self._ready.wait(30.0)
        assert self.live is not None

    def stop(self):
        for client in self._clients:
            client.close()
        self.call(self._stop())
        self._thread.join(120.0)
        assert not self._thread.is_alive()
        self.loop.close()

    async def _stop(self):
        self.web.stop()

    def call(self, coroutine):
        """Run something where the service lives; kernels may be compiled first."""
        return asyncio.run_coroutine_threadsafe(coroutine, self.loop).result(300.0)

    async def set(self, **values):
        """Change the service from within."""
        for name, value in values.items():
            setattr(self.live, name, value)
        self.web.notice([])

    @property
    def host(self):
        return f"127.0.0.1:{self.web.port}"

    def feed(self, data, seconds_a_line=1.0 / 3.0):
        """Let sentences arrive, several to a second."""
        lines = data.splitlines(keepends=True)
        for start in range(0, len(lines), 30):
            arrived = []
            for line in lines[start : start + 30]:
                self.now += seconds_a_line
                arrived.append(Arrived(0, self.now, line))
            self.call(step(self.live, arrived, self.now))

    def sail(self, voyage, seconds=4):
        """Let the sentences of a `voyage` arrive, so many seconds of them at a time."""
        arrived = []
        for count, part in enumerate(voyage, 1):
            self.now += 1.0
            arrived += [Arrived(0, self.now, line) for line in part.splitlines(keepends=True)]
            if count % seconds == 0:
                self.call(step(self.live, arrived, self.now))
                arrived = []
        self.call(step(self.live, arrived, self.now))

    def silence(self, seconds):
        """Let time pass without anything."""
        for _ in range(seconds):
            self.now += 1.0
            self.call(step(self.live, [], self.now))

    def client(self, token=None, **headers):
        """A client of the API."""
        shown = {"Authorization": f"Bearer {token}"} if token else {}
        made = httpx.Client(base_url=f"http://{self.host}", headers=shown | headers, timeout=30.0)
        self._clients.append(made)
        return made


def web_options(folder, more="", address="127.0.0.1:0"):
    """Options as read from a file."""
    place = folder / "live.toml"
    place.write_text(_LIVE.format(address=address, more=more))
    return read_live(place)


def voyage(seconds, seed=3):
    """Sentences of a boat that turns, 1 Hz, as they come each second.

    There are wild fixes, a gap at 100 s, a run of wrong ones at 200 s, no heading from 300 s on.
    """
    rng = np.random.default_rng(seed)
    k = np.arange(seconds)
    course = np.radians(20.0 + 50.0 * np.sin(k / 60.0))
    speed = 2.3 + 0.3 * np.sin(k / 25.0)
    north, east = (np.cumsum(speed * turn(course)) for turn in (np.cos, np.sin))
    place = np.column_stack((north, east, 4.0 + 0.4 * np.sin(k / 9.0)))
    place += rng.normal(0.0, [0.8, 0.8, 0.3], place.shape)
    wild = rng.random(seconds) < 0.06
    place[wild, :2] += rng.normal(0.0, 25.0, (int(wild.sum()), 2))
    place[(k >= 200) & (k < 215), :2] += [30.0, -18.0]
    latitude, longitude = 54.0 + place[:, 0] / 111_300.0, 10.0 + place[:, 1] / 65_600.0
    for i in k.tolist():
        clock = f"12{i // 60:02d}{i % 60:02d}.00"
        where = f"{minutes(latitude[i], 2)},N,{minutes(longitude[i], 3)},E"
        knots, degrees = speed[i] / 0.514444 + rng.normal(0.0, 0.1), np.degrees(course[i]) % 360.0
        gga = sentence(f"GPGGA,{clock},{where},1,08,1.0,{place[i, 2]:.2f},M,40.0,M,,")
        rmc = sentence(f"GPRMC,{clock},A,{where},{knots:.2f},{degrees:.1f},010826,,,A")
        hdt = sentence(f"HEHDT,{(degrees + rng.normal()) % 360.0:.2f},T")
        yield (b"" if 100 <= i < 108 else gga + rmc) + (hdt if i < 300 else b"")


@contextmanager
def served(folder, more="", rows=120):
    """Serve while the body runs."""
    made = Served(web_options(folder, more))
    made.start()
    try:
        if rows:
            made.feed(recorded(rows))
        yield made
    finally:
        made.stop()
