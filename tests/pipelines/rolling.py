"""A ship that rolls and pitches in a seaway, simulated."""

import math

import numpy as np

from reference.lever import antenna, swing

ARM = np.array([20.0, -3.0, 25.0])  # forward, starboard, up


class Rolling:
    """4 m/s on a winding course; roll 10° in 8 s, pitch 3° in 6.3 s."""

    def __init__(self, seconds, seed, roll_deg=10.0):
        rng = np.random.default_rng(seed)
        self.phase = rng.uniform(0.0, 2.0 * np.pi, 4)
        self.amplitude = math.radians(roll_deg)
        self._time = np.arange(-1.0, seconds + 2.0, 0.01)
        way = [4.0 * 0.01 * f(self.heading(self._time)) for f in (np.sin, np.cos)]
        self._place = np.cumsum(way, axis=1)

    def heading(self, time):
        return 0.6 + 0.5 * np.sin(time / 120.0 + self.phase[2])

    def roll(self, time):
        return self.amplitude * np.sin(2.0 * np.pi * time / 8.0 + self.phase[0])

    def pitch(self, time):
        return math.radians(3.0) * np.sin(2.0 * np.pi * time / 6.3 + self.phase[1])

    def attitude(self, time):
        """Heading, roll, pitch, rad."""
        return np.array([self.heading(time), self.roll(time), self.pitch(time)])

    def at(self, time):
        """(n, 3) the reference point, m."""
        return np.column_stack(
            [*(np.interp(time, self._time, each) for each in self._place), np.zeros(len(time))]
        )

    def offset(self, time, arm=ARM):
        """(n, 3) the antenna from it, m."""
        return np.array([antenna(self.attitude(t), arm) for t in time])

    def swing(self, time, arm=ARM):
        """(n, 3) the velocity of that, m/s."""
        return np.array([swing(self.attitude, arm, t) for t in time])
