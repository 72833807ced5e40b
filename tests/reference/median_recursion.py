"""The median recursion with sorted lists, one sample at a time, for one axis.

As `surefix.filters.median_recursion` describes it: every median is taken anew over a slice of the
whole past.
"""

import numpy as np

from reference.repeated_median import repeated_median

SCALE = 1.4826022185056018


def median(values):
    """Middle of the sorted known values, NaN where there is none."""
    known = sorted(v for v in values if not np.isnan(v))
    n = len(known)
    return (known[(n - 1) // 2] + known[n // 2]) / 2 if n else np.nan


def recursion(y, form, order, window, lag, gain, gate, longest, floor=0.0):
    """Estimates, scales and what was used (True, False, None where missing), and restarts.

    ``longest`` 0 never restarts. Lists grow; windows are their ends.
    """
    feedback = form == "feedback"
    raw, clean, sizes = [], [], []
    estimates, scales, used, restarts = [], [], [], []
    run, since, x = 0, 0, np.nan

    def scale():
        return max(SCALE * median(sizes[-window:]), floor)

    def begin(count):
        """Line through the last samples, and the windows as it leaves them."""
        level, slope = repeated_median(np.array(raw[-count:]))
        line = [level + slope * (k - window + 1) for k in range(window)]
        recent = ([np.nan] * window + raw)[-window:]
        off = [abs(v - w) for v, w in zip(recent, line, strict=True)]
        off[: window - count] = [np.nan] * (window - count)
        sizes[:] = off
        near = [e <= gate * scale() for e in off]
        if feedback:
            sizes[:] = [e if good else np.nan for e, good in zip(off, near, strict=True)]
            kept = [v if good else w for v, w, good in zip(recent, line, near, strict=True)]
        else:
            kept = recent
        clean[:] = kept
        return level, off

    for value in y:
        if not raw and np.isnan(value):
            estimates.append(np.nan)
            scales.append(np.nan)
            used.append(None)
            continue
        raw.append(value)
        if len(raw) <= window:
            x, off = begin(len(raw))
            if len(raw) < window:
                sizes[:] = off
            used.append(None if np.isnan(value) else True)
        else:
            if form == "repeated-median":
                rate = repeated_median(np.array(raw[-window:-1]))[1]
            else:
                past = clean[-window:]
                first = [b - a for a, b in zip(past[:-lag], past[lag:], strict=True)]
                rate = median(first) / lag
                if order == 3:
                    second = [b - a for a, b in zip(first[:-lag], first[lag:], strict=True)]
                    bent = median(second)
                    rate += 0.0 if np.isnan(bent) else 0.5 * window * bent / lag**2
                rate = 0.0 if np.isnan(rate) else rate
            predicted = x + rate
            missing = np.isnan(value)
            good = bool(abs(value - predicted) <= gate * scale())
            x = predicted + gain * (value - predicted) if good else predicted
            if not missing and (good or not feedback):
                sizes.append(abs(value - predicted))
            clean.append(value if good or not feedback else predicted)
            used.append(None if missing else good)
            if good:
                run = since = 0
            elif run or not missing:
                run, since = run + (not missing), since + 1
            if longest and run > longest:
                x = begin(min(since, window))[0]
                run = since = 0
                restarts.append(len(estimates))
        estimates.append(x)
        scales.append(scale())
    return np.array(estimates), np.array(scales), used, restarts
