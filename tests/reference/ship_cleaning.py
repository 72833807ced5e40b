"""The cleaners of paper 003 as a textbook has them: sorts and fits, window by window."""

import numpy as np


def median(x):
    known = np.sort(x[~np.isnan(x)])
    return (known[(len(known) - 1) // 2] + known[len(known) // 2]) / 2 if len(known) else np.nan


def running(x, size):
    half = size // 2
    out = np.full(len(x), np.nan)
    for i in range(half, len(x) - half):
        out[i] = median(x[i - half : i + half + 1])
    return out


def x3(x):
    """Steps 1 to 3 of the paper; NaN where the window leaves the series."""
    out = np.full(len(x), np.nan)
    inner = np.full(len(x), np.nan)
    inner[2 : len(x) - 2] = running(x, 5)[2 : len(x) - 2]
    second = np.full(len(x), np.nan)
    for i in range(3, len(x) - 3):
        second[i] = median(inner[i - 1 : i + 2])
    for i in range(4, len(x) - 4):
        out[i] = second[i - 1] / 4 + second[i] / 2 + second[i + 1] / 4
    return out


def improved_x3(x):
    """Steps 5 and 6 with the indices that the paper prints, from 1; at least 20 samples."""
    n = len(x)
    turned = x.copy()
    turned[:8] = x[:8][::-1]
    turned[n - 8 :] = x[n - 8 :][::-1]
    out, again = x3(x), x3(turned)
    for to, source in zip((4, 3, 2, 1), (5, 6, 7, 8), strict=True):
        out[to - 1] = again[source - 1]
    for to, source in zip((n, n - 1, n - 2, n - 3), (n - 7, n - 6, n - 5, n - 4), strict=True):
        out[to - 1] = again[source - 1]
    return out


def replaced(x, estimate, threshold):
    return np.array(
        [e if abs(v - e) > t else v for v, e, t in zip(x, estimate, threshold, strict=True)]
    )


def hampel(x, before, after, n_sigma, floor=0.0):
    out = np.array(x)
    for k in range(len(x)):
        if np.isnan(x[k]):
            continue
        window = x[max(k - before, 0) : k + after + 1]
        middle = median(window)
        spread = 1.482602218505602 * median(np.abs(window - middle))
        if abs(x[k] - middle) > n_sigma * max(spread, floor):
            out[k] = middle
    return out


def polynomial(x, weight, degree):
    """A weighted fit of each window by numpy, in powers of the sample number."""
    n, size = len(x), len(weight)
    out = np.array(x)
    for k in range(n):
        first = min(max(k - size // 2, 0), max(n - size, 0))
        at = np.arange(first, min(first + size, n))
        known = at[~np.isnan(x[at])]
        if np.isnan(x[k]):
            continue
        root = np.sqrt(weight[known - first])
        powers = np.vander(known - float(k), min(degree + 1, len(known)), increasing=True)
        solution, *_ = np.linalg.lstsq(powers * root[:, None], x[known] * root, rcond=None)
        out[k] = solution[0]
    return out


def lagrange(x, t, threshold, points, patience):
    """The prediction as a polynomial through the last samples, fitted exactly."""
    out = np.array(x)
    past, doubted, missing = [], 0, 0
    for k, (value, at) in enumerate(zip(x, t, strict=True)):
        if np.isnan(value):
            missing += 1
            continue
        if missing > patience or doubted >= patience:
            past = []
        missing, used = 0, value
        if len(past) == points:
            times, values = np.array(past).T
            powers = np.vander(times - at, points, increasing=True)
            predicted = np.linalg.solve(powers, values)[0]
            if abs(value - predicted) > threshold[k]:
                used = out[k] = predicted
            past = past[1:]
        doubted = doubted + 1 if used != value else 0
        past.append((at, used))
    return out


def inverse_variance(values, sigmas):
    """Weighted mean and σ by the normal equations of a constant."""
    design = np.ones((len(values), 1))
    information = design.T @ np.diag(1.0 / np.square(sigmas)) @ design
    right = design.T @ np.diag(1.0 / np.square(sigmas)) @ np.asarray(values)
    mean = np.linalg.solve(information, right)
    return float(mean[0]), float(np.sqrt(np.linalg.inv(information)[0, 0]))
