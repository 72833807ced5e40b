"""The multi-hypothesis filter by brute force: every account of a short series by least squares.

An account says of every observation whether it belongs to the track, is wrong by itself, or is of
a run with a common offset, that a manoeuvre came before it, or that the track begins anew.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from reference.account import (
    Account,
    agility,
    belied,
    cauchy,
    moments,
    normal,
    put,
    reach,
    slipped,
    told,
    wrap,
)

POOR = 4.0  # variances of a poor observation
GROSS = 36.0
STRANGE = 16.0
CONFIRMED = 3
ROW = 2  # wrong fixes on end after which the next is likely to be wrong
PREFERS = 3.0
PATIENCE, AIDED = 1.25, 5.0
ANEW = 0.1
HASTE = 2.0


class Mixture(NamedTuple):
    """What all accounts say together of one epoch: mean, sigma (states,) and the log-evidence."""

    mean: np.ndarray
    sigma: np.ndarray
    evidence: float
    accounts: list


def enumerate_accounts(motion, prior, epochs, far=np.inf, alike=0.0, first=None):
    """Follow every account; ``first`` is what is supposed of the first epoch, if something else.

    Accounts more than ``far`` nats below the best of a step are dropped; those whose positions and
    velocities differ by less than ``alike``, squared and in standard deviations, become one. Gives
    one `Mixture` per epoch. Equal times and several sensors are understood; weights and jumps that
    are fixed beforehand are not.
    """
    d, none = motion.axes, ((),) * motion.axes
    empty = Account(0.0, none, (0,) * d, none, (None,) * d, (False,) * d, slip=((0.0, 0.0),) * d)
    empty = empty._replace(
        lost=((np.nan, 0),) * d,
        rate=((0, prior.sigma_velocity),) * d,
        turns=none,
        touched=(-1,) * d,
    )
    accounts, out, steps = [empty], [], []
    later = prior
    for k, time in enumerate(epochs.time):
        prior = first if first is not None and k == 0 else later
        if not k or time > epochs.time[k - 1]:
            steps.append(time)
        z, r = epochs.z[k], epochs.variance[k]
        sensor = epochs.sensor[k] if len(epochs.sensor) else 0
        accounts = [account._replace(said=(*account.said, "")) for account in accounts]
        evidence = 0.0
        for branches, part in ((_velocity, slice(d, 2 * d)), (_position, slice(0, d))):
            if np.isnan(z[part]).all():
                continue
            many = []
            for account in accounts:
                known = [moments(motion, prior, steps, account, a) for a in range(d)]
                many += branches(motion, prior, account, known, z, r, time, sensor, steps)
            accounts, gain = _kept(many, far)
            evidence += gain
        accounts = [_lasting(prior, account, time) for account in accounts]
        now = {(sensor, a): time for a in range(d) if not np.isnan(z[d + a])}
        accounts = [account._replace(heard=account.heard | now) for account in accounts]
        if alike > 0.0:
            accounts = _united(motion, prior, steps, accounts, alike)
        out.append(_mixture(motion, prior, steps, accounts, evidence))
    return out


def _kept(accounts, far):
    """The likeliest first, normalised, without those far below; and the sum over all of them."""
    scores = np.array([account.weight for account in accounts])
    kept = scores >= scores.max() - far
    norm = logsumexp(scores[kept])
    order = [i for i in np.argsort(-scores, kind="stable") if kept[i]]
    best = [accounts[i]._replace(weight=accounts[i].weight - norm) for i in order]
    return best, logsumexp(scores)


def _united(motion, prior, steps, accounts, alike):
    """Let each account join the first one before it that says the same."""
    d, out = motion.axes, []
    for account in accounts:
        known = [moments(motion, prior, steps, account, a) for a in range(d)]
        shown = [(a, s) for a in range(d) for s in range(2) if s or account.seen[a]]
        figures = [(known[a][0][s], known[a][1][s, s]) for a, s in shown]
        offsets = [(m[-1], P[-1, -1]) for m, P in known if P[-1, -1] > 0.0]
        since = account.opened if account.run >= 0 else None
        key = (account.seen, account.run, since, account.faulty)
        for i, (other, *before) in enumerate(out):
            if before[0] == key and _same(*before[1:], figures, offsets, alike):
                both = np.logaddexp(other.weight, account.weight)
                out[i] = (other._replace(weight=both), *before)
                break
        else:
            out.append((account, key, figures, offsets))
    return [each[0] for each in out]


def _same(figures, offsets, others, their_offsets, alike):
    """Whether all means are near each other, and the variances of the states."""
    if len(offsets) != len(their_offsets):
        return False
    m, P = np.array([*figures, *offsets]).T
    other, spread = np.array([*others, *their_offsets]).T
    ratio = (spread / P)[: len(figures)]
    return ((other - m) ** 2 / P).sum() <= alike and (np.abs(ratio - 1.0) <= 0.05).all()


def _velocity(motion, prior, account, known, z, r, time, sensor, steps):
    """Belongs, usual or poor, or is wrong."""
    d, step = motion.axes, len(steps) - 1
    seen = [a for a in range(d) if not np.isnan(z[d + a])]
    nu = {a: z[d + a] - known[a][0][1] for a in seen}
    S = {a: known[a][1][1, 1] + r[d + a] for a in seen}
    usual = sum(normal(nu[a], S[a]) for a in seen) + np.log(1.0 - prior.poor)
    poor = sum(normal(nu[a], S[a] + (POOR - 1.0) * r[d + a]) for a in seen) + np.log(prior.poor)
    wide = np.array([prior.spread[d + a] ** 2 + S[a] for a in seen])
    outside = cauchy(np.array([nu[a] for a in seen]) ** 2 / wide, wide)
    wrong, same = prior.velocity, False
    level = {a: slipped(motion, account, known, a, time, sensor) for a in seen}
    if sensor in account.faulty:
        wrong = prior.again
        off = {a: z[d + a] - level[a][0] for a in seen}
        change = {a: level[a][1] + r[d + a] for a in seen}
        alike = sum(normal(off[a], change[a]) for a in seen) + np.log(prior.alike)
        same = sum(off[a] ** 2 / change[a] for a in seen) < GROSS
        outside = np.logaddexp(outside + np.log(1.0 - prior.alike), alike)
    rows, slip = account.rows, account.slip
    for a in seen:
        variance = r[d + a] * (POOR if poor > usual else 1.0)
        rows = put(rows, a, (*rows[a], (step, 1, (), z[d + a], variance)))
        mean, total = level[a] if same else (z[d + a], np.inf)
        gain = 1.0 / (1.0 + r[d + a] / total)
        slip = put(slip, a, (mean + gain * (z[d + a] - mean), gain * r[d + a]))
    for a in set(range(d)) - set(seen) if not same else ():
        slip = put(slip, a, (known[a][0][1], known[a][1][1, 1] + prior.spread[d + a] ** 2))
    gain = np.logaddexp(usual, poor) + np.log(1.0 - wrong)
    faulty, touched = account.faulty, account.touched
    for a in seen:
        touched = put(touched, a, step)
    out = [
        told(
            account, gain, "moves", rows=rows, faulty=faulty - {sensor}, touched=touched, moved=time
        ),
        told(account, outside + np.log(wrong), "slips", faulty=faulty | {sensor}, slip=slip),
    ]
    gaps = {a: _gap(account, steps, time, a) for a in seen}
    strange = sum(nu[a] ** 2 / S[a] for a in seen) > STRANGE
    if not strange or not max(gaps.values()) > 0.0 or not prior.manoeuvre > 0.0:
        return out
    far = {a: reach(motion.order, 1, gaps[a]) for a in seen}
    free = np.array([(far[a] * agility(motion, a, gaps[a])) ** 2 + S[a] for a in seen])
    gain = cauchy(np.array([nu[a] for a in seen]) ** 2 / free, free)
    gain += np.log(prior.manoeuvre) + np.log(1.0 - wrong)
    rows, turns = account.rows, account.turns
    for a in seen:
        rows = put(rows, a, (*rows[a], (step, 1, (), z[d + a], r[d + a])))
        if gaps[a] > 0.0:
            speed = max(agility(motion, a, gaps[a]), HASTE * abs(nu[a]) / far[a])
            turns = put(turns, a, (*turns[a], (account.touched[a], speed)))
    faulty = faulty - {sensor}
    return [
        *out,
        told(
            account,
            gain,
            "turns",
            rows=rows,
            faulty=faulty,
            turns=turns,
            touched=touched,
            moved=time,
        ),
    ]


def _use(account, z, variance, time, step, axes, period, known, *, running=False):
    """Take the positions of some axes into the account; the others are left out."""
    rows, seen, lost = account.rows, account.seen, account.lost
    for a in np.flatnonzero(~np.isnan(z[: len(seen)])):
        since, count = lost[a]
        out = running or a not in axes
        lost = put(lost, a, (since if count else time, count + 1) if out else (np.nan, 0))
    for a in axes:
        offsets = account.lasting[a]
        if running and account.open[a] is not None:
            offsets = (*offsets, account.open[a])
        value = z[a]
        if seen[a]:  # the turn that lies nearest
            centre = known[a][0][0] + (known[a][0][-1] if running else 0.0)
            value = centre + wrap(z[a] - centre, period)
        rows = put(rows, a, (*rows[a], (step, 0, offsets, value, variance[a])))
        seen = put(seen, a, True)
    new = any(seen) and np.isnan(account.began)
    began = time if new else account.began
    touched = account.touched
    for a in axes:
        touched = put(touched, a, step)
    return account._replace(rows=rows, seen=seen, lost=lost, began=began, touched=touched)


def _position(motion, prior, account, known, z, r, time, sensor, steps):
    step = len(steps) - 1
    d, period = motion.axes, motion.period
    axes = [a for a in range(d) if not np.isnan(z[a])]
    inside, poor, square, wide, distance, shifted = {}, 0.0, {}, {}, 0.0, 0.0
    small = all(account.seen[a] for a in axes)
    for a in axes:
        m, P = known[a]
        if not account.seen[a]:
            square[a], wide[a] = 1.0, prior.spread[a] ** 2 + r[a]
            inside[a] = cauchy(np.ones(1), np.array([wide[a]]))
            continue
        nu, S = wrap(z[a] - m[0], period), P[0, 0] + r[a]
        small = small and nu**2 + P[0, 0] < GROSS * r[a]
        inside[a] = normal(nu, S)
        poor += normal(nu, S + (POOR - 1.0) * r[a])
        distance += nu**2 / S
        wide[a] = prior.spread[a] ** 2 + S
        square[a] = nu**2 / wide[a]
        h = np.eye(len(m))[0] + np.eye(len(m))[-1]
        shifted += normal(wrap(z[a] - h @ m, period), h @ P @ h + r[a])
    unknown = not all(account.seen[a] for a in axes)
    belongs = sum(inside.values())
    own, running = account.run == sensor, account.run >= 0

    def wild(some):
        return cauchy(np.array([square[a] for a in some]), np.array([wide[a] for a in some]))

    def used(base, some, variance=r, **how):
        return _use(base, z, variance, time, step, some, period, known, **how)

    over = {"run": -1, "open": (None,) * d}
    wrong = prior.row if not running and account.lost[axes[0]][1] >= ROW else prior.isolated
    rare = np.log(prior.small) if small else 0.0
    out = [told(used(account, []), wild(axes) + np.log(wrong) + rare, "isolated")]
    right = np.log(1.0 - wrong) - np.log(1.0 - prior.isolated)
    account = account._replace(weight=account.weight + right)
    if own:
        ended = used(account._replace(**over), axes)
        out.append(told(ended, belongs + np.log(prior.ending), "drop"))
        if not unknown:
            gain = shifted + np.log(1.0 - prior.isolated - prior.ending)
            more = used(account, axes, running=True)._replace(length=account.length + 1)
            out.append(told(more, gain, "continue"))
    else:
        usual, noisy = belongs + np.log(1.0 - prior.poor), poor + np.log(prior.poor)
        gain = belongs if unknown else np.logaddexp(usual, noisy)
        gain += np.log(1.0 - prior.isolated - prior.partial - prior.burst)
        is_poor = noisy > usual and not unknown
        good = used(account, axes, POOR * r if is_poor else r)
        if running and not unknown and belongs - shifted > PREFERS:
            good = good._replace(opened=time)  # the run is not a jump, up to now
        out.append(told(good, gain, "poor" if is_poor else "belongs"))
        out += _partial(prior, account, axes, inside, wild, used)
        confirmed = running and not unknown and account.length >= CONFIRMED
        if confirmed and shifted - belongs > PREFERS:
            out.append(told(used(_jumped(account), axes), shifted + np.log(prior.burst), "commit"))
    if distance > GROSS and not unknown and (own or not running):
        new, offsets = (None,) * d, account.offsets
        for a in axes:
            new = put(new, a, offsets[a])
            offsets = put(offsets, a, offsets[a] + 1)
        begun = account._replace(open=new, offsets=offsets, run=sensor, opened=time, length=1)
        known = [(np.append(m[:-1], 0.0), P) for m, P in known]
        begun = _use(begun, z, r, time, step, axes, period, known, running=True)
        out.append(told(begun, wild(axes) + np.log(prior.burst), "open"))
    gaps = {a: _gap(account, steps, time, a) for a in axes}
    strange = distance > STRANGE and not unknown
    if strange and max(gaps.values()) > 0.0 and not own and prior.manoeuvre > 0.0:
        far = {a: reach(motion.order, 0, gaps[a]) for a in axes}
        S = {a: known[a][1][0, 0] + r[a] for a in axes}
        free = np.array([(far[a] * agility(motion, a, gaps[a])) ** 2 + S[a] for a in axes])
        off = {a: wrap(z[a] - known[a][0][0], period) for a in axes}
        gain = cauchy(np.array([off[a] for a in axes]) ** 2 / free, free) + np.log(prior.manoeuvre)
        gain += belied(motion, prior, account, known, z, gaps, off, time, sensor)
        turns = account.turns
        for a in axes:
            if gaps[a] > 0.0:
                speed = max(agility(motion, a, gaps[a]), HASTE * abs(off[a]) / far[a])
                turns = put(turns, a, (*turns[a], (account.touched[a], speed)))
        out.append(told(used(account._replace(turns=turns), axes), gain, "turns"))
    due = [a for a in axes if account.seen[a] and _due(prior, account, a, time)]
    if due and (due == axes or not own):
        fresh = account
        for a in due:
            far = abs(wrap(z[a] - known[a][0][0], period)) / (time - account.lost[a][0])
            fresh = _forgotten(fresh, a, step, max(prior.sigma_velocity, HASTE * far))
        gain = np.log(ANEW) + sum(inside[a] for a in axes if a not in due)
        gain += sum(cauchy(np.ones(1), np.array([prior.spread[a] ** 2 + r[a]])) for a in due)
        fresh = used(fresh._replace(**over, began=time), axes)
        out.append(told(fresh, gain, "anew"))
    return out


def _gap(account, steps, time, a):
    """Seconds since an observation of the axis was last used."""
    return time - steps[account.touched[a]] if account.touched[a] >= 0 else 0.0


def _due(prior, account, a, time):
    """Whether an axis has been left out for so long that its track may begin anew."""
    since, count = account.lost[a]
    patience = AIDED if account.moved > since else PATIENCE
    return count >= CONFIRMED and time - since >= patience * prior.longest


def _forgotten(account, a, step, speed):
    """Nothing is known of an axis but that its rates are about nought."""
    return account._replace(
        rows=put(account.rows, a, ()),
        offsets=put(account.offsets, a, 0),
        lasting=put(account.lasting, a, ()),
        seen=put(account.seen, a, False),
        rate=put(account.rate, a, (step, speed)),
        turns=put(account.turns, a, ()),
    )


def _partial(prior, account, axes, inside, wild, used):
    """One axis of several is wrong, or both horizontal ones of three."""
    if len(axes) < 2:
        return []
    share = np.log(prior.partial / (len(axes) + 1))
    wrong = [(a,) for a in axes] + ([(0, 1)] if len(axes) == 3 else [])
    out = []
    for some in wrong:
        rest = [a for a in axes if a not in some]
        gain = share + sum(inside[a] for a in rest) + wild(some)
        out.append(told(used(account, rest), gain, "off" + "".join("xyz"[a] for a in some)))
    return out


def _jumped(account):
    """The offset of the present run lasts."""
    pairs = zip(account.lasting, account.open, strict=True)
    lasting = tuple(old if new is None else (*old, new) for old, new in pairs)
    nothing = (None,) * len(lasting)
    found = ((np.nan, 0),) * len(lasting)
    return account._replace(lasting=lasting, open=nothing, run=-1, began=account.opened, lost=found)


def _lasting(prior, account, time):
    """A run that lasts too long, or longer than the track before it, is a jump."""
    if account.run < 0 or account.length < CONFIRMED:
        return account
    if time - account.opened < min(prior.longest, account.opened - account.began):
        return account
    return told(_jumped(account), 0.0, "lasting")


def _mixture(motion, prior, steps, accounts, evidence):
    """Moments of the mixture; a position only by those accounts that know one."""
    d, order = motion.axes, motion.order
    whole = accounts
    likeliest = max(accounts, key=lambda account: account.weight)
    accounts = [each for each in accounts if each is likeliest or "turns" not in each.said[-1]]
    mean, sigma = np.full(order * d, np.nan), np.full(order * d, np.nan)
    for a in range(d):
        known = [moments(motion, prior, steps, account, a) for account in accounts]
        weight = np.exp([account.weight for account in accounts])
        aware = np.array([account.seen[a] for account in accounts])
        for s in range(order):
            w = weight * aware if s == 0 else weight
            if not w.any():
                continue
            w = w / w.sum()
            m, P = np.array([(each[0][s], each[1][s, s]) for each in known]).T
            centre = m[np.argmax(w)]
            gap = wrap(m - centre, motion.period) if s == 0 else m - centre
            mean[s * d + a] = centre + w @ gap
            sigma[s * d + a] = np.sqrt(w @ P + w @ gap**2 - (w @ gap) ** 2)
    return Mixture(mean, sigma, evidence, whole)
