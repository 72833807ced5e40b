"""All contests: what surefix ships, against what does the same elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

import by_hand
import linear_peers
import sight_peers
from contest import Contest, Contestant
from problems import Linear, constant_velocity, three_platforms
from surefix.cleaning.hampel import hampel
from surefix.cleaning.running_median import running_median
from surefix.filters.hypotheses import no_hypotheses
from surefix.filters.kalman import gaussian
from surefix.filters.learning import supposed
from surefix.filters.linear import advance, filter_linear, stacked, stream_model
from surefix.filters.multi_hypothesis import filter_hypotheses
from surefix.filters.multi_hypothesis_modes import lagged_hypotheses
from surefix.filters.records import Epochs, Motion, Recovery
from surefix.filters.rts import smooth
from surefix.filters.sigma_point_series import filter_sights
from surefix.filters.track import by_block, filter_track, start
from surefix.models.sights import BEARING, RANGE
from surefix.robust.loss import loss_named

__all__ = ["all_contests"]

EPOCHS = 5000
FEW = 100  # epochs for those that take long
SAMPLES = 20_000
WIDEST = 30_001
TRACKS, LENGTH = 10_000, 200


def all_contests() -> Iterator[Callable[[], Contest]]:
    """Contests one by one, each made when it is called."""
    for m in (6, 3):
        yield partial(plain, m)
    for m in (6, 3):
        yield partial(robust, m)
    yield sights
    for m in (6, 3):
        yield partial(one_call, m)
    for window in (5, 39, 301, 3001, WIDEST):
        yield partial(medians, window)
    for window in (5, 39, 301):
        yield partial(identifier, window)
    yield partial(tracks, gaps=False)
    yield partial(tracks, gaps=True)
    yield track_filter
    yield partial(hypotheses, aided=True)
    yield partial(hypotheses, aided=False)
    yield lagged


def plain(m: int) -> Contest:
    """Kalman filter: means and covariances of a whole series."""
    problem = constant_velocity(m, EPOCHS)
    first = gaussian(problem.mean, problem.covariance)
    model = (problem.F, problem.Q, problem.H, problem.R)
    ours = Contestant(
        "surefix", EPOCHS, lambda: filter_linear(first, problem.z, *model)[:2], _moments
    )
    contest = Contest(f"Kalman filter, 6 states, {m} observed", "µs an epoch", 1e6, [ours])
    contest.aims = {"C": 1.3, "statsmodels": 1 / 8, "FilterPy": 1 / 60, "Stone Soup": 1e-3}
    _add(contest, "C", partial(by_hand.filter_in_c, robust=False), problem)
    _add(contest, "statsmodels", linear_peers.statsmodels, problem)
    _add(contest, "kalman-py (JAX)", linear_peers.kalman_py, problem)
    _add(contest, "dynamax (JAX)", linear_peers.dynamax, problem)
    _add(contest, "fast-kalman", linear_peers.fast_kalman, problem, 500)
    _add(contest, "FilterPy", linear_peers.filterpy, problem, FEW)
    _add(contest, "Stone Soup", linear_peers.stonesoup, problem, FEW)
    return contest


def robust(m: int) -> Contest:
    """The same with IGG3 weights on data with 5 % wild observations."""
    problem = constant_velocity(m, EPOCHS, gross=0.05)
    first, loss = gaussian(problem.mean, problem.covariance), loss_named("igg3")
    model = (problem.F, problem.Q, problem.H, problem.R)
    ours = Contestant(
        "surefix", EPOCHS, lambda: filter_linear(first, problem.z, *model, loss)[:2], _moments
    )
    contest = Contest(f"IGG3, 6 states, {m} observed, 5 % wild", "µs an epoch", 1e6, [ours])
    contest.aims = {"C": 1.3, "FilterPy and a χ² gate": 1 / 70}
    _add(contest, "C", partial(by_hand.filter_in_c, robust=True), problem)
    gated = linear_peers.gated_filterpy
    _add(contest, "FilterPy and a χ² gate", gated, problem, FEW, another=True)
    return contest


def sights() -> Contest:
    """Unscented filter, three platforms with a range and a bearing each."""
    problem = three_platforms(EPOCHS)
    first = gaussian(problem.mean, problem.covariance)
    kinds, places = [RANGE, BEARING] * 3, np.repeat(problem.platforms, 2, axis=0)
    model = (problem.F, problem.Q, kinds, places, problem.R)
    ours = Contestant(
        "surefix", EPOCHS, lambda: filter_sights(first, problem.z, *model)[:2], _moments
    )
    contest = Contest("Unscented filter, 3 ranges and bearings", "µs an epoch", 1e6, [ours])
    contest.aims = {"fastest": 1 / 50}
    _add(contest, "kalman-py (JAX)", sight_peers.kalman_py, problem)
    _add(contest, "fast-kalman", sight_peers.fast_kalman, problem, FEW)
    _add(contest, "FilterPy", sight_peers.filterpy, problem, FEW)
    return contest


def one_call(m: int) -> Contest:
    """One epoch a call from Python."""
    problem = constant_velocity(m, 200)
    model = stream_model(problem.F, problem.Q, problem.H, problem.R)
    begin = stacked(gaussian(problem.mean, problem.covariance))
    rows = list(problem.z)

    def run() -> list[np.ndarray]:
        state, out = begin, []
        for z in rows:
            state, _ = advance(model, state, z)
            out.append(state)
        return out

    def figures(out: object) -> np.ndarray:
        return np.array(out).reshape(len(rows), -1)  # type: ignore[arg-type]

    contest = Contest(
        f"One call an epoch, 6 states, {m} observed",
        "µs a call",
        1e6,
        [Contestant("surefix", len(rows), run, figures)],
        limit=2.0,
    )
    _add(contest, "fast-kalman", linear_peers.fast_kalman, problem)
    _add(contest, "OpenCV", linear_peers.opencv, problem)
    _add(contest, "FilterPy", linear_peers.filterpy, problem, FEW)
    return contest


def medians(window: int) -> Contest:
    """Running median of normal noise; compared where the whole window is inside."""
    samples = SAMPLES if window < 1000 else 5 * SAMPLES
    x = np.random.default_rng(1).standard_normal(samples)
    ours = Contestant(
        "surefix", samples, lambda: running_median(x, window), partial(_inside, window)
    )
    contest = Contest(f"Running median, window {window}", "ns a sample", 1e9, [ours])
    if window <= 301:
        contest.aims = {"bottleneck": 1.0, "scipy.ndimage": 1.0}
    try:
        import bottleneck

        lag = window // 2

        def trailing(y: object) -> np.ndarray:
            return _inside(window, np.roll(np.asarray(y), -lag))

        run = partial(bottleneck.move_median, x, window)
        contest.contestants.append(Contestant("bottleneck", samples, run, trailing))
    except ImportError as error:
        contest.skipped["bottleneck"] = str(error)
    from scipy.ndimage import median_filter

    run = partial(median_filter, x, size=window)
    contest.contestants.append(Contestant("scipy.ndimage", samples, run, partial(_inside, window)))
    return contest


def identifier(window: int) -> Contest:
    """Hampel identifier: cleaned series. The peer works in single precision."""
    rng = np.random.default_rng(2)
    x = rng.standard_normal(SAMPLES).astype(np.float32).astype(np.float64)
    x[rng.random(SAMPLES) < 0.05] += 20.0
    ours = Contestant("surefix", SAMPLES, lambda: hampel(x, window=window).value, _itself)
    contest = Contest(f"Hampel identifier, window {window}", "ns a sample", 1e9, [ours])
    contest.aims = {"hampel": 0.5}
    try:
        from hampel import hampel as theirs

        few = x[:1000]
        contest.contestants.append(
            Contestant(
                "hampel",
                len(few),
                lambda: theirs(few, window, 3.0).filtered_data,
                lambda y: np.asarray(y, float)[window:-window],
            )
        )
        contest.contestants[0] = Contestant(
            "surefix", SAMPLES, ours.run, lambda y: np.asarray(y)[window:]
        )
    except ImportError as error:
        contest.skipped["hampel"] = str(error)
    return contest


def tracks(*, gaps: bool) -> Contest:
    """Many tracks of one model at once, on all cores; complete, or each with gaps of its own."""
    problem = constant_velocity(6, LENGTH)
    rng = np.random.default_rng(3)
    z = problem.z + 0.1 * rng.standard_normal((TRACKS, LENGTH, 6))
    if gaps:
        z[rng.random((TRACKS, LENGTH)) < 0.05] = np.nan
    first = gaussian(problem.mean, problem.covariance)
    model = (problem.F, problem.Q, problem.H, problem.R)
    ours = Contestant("surefix", 1, lambda: filter_linear(first, z, *model)[:2], _some)
    name = f"{TRACKS:,} tracks of {LENGTH} epochs, 6 states{', 5 % missing' if gaps else ''}"
    contest = Contest(name, "s", 1.0, [ours])
    peers = {"simdkalman": linear_peers.simdkalman_tracks}
    if not gaps:  # dynamax knows none
        peers["dynamax (vmap, JAX)"] = linear_peers.dynamax_tracks
        contest.aims = {"dynamax (vmap, JAX)": 1.0, "simdkalman": 0.1}
    for name, peer in peers.items():
        try:
            contest.contestants.append(Contestant(name, 1, peer(problem, z), _some))
        except ImportError as error:
            contest.skipped[name] = str(error)
    return contest


def track_filter() -> Contest:
    """The filter of ``surefix clean``, its diagnostics included, and its smoother."""
    motion, epochs = _dive(aided=True)
    recovery = Recovery(40.0, 10.0)
    loss, begin = loss_named("igg3"), start(motion, recovery)

    def forward() -> object:
        return filter_track(motion, loss, recovery, epochs, begin)[1]

    filtered = filter_track(motion, loss, recovery, epochs, begin)[1]
    contest = Contest("surefix clean --method igg3, its filter", "µs an epoch", 1e6, [])
    contest.contestants = [
        Contestant("surefix", EPOCHS, forward),
        Contestant("its smoother", EPOCHS, lambda: smooth(motion, recovery, epochs.time, filtered)),
    ]
    return contest


def hypotheses(*, aided: bool) -> Contest:
    """Several hypotheses in real time, 16 of them."""
    motion, epochs = _dive(aided=aided)
    prior = supposed(2, 0.5, 0.1 if aided else np.nan, 10.0, 40.0)

    def run() -> object:
        return filter_hypotheses(motion, prior, epochs, no_hypotheses(motion, 16), traced=False)

    name = "with velocities" if aided else "fixes alone"
    return Contest(
        f"16 hypotheses, {name}",
        "µs an epoch",
        1e6,
        [Contestant("surefix", EPOCHS, run)],
        limit=6.0 if aided else None,
    )


def lagged() -> Contest:
    """Several hypotheses, as many as the product keeps, with a lag."""
    motion, epochs = _dive(aided=True)
    prior = supposed(2, 0.5, 0.1, 10.0, 40.0)
    wanted = np.ones(EPOCHS, dtype=bool)

    def run() -> object:
        return lagged_hypotheses(motion, prior, epochs, 40.0, wanted)

    def realtime() -> object:
        return filter_hypotheses(motion, prior, epochs, no_hypotheses(motion), traced=False)

    return Contest(
        "All hypotheses, output 40 s behind, with velocities",
        "µs an epoch",
        1e6,
        [Contestant("surefix", EPOCHS, run), Contestant("surefix, real time", EPOCHS, realtime)],
    )


def _dive(*, aided: bool) -> tuple[Motion, Epochs]:
    """Fixes on two axes each second, 10 % of them wild, with a velocity or without."""
    rng = np.random.default_rng(4)
    problem = constant_velocity(6, EPOCHS)
    z = np.full((EPOCHS, 4), np.nan)
    z[:, :2] = problem.z[:, :2]
    if aided:
        z[:, 2:] = problem.z[:, 3:5]
    wild = rng.random(EPOCHS) < 0.1
    z[wild, :2] += 40.0 * rng.standard_normal((int(wild.sum()), 2))
    variance = np.tile([0.5, 0.5, 0.02, 0.02], (EPOCHS, 1))
    group = by_block((0, 1))
    motion = Motion(2, 2, np.full(2, 0.01), group, 2, 0.0)
    epochs = Epochs(
        0.5 * np.arange(EPOCHS),
        z,
        variance,
        np.full((EPOCHS, 2), np.nan),
        np.zeros(EPOCHS, np.int64),
        np.zeros(EPOCHS, np.int64),
    )
    return motion, epochs


def _add(
    contest: Contest,
    name: str,
    peer: Callable[..., Callable[[], object]],
    problem: Linear,
    count: int | None = None,
    *,
    another: bool = False,
) -> None:
    """Let a peer in, on the first epochs; or note why it is missing."""
    some = problem._replace(z=problem.z[:count])
    try:
        run = peer(some)
    except (ImportError, FileNotFoundError) as error:
        contest.skipped[name] = str(error)
        return
    contest.contestants.append(Contestant(name, len(some.z), run, None if another else _moments))


def _moments(found: object) -> np.ndarray:
    mean, covariance = found  # type: ignore[misc]
    return np.hstack([mean, covariance.reshape(len(mean), -1)])


def _some(found: object) -> np.ndarray:
    mean, covariance = found  # type: ignore[misc]
    return _moments((mean[::97].reshape(-1, 6), covariance[::97].reshape(-1, 6, 6)))


def _inside(window: int, y: object) -> np.ndarray:
    return np.asarray(y)[window:-window] if 2 * window < len(y) else np.asarray(y)  # type: ignore[arg-type]


def _itself(y: object) -> np.ndarray:
    return np.asarray(y)
