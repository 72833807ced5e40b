"""A simulated dive: a ship that turns, a vehicle below it, each instrument on its own line."""

import math

import numpy as np

from acoustic_logs import angle, clock, dvl, line, on_earth, received
from surefix.geo.time import parse_time
from surefix.io.journal import Received

DAY, START = parse_time("2024-05-14"), 40_000.0
STEP = 0.05  # s between two points of the simulated motion


class Dive:
    """The truth, and what each instrument sends: (time of arrival, line) by name of the line.

    ``outages`` are spans of seconds in which an instrument is silent, by name.
    """

    def __init__(self, seed, seconds=80, outages=None):
        self.rng = np.random.default_rng(seed)
        self.seconds, self.outages = seconds, outages or {}
        self.phase = self.rng.uniform(0.0, 6.0)
        self.turn = self.rng.choice([-3.0, 3.0])  # deg/s of the ship
        time = np.arange(0.0, seconds + 2.0, STEP)
        bow = np.radians(self.heading(time))
        ahead, side = 0.8, 0.1 * np.sin(time / 9.0 + self.phase)
        east = ahead * np.sin(bow) + side * np.cos(bow)
        north = ahead * np.cos(bow) - side * np.sin(bow)
        self.time = time
        self.east, self.north = 30.0 + np.cumsum(east) * STEP, -80.0 + np.cumsum(north) * STEP
        self.lines = {
            "usbl": self.usbl(),
            "gnss": self.gnss(),
            "gyro": self.gyro(),
            "dvl": self.dvl(),
            "compass": self.compass(),
            "depth": self.depths(),
        }
        for name, (since, until) in self.outages.items():
            here = DAY + START + since, DAY + START + until
            kept = [each for each in self.lines[name] if not here[0] <= each[0] < here[1]]
            self.lines[name] = kept

    def heading(self, time):
        """Of the vehicle, deg, to and fro through north, 10°/s at most."""
        return 50.0 * np.sin(np.asarray(time) / 5.0 + self.phase) % 360.0

    def place(self, time):
        """Of the vehicle, m east and north."""
        return np.interp(time, self.time, self.east), np.interp(time, self.time, self.north)

    def depth(self, time):
        return 100.0 + 5.0 * math.sin(time / 30.0)

    def ship(self, time):
        """East, north m, heading deg: ahead at 2 m/s, turning all the time."""
        bow = 350.0 + self.turn * time
        rate = math.radians(self.turn)
        radius = 2.0 / rate
        start = math.radians(350.0)
        end = math.radians(bow)
        east = radius * (math.cos(start) - math.cos(end))
        north = radius * (math.sin(end) - math.sin(start))
        return east, north, bow % 360.0

    def usbl(self):
        """From the ship, to starboard and ahead, once a second; one in fifteen is far off."""
        out = []
        for k in range(self.seconds):
            time = k + 0.37
            (x, y, bow), (east, north) = self.ship(time), self.place(time)
            far = 40.0 if self.rng.random() < 1 / 15 else 0.0
            east, north = (east - x + self.noise(0.5) + far), (north - y + self.noise(0.5))
            turn = math.radians(bow)
            starboard = east * math.cos(turn) - north * math.sin(turn)
            ahead = east * math.sin(turn) + north * math.cos(turn)
            deep = self.depth(time) + self.noise(0.5)
            place = f"C,H,M,{starboard:.4f},{ahead:.4f},{deep:.4f}"
            out.append((0.6, time, f"PSIMSSB,{clock(START + time)},B01,A,,{place},0.75,N,,"))
        return self.sent(out)

    def gnss(self):
        """GGA, and a little later RMC with the date, once a second."""
        out = []
        for k in range(self.seconds + 1):
            latitude, longitude = on_earth(*self.ship(k)[:2])
            place = f"{angle(latitude, 2, 'NS')},{angle(longitude, 3, 'EW')}"
            now = clock(START + k)
            out.append((0.15, k, f"GPGGA,{now},{place},4,12,0.8,5.0,M,40.0,M,,"))
            out.append((0.17, k, f"GPRMC,{now},A,{place},3.9,0.0,140524,,,A"))
        return self.sent(out)

    def gyro(self):
        return self.sent(
            (0.0, k / 2, f"HEHDT,{self.ship(k / 2)[2]:.4f},T") for k in range(2 * self.seconds)
        )

    def compass(self):
        """Of the vehicle, 4 times a second, with noise, and single spikes."""
        out = []
        for k in range(4 * self.seconds):
            said = (self.heading(k / 4) + self.noise(0.3) + (90.0 if k % 97 == 50 else 0.0)) % 360.0
            out.append((0.0, k / 4, f"HCHDT,{said:.2f},T"))
        return self.sent(out)

    def dvl(self):
        """Twice a second; without bottom for 7 s, and invalid now and then."""
        out = []
        for k in range(2 * self.seconds):
            time = k / 2 + 0.03
            at = DAY + START + time
            side = 0.1 * math.sin(time / 9.0 + self.phase)
            valid = not 35.0 <= time < 42.0 and self.rng.random() > 0.05
            said = {"vx": 0.8 + self.noise(0.01), "vy": side + self.noise(0.01), "vz": 0.0}
            text = dvl(at + 0.1, at, valid, **(said if valid else {"vx": 0.0, "fom": 10.0}))
            out.append((at + 0.12, text))
            if k % 4 == 0:  # dead reckoning of its own, of which nothing is taken
                own = b'{"ts":%.2f,"x":1.0,"y":2.0,"z":3.0,"type":"position_local",' % at
                out.append((at + 0.13, own + b'"format":"json_v3.1","status":0}\r\n'))
        return out

    def depths(self):
        return self.sent(
            (0.0, k, f"SDDPT,{self.depth(k) + self.noise(0.05):.2f},0.0")
            for k in range(self.seconds)
        )

    def noise(self, sigma):
        return float(self.rng.normal(0.0, sigma))

    @staticmethod
    def sent(told):
        """Sentences with when they arrive, so much after the instant that they are about."""
        return [(DAY + START + time + after, line(body)) for after, time, body in told]

    def log(self, folder, name, *others):
        """Record lines with their times of reception; gives the file."""
        place = folder / f"{name}.log"
        lines = sorted(each for one in (name, *others) for each in self.lines[one])
        place.write_bytes(b"".join(received(text, at) for at, text in lines))
        return place

    def arriving(self, names, delay=None, seed=0):
        """Pieces of all lines as they come in, some lines in two, and the ends of the inputs.

        ``delay`` is s, by name, that a line is behind.
        """
        rng = np.random.default_rng(seed)
        late = delay or {}
        coming = [
            (at + late.get(name, 0.0), source, received(text, at))
            for source, name in enumerate(names)
            for at, text in self.lines[name]
        ]
        pieces = []
        for at, source, text in sorted(coming):
            cut = int(rng.integers(1, len(text))) if rng.random() < 0.3 else len(text)
            pieces += [(at, source, part) for part in (text[:cut], text[cut:]) if part]
        pieces += [(math.nan, source, b"") for source in range(len(names))]
        return [Received(n, source, at, data) for n, (at, source, data) in enumerate(pieces, 1)]

    def errors(self, track, since=20.0):
        """Horizontal errors of a track, m, after so many seconds."""
        from acoustic_logs import HOME

        time = track.time - DAY - START
        x, y, _ = HOME.to_local(track.geodetic[:, 0], track.geodetic[:, 1])
        east, north = self.place(time)
        return np.hypot(x - east, y - north)[time >= since]
