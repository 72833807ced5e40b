"""Where an antenna is on a vehicle that lies askew: one rotation matrix after the other."""

import numpy as np


def about_z(angle):
    s, c = np.sin(angle), np.cos(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def about_y(angle):
    s, c = np.sin(angle), np.cos(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def about_x(angle):
    s, c = np.sin(angle), np.cos(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def antenna(attitude, arm):
    """East, north, up of an antenna so far forward, to starboard and up; heading, roll, pitch."""
    heading, roll, pitch = attitude
    forward, starboard, up = arm
    body = np.array([forward, starboard, -up])
    north, east, down = about_z(heading) @ about_y(pitch) @ about_x(roll) @ body
    return np.array([east, north, -down])


def swing(attitude, arm, time, step=1e-4):
    """Its velocity by differences; ``attitude`` is a function of time."""
    before, after = antenna(attitude(time - step), arm), antenna(attitude(time + step), arm)
    return (after - before) / (2.0 * step)


def sigma(attitude, arm, sigmas, step=1e-6):
    """Standard deviations of the offset, by differences, from those of the three angles."""
    attitude = np.asarray(attitude)
    moved = [
        (antenna(attitude + d, arm) - antenna(attitude - d, arm)) / (2.0 * step)
        for d in step * np.eye(3)
    ]
    return np.sqrt(np.sum((np.array(moved) * np.asarray(sigmas)[:, None]) ** 2, axis=0))
