"""Real robots: one moves by its odometry, four others of known pose see it by range and bearing.

UTIAS Multi-Robot Cooperative Localization and Mapping, data set 6 (Leung et al., IJRR 30, 2011);
skipped where the recordings are absent.
"""

import numpy as np
import pytest

from surefix.filters.sigma_point import Gaussian, predict, update
from surefix.geo.angle import wrap
from surefix.models.ranging import range_to
from surefix.robust.loss import loss_named

TURN = 2.0 * np.pi
SIGMA = np.diag(np.square([0.15, 0.05]))  # m, rad
SPEEDS = np.square([0.1, 0.3])  # (m/s)², (rad/s)² of the odometry, as white noise over 1 s


def read(folder, name):
    return np.loadtxt(folder / f"{name}.dat", ndmin=2)


def poses(truth, time):
    """x, y, heading of a robot at the given times."""
    columns = [np.interp(time, truth[:, 0], truth[:, c]) for c in (1, 2)]
    heading = np.interp(time, truth[:, 0], np.unwrap(truth[:, 3]))
    return np.column_stack((*columns, heading))


def sightings(folder, target):
    """Rows of time, range, bearing and the observer's pose, of all that see the target."""
    barcode = dict(read(folder, "Barcodes").astype(int).tolist())[target]
    rows = []
    for robot in (1, 2, 3, 4, 5):
        if robot != target:
            seen = read(folder, f"Robot{robot}_Measurement")
            seen = seen[seen[:, 1] == barcode]
            known = poses(read(folder, f"Robot{robot}_Groundtruth"), seen[:, 0])
            rows.append(np.column_stack((seen[:, [0, 2, 3]], known)))
    rows = np.concatenate(rows)
    return rows[np.argsort(rows[:, 0], kind="stable")]


def moved(points, speed, turn, dt):
    heading = points[..., 2] + 0.5 * dt * turn
    step = np.stack((speed * np.cos(heading), speed * np.sin(heading)), axis=-1) * dt
    return np.concatenate((points[..., :2] + step, points[..., 2:] + dt * turn), axis=-1)


def seen_from(points, pose):
    flat = np.concatenate((points[..., :2], np.zeros_like(points[..., :1])), axis=-1)
    off = points[..., :2] - pose[:2]
    bearing = np.arctan2(off[..., 1], off[..., 0]) - pose[2]
    return np.stack((range_to(flat, [*pose[:2], 0.0]), bearing), axis=-1)


def difference(a, b):
    away = a - b
    return np.concatenate((away[..., :1], wrap(away[..., 1:], TURN)), axis=-1)


def track(folder, target, loss, use=True):
    """Times, positions (n, 2) and truth after each sighting."""
    truth = read(folder, f"Robot{target}_Groundtruth")
    odometry, rows = read(folder, f"Robot{target}_Odometry"), sightings(folder, target)
    rows = rows[(rows[:, 0] > truth[0, 0] + 20.0) & (rows[:, 0] < truth[-1, 0])]
    time = rows[0, 0]
    x = Gaussian(poses(truth, np.array([time]))[0], 0.1 * np.eye(3))
    at, found = np.searchsorted(odometry[:, 0], time), []
    for row in rows:
        while time < row[0]:
            end = min(row[0], odometry[min(at + 1, len(odometry) - 1), 0])
            if end <= time:
                end = row[0]
            dt, (speed, turn) = end - time, odometry[at, 1:]
            Q = dt * np.diag([SPEEDS[0], SPEEDS[0], SPEEDS[1]])
            x = predict(x, lambda p, s=speed, w=turn, d=dt: moved(p, s, w, d), Q)
            time, at = end, min(at + 1, len(odometry) - 1)
        if use:
            x, _ = update(
                x,
                row[1:3],
                lambda p, pose=row[3:]: seen_from(p, pose),
                SIGMA,
                difference=difference,
                loss=loss,
            )
        found.append(x.mean[:2])
    return np.array(found), poses(truth, rows[:, 0])[:, :2]


THRESHOLDS = loss_named("igg1", k0=1.5, k1=4.5)


def errors(folder, target, loss, use=True):
    found, truth = track(folder, target, loss, use)
    return np.linalg.norm(found - truth, axis=1)


@pytest.mark.parametrize(("target", "loss"), [(3, None), (4, THRESHOLDS), (5, THRESHOLDS)])
def test_robot_is_kept_by_the_sightings_of_the_others(data, target, loss):
    folder = data / "coop_mrclam6"
    error = errors(folder, target, loss)
    assert len(error) > 400
    assert np.median(error) < 0.12
    assert np.median(error) < 0.05 * np.median(errors(folder, target, loss, use=False))


@pytest.mark.xfail(strict=True, reason="thresholds lock out: robot 3 drifts unseen for 123 s")
def test_thresholds_find_back_after_two_minutes_unseen(data):
    assert np.median(errors(data / "coop_mrclam6", 3, THRESHOLDS)) < 0.12
