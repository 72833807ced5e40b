"""A ship with several receivers, simulated, whose sentences are fed to the live service."""

import asyncio
import math
from typing import NamedTuple

import numpy as np
import pandas as pd
import pytest

from service.test_station import minutes, sentence, table
from surefix.pipelines.clean import clean_sources
from surefix.pipelines.inputs import open_inputs
from surefix.pipelines.joining import join
from surefix.pipelines.options import CleanOptions
from surefix.service import keeper
from surefix.service.addresses import Address
from surefix.service.inbox import Arrived
from surefix.service.live import begin_live, step
from surefix.service.options import InputOptions, LiveOptions
from surefix.service.station import begin_station, receive

START = 1_785_585_600.0  # 2026-08-01T12:00:00Z
CLEAN = CleanOptions(mode="realtime", settle_rows=60, reorder_s=2.0)
_METRES = 111_195.0
_COSINE = math.cos(math.radians(54.0))


@pytest.fixture(autouse=True)
def _patient(monkeypatch):
    """Wait for the journal however busy the disk is: it is not what is tested here."""
    monkeypatch.setattr(keeper, "_PATIENCE", 60.0)


class Ship:
    """A ship at 4 m/s that turns now to this, now to that side."""

    def __init__(self, seconds, seed=1, turning=0.01, step=0.1):
        rng = np.random.default_rng(seed)
        n = int(seconds / step) + 2
        self.time = step * np.arange(n)
        rate = np.zeros(n)
        kick = turning * math.sqrt(2.0 * step / 30.0) * rng.normal(size=n)
        for k in range(1, n):
            rate[k] = rate[k - 1] * (1.0 - step / 30.0) + kick[k]
        self.heading = 0.3 + np.cumsum(rate) * step
        way = 4.0 * step * np.column_stack([np.sin(self.heading), np.cos(self.heading)])
        self.place = np.cumsum(way, axis=0)

    def at(self, time):
        """East and north, m, of the reference point."""
        return np.array([np.interp(time, self.time, column) for column in self.place.T])

    def bow(self, time):
        """Heading, rad."""
        return float(np.interp(time, self.time, self.heading))

    def antenna(self, time, arm):
        """East and north, m, of a point so far forward and to starboard."""
        bow = self.bow(time)
        forward, starboard = arm
        turned = [math.sin(bow), math.cos(bow)], [math.cos(bow), -math.sin(bow)]
        return self.at(time) + forward * np.array(turned[0]) + starboard * np.array(turned[1])


def gga(time, east_north, quality=1):
    """A fix as a sentence; ``time`` in s since noon."""
    east, north = east_north
    clock = f"{12 + int(time // 3600):02d}{int(time // 60) % 60:02d}{time % 60:05.2f}"
    latitude, longitude = 54.0 + north / _METRES, 10.0 + east / (_METRES * _COSINE)
    place = f"{minutes(latitude, 2)},N,{minutes(longitude, 3)},E"
    return sentence(f"GPGGA,{clock},{place},{quality},08,1.0,2.0,M,40.0,M,,")


def hdt(heading):
    """A heading, rad, as a sentence."""
    return sentence(f"HEHDT,{math.degrees(heading) % 360.0:.2f},T")


def where(shown):
    """East and north, m, of what the service says."""
    latitude, longitude, _ = shown.geodetic
    return np.array([(longitude - 10.0) * _METRES * _COSINE, (latitude - 54.0) * _METRES])


class Told(NamedTuple):
    """What the service said after one step: errors in m, σ in m, sensors by name, open alarms."""

    time: float
    error: np.ndarray
    sigma: float
    sensors: dict
    alarms: tuple


def service_of(folder, names, clean=CLEAN, **more):
    """Begin a service of inputs that are never opened."""
    inputs = tuple(
        InputOptions(name=name, address=Address("udp", "127.0.0.1", 1), **more.get(name, {}))
        for name in names
    )
    journal = f"sqlite:///{folder}/mission.db"
    return begin_live(LiveOptions(clean=clean, inputs=inputs, journal=journal))


def sail(live, ship, seconds, heard, *, begin=0, late=0.2):
    """Feed a service a second at a time.

    ``heard(i, t)`` gives what input i sends in the second t, no bytes if it is silent; or a list of
    sentences that each arrive at a time of their own.
    """
    told = []

    async def go():
        for second in range(begin, seconds):
            now = START + second + 0.5 + late
            pieces = []
            for i in range(len(live.options.inputs)):
                said = heard(i, second)
                some = said if isinstance(said, list) else [(second + 0.1 * i + late, said)]
                pieces += [Arrived(i, START + at, data) for at, data in some if data]
            await step(live, sorted(pieces, key=lambda piece: piece.time), now)
            shown = live.now
            error, sigma = np.full(2, np.nan), math.nan
            if shown is not None:
                error = where(shown) - ship.at(shown.time - START)
                sigma = float(max(shown.sigma_position[:2]))
            sensors = {state.name: state for state in live.sensors}
            told.append(Told(second, error, sigma, sensors, live.alarms))

    asyncio.run(go())
    return told


def cleaned_again(live, folder):
    """Clean the mission from its journal, once as live and once from the beginning to the end.

    What the live run confirmed is the same to the last bit. Returns it, and the other run.
    """
    station, given = begin_station(live.options), []
    for piece in live.journal.received():
        station, batches = receive(station, [piece])
        given += batches
    live.journal.close()
    again = clean_sources(open_inputs([folder / "mission.db"]), live.options.clean)
    confirmed = table(join(given))
    pd.testing.assert_frame_equal(confirmed, table(again).iloc[: len(confirmed)], check_exact=True)
    return confirmed, again
