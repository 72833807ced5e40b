"""The Kalman filter of any linear model over whole series: one, or many at once, or step by step.

For models that `surefix.filters.track` does not know: any F, Q and H, which may change from epoch
to epoch, and correlated observations. The state is carried as a covariance, and by Joseph's form
where digits would be lost (`surefix.filters.linear_step`): of the 16 digits those remain by which
the variances of the states do not differ. Beyond 10¹² take the steps in square-root form of
`surefix.filters.kalman`, which keep half of the rest.

A constant velocity seen with noise, in a series and as a stream:

>>> F, Q = [[1.0, 1.0], [0.0, 1.0]], [[0.003, 0.005], [0.005, 0.01]]
>>> from surefix.filters.kalman import gaussian
>>> begin, z = gaussian([0.0, 0.0], np.diag([1.0, 4.0])), np.array([[1.2], [np.nan], [2.9]])
>>> filter_linear(begin, z, F, Q, [[1.0, 0.0]], [[0.25]]).mean.round(3).tolist()
[[1.143, 0.915], [2.058, 0.915], [2.904, 0.885]]
>>> model, state = stream_model(F, Q, [[1.0, 0.0]], [[0.25]]), stacked(begin)
>>> for row in z:
...     state, seen = advance(model, state, row)
>>> state[0].round(3).tolist()
[2.904, 0.885]
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from surefix.errors import OptionsError
from surefix.filters.kalman import Gaussian, Spread
from surefix.filters.linear_parts import LinearModel
from surefix.filters.linear_step import follow, run, step
from surefix.robust.loss import Loss, loss_named
from surefix.rows import Size, size_of
from surefix.types import FloatArray

__all__ = [
    "LinearTrack",
    "StreamModel",
    "advance",
    "filter_linear",
    "linear_model",
    "stacked",
    "stream_model",
]

_SLICES = 4  # pieces of work a core, so that none waits for another
_TOGETHER = 64  # series in a piece of those that share: their epochs stay in the nearest cache
_ALIKE = 1e-9  # relative difference of what is called symmetric
_EXTREME = 1e-9  # of the largest variance: how far below 0 rounding may bring an eigenvalue


class LinearTrack(NamedTuple):
    """What the filter found at each of N epochs; of T series all fields are (T, N, …).

    Series that share their covariances (see `filter_linear`) have one array of covariances and one
    of weights, seen T times; these are read-only.

    Parameters
    ----------
    mean, covariance
        (N, n) and (N, n, n) after the update.
    residual
        (N, m) ``z − H x⁻``; NaN where not observed.
    nis
        (N, m) squared innovations over their variance.
    weight
        (N, m) weight the loss gave; NaN where not observed.
    """

    mean: FloatArray
    covariance: FloatArray
    residual: FloatArray
    nis: FloatArray
    weight: FloatArray


class StreamModel(NamedTuple):
    """A linear model and its loss, packed for `advance`."""

    packed: FloatArray
    states: Size
    components: Size


def filter_linear(
    x: Gaussian,
    z: ArrayLike,
    F: ArrayLike,
    Q: ArrayLike,
    H: ArrayLike,
    R: ArrayLike,
    loss: Loss | None = None,
    spread: Spread = "innovation",
) -> LinearTrack:
    """Predict and update at every epoch, weighing each component by itself.

    The same as calling `surefix.filters.kalman.predict` and `surefix.filters.kalman.update` in
    turn, at the speed of compiled code. Many series of one model run on all cores. Where nothing
    is weighed, and all begin with one covariance and have the same gaps, all covariances are the
    same: they are computed once. Each series has the figures that it has by itself, but for the
    rounding of the last bit.

    Parameters
    ----------
    x
        State of size n one step before the first epoch; of T series (n,) and (n, n) for all, or
        (T, n) and (T, n, n).
    z
        (N, m) observations, or (T, N, m) for T series; what is not finite is missing.
    F, Q, H, R
        (n, n), (n, n), (m, n) and (m, m), or a leading N for one each epoch: F and Q lead to it.
    loss, spread
        As for `surefix.filters.kalman.update`.

    Raises
    ------
    OptionsError
        Q or R is no covariance, the shapes do not agree, or the loss is Student-t.
    """
    seen = np.ascontiguousarray(z, dtype=np.float64)
    if seen.ndim not in {2, 3}:
        raise OptionsError(f"z of shape {seen.shape}", "(N, m), or (T, N, m) for T series")
    *series, N, m = seen.shape
    n = x.mean.shape[-1]
    if spread not in get_args(Spread):
        raise OptionsError(f"spread {spread!r}", "one of " + ", ".join(get_args(Spread)))
    if x.mean.shape not in {(n,), (*series, n)} or x.factor.shape != (*x.mean.shape, n):
        raise OptionsError(
            f"a state of shapes {x.mean.shape} and {x.factor.shape}",
            f"({n},) and ({n}, {n}), with a leading {tuple(series)} or not",
        )
    model, usable = linear_model(F, Q, H, R, (n, m, N)), _usable(loss)
    T = series[0] if series else 1
    start, first, rows = (
        np.ascontiguousarray(np.broadcast_to(x.mean, (*series, n)), np.float64).reshape(T, 1, n),
        np.ascontiguousarray(np.broadcast_to(x.covariance, (*series, n, n))).reshape(T, n, n),
        seen.reshape(T, N, m),
    )
    own = 1 if usable.code == 0 and _alike(start, first, rows) else T
    mean, residual, nis = np.empty((T, N, n)), np.empty((T, N, m)), np.empty((T, N, m))
    covariance, weights = np.empty((own, N * n, n)), np.empty((own, N, m))

    def alone(some: slice) -> None:
        arrays = (start, first, rows, mean, covariance, residual, nis, weights)
        run(model, usable, spread == "noise", *(each[some] for each in arrays))

    def sharing(some: slice) -> None:
        arrays = (start, rows, mean, residual, nis)
        parts = (each[some].reshape(-1, each.shape[2]) for each in arrays)
        follow(model, usable, covariance[0], first[0], *parts)

    _on_all_cores(range(own), alone)
    if own < T:
        _on_all_cores(range(own, T), sharing, _TOGETHER)
    found = mean, covariance.reshape(own, N, n, n), residual, nis, weights
    return LinearTrack(*(_seen_by(each, tuple(series)) for each in found))


def _alike(start: FloatArray, first: FloatArray, z: FloatArray) -> bool:
    """Whether several series without weights have the same covariances."""
    if len(z) < 2 or not np.isfinite(start).all() or not (first == first[:1]).all():
        return False
    return bool((np.isfinite(z) == np.isfinite(z[:1])).all())


def _seen_by(found: FloatArray, series: tuple[int, ...]) -> FloatArray:
    """What each series found, or the first for all of them."""
    if not series:
        alone: FloatArray = found[0]
        return alone
    return found if len(found) == series[0] else np.broadcast_to(found, (*series, *found.shape[1:]))


def _on_all_cores(which: range, work: Callable[[slice], None], most: int | None = None) -> None:
    """Do work in slices, of ``most`` or so where that is said, on as many threads as cores."""
    cores = min(os.cpu_count() or 1, len(which))
    if cores < 2 and most is None:
        work(slice(which.start, which.stop))
        return
    count = max(_SLICES * cores, len(which) // (most or len(which)))
    ends = np.linspace(which.start, which.stop, min(count, len(which)) + 1).astype(np.int64)
    with ThreadPoolExecutor(cores) as pool:
        list(pool.map(work, (slice(a, b) for a, b in itertools.pairwise(ends.tolist()))))


def stream_model(
    F: ArrayLike, Q: ArrayLike, H: ArrayLike, R: ArrayLike, loss: Loss | None = None
) -> StreamModel:
    """Check a linear model of constant matrices and pack it for `advance`.

    Parameters
    ----------
    F, Q, H, R, loss
        As for `filter_linear`.

    Raises
    ------
    OptionsError
        As `filter_linear`.
    """
    m, n = np.shape(H) if np.ndim(H) == 2 else (0, 0)
    model, loss = linear_model(F, Q, H, R, (n, m, 1)), _usable(loss)
    parts = [np.ravel(each) for each in model[:6]]
    return StreamModel(
        np.concatenate([*parts, [loss.code, loss.k0, loss.k1]]), model.states, model.components
    )


def stacked(x: Gaussian) -> FloatArray:
    """Mean (n,) on top of covariance (n, n), as `advance` takes and gives them: (n + 1, n)."""
    return np.concatenate((x.mean[None], x.covariance))


def advance(model: StreamModel, state: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Predict and update once, for streams; the same numbers as `filter_linear` to the last bit.

    Parameters
    ----------
    model
        From `stream_model`.
    state
        (n + 1, n) the mean on top of the covariance, from `stacked` or the epoch before.
    z
        (m,) float64 observation; NaN is missing.

    Returns
    -------
    state, seen
        (n + 1, n), and (3, m): residuals, squared innovations over their variance, weights.
    """
    packed, states, components = model
    after, seen = np.empty(state.shape), np.empty((3, len(z)))
    step(packed, states, components, state, z, after, seen)
    return after, seen


def _usable(loss: Loss | None) -> Loss:
    loss = loss or loss_named("kalman")
    if loss.code == 6:
        raise OptionsError("loss 'student-t'", "a loss of the innovation", "use huber or igg3")
    return loss


def linear_model(
    F: ArrayLike, Q: ArrayLike, H: ArrayLike, R: ArrayLike, sizes: tuple[int, int, int]
) -> LinearModel:
    """Check the matrices of a linear model and lay them out for the kernels.

    Parameters
    ----------
    F, Q, H, R
        As for `filter_linear`.
    sizes
        Numbers of states n, of components m, and of epochs N.

    Raises
    ------
    OptionsError
        Q or R is no covariance, or a shape does not agree.
    """
    n, m, N = sizes
    shapes = {"F": (n, n), "Q": (n, n), "H": (m, n), "R": (m, m)}
    stacks = []
    for given, (name, shape) in zip((F, Q, H, R), shapes.items(), strict=True):
        matrix = np.asarray(given, dtype=np.float64)
        if matrix.shape not in {shape, (N, *shape)}:
            raise OptionsError(f"{name} of shape {matrix.shape}", f"{shape} or {(N, *shape)}")
        stacks.append(np.ascontiguousarray(matrix.reshape(-1, *shape)))
    step_, noise, seen, error = stacks
    _check(noise, "Q", _EXTREME)
    _check(error, "R", 0.0)
    wanted = (step_, np.swapaxes(step_, 1, 2), noise, seen, np.swapaxes(seen, 1, 2), error)
    f, f_t, q, h, h_t, r = (
        np.ascontiguousarray(each).reshape(-1, each.shape[2]) for each in wanted
    )
    return LinearModel(f, f_t, q, h, h_t, r, size_of(n), size_of(m))


def _check(stack: FloatArray, name: str, tolerance: float) -> None:
    """Refuse what is not finite, symmetric and positive (semi-)definite."""
    turned = np.swapaxes(stack, -1, -2)
    if np.isfinite(stack).all() and (np.abs(stack - turned) <= _ALIKE * np.abs(turned)).all():
        if tolerance:
            largest = np.abs(np.einsum("kii->ki", stack)).max(axis=1, initial=0.0)
            slack = tolerance * np.where(largest > 0.0, largest, 1.0)
            stack = stack + slack[:, None, None] * np.eye(stack.shape[-1])
        try:
            np.linalg.cholesky(stack)
            return
        except np.linalg.LinAlgError:
            pass
    semi = "semi-" if tolerance else ""
    raise OptionsError(name, f"finite, symmetric, positive {semi}definite covariances")
