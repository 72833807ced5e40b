"""Siegel's repeated median, all slopes in one table."""

import numpy as np


def repeated_median(values):
    """Level at the last sample and slope per sample of a series (n,); NaN is missing."""
    at = np.arange(len(values)) - (len(values) - 1.0)
    known = ~np.isnan(values)
    at, y = at[known], values[known]
    if not len(y):
        return np.nan, np.nan
    inner = [
        np.median([(y[j] - y[i]) / (at[j] - at[i]) for j in range(len(y)) if j != i] or [0.0])
        for i in range(len(y))
    ]
    slope = np.median(inner)
    return np.median(y - slope * at), slope
