"""The running median as anyone would write it: cut the window out, sort it, take the middle."""

import numpy as np


def running_median(values, window, *, centred=True):
    """Medians of a series (n,); NaN is missing, windows end where the series does."""
    ahead = (window - 1) // 2 if centred else 0
    out = np.full(len(values), np.nan)
    for k in range(len(values)):
        inside = values[max(0, k + ahead - window + 1) : k + ahead + 1]
        known = np.sort(inside[~np.isnan(inside)])
        n = len(known)
        if n:
            out[k] = (known[(n - 1) // 2] + known[n // 2]) / 2
    return out
