"""The multi-hypothesis filter by brute force: every account of a short series by least squares.

An account says of every observation whether it belongs to the track, is wrong by itself, or is of
a run with a common offset. Given the account all is linear and normal: the states of all epochs and
the offsets of all runs are one joint vector, of which motion and observations give the information
matrix. Positions at the beginning and offsets have no prior information at all. Axes are apart.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import gammaln, logsumexp

from surefix.models.motion import noise_factor, transition

NAMES = {2: "cv", 3: "ca"}
POOR = 4.0  # variances of a poor observation
GROSS = 36.0
STRANGE = 16.0
CONFIRMED = 3
PREFERS = 3.0
ALIKE = 0.7
PATIENCE, AIDED = 1.25, 5.0
ANEW = 0.1
HASTE = 2.0


class Account(NamedTuple):
    """One way it may have been.

    Per axis: ``rows`` the used observations (step, component, offsets, value, variance),
    ``offsets`` how many there are, ``lasting`` those that became jumps, ``open`` that of the run.
    ``lost`` is when fixes began to be left out and how many were; ``rate`` what a velocity had been
    before anything was seen; ``turns`` after which steps it changed at once, and by how much.
    ``said`` is a word or two per epoch.
    """

    weight: float
    rows: tuple
    offsets: tuple
    lasting: tuple
    open: tuple
    seen: tuple
    began: float = np.nan
    run: int = -1
    opened: float = np.nan
    length: int = 0
    faulty: frozenset = frozenset()
    slip: tuple = ()
    lost: tuple = ()
    rate: tuple = ()
    turns: tuple = ()
    touched: int = -1
    moved: float = np.nan
    said: tuple = ()


class Mixture(NamedTuple):
    """What all accounts say together of one epoch: mean, sigma (states,) and the log-evidence."""

    mean: np.ndarray
    sigma: np.ndarray
    evidence: float
    accounts: list


def normal(nu, S):
    """Log-density of a normal innovation."""
    return -0.5 * (nu**2 / S + np.log(2.0 * np.pi * S))


def cauchy(squares, scales):
    """Log-density of a multivariate Cauchy: Student's t of one degree of freedom."""
    d = len(squares)
    constant = gammaln(0.5 * (1 + d)) - gammaln(0.5) - 0.5 * d * np.log(np.pi)
    return constant - 0.5 * np.sum(np.log(scales)) - 0.5 * (1 + d) * np.log1p(np.sum(squares))


def enumerate_accounts(motion, prior, epochs, far=np.inf, alike=0.0, first=None):
    """Follow every account; ``first`` is what is supposed of the first epoch, if something else.

    Accounts more than ``far`` nats below the best of a step are dropped; those whose positions and
    velocities differ by less than ``alike``, squared and in standard deviations, become one. Gives
    one `Mixture` per epoch. Equal times and several sensors are understood; weights and jumps that
    are fixed beforehand are not.
    """
    d, none = motion.axes, ((),) * motion.axes
    empty = Account(0.0, none, (0,) * d, none, (None,) * d, (False,) * d, slip=(0.0,) * d)
    empty = empty._replace(
        lost=((np.nan, 0),) * d, rate=((0, prior.sigma_velocity),) * d, turns=none
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
                known = [_moments(motion, prior, steps, account, a) for a in range(d)]
                many += branches(motion, prior, account, known, z, r, time, sensor, steps)
            accounts, gain = _kept(many, far)
            evidence += gain
        accounts = [_lasting(prior, account, time) for account in accounts]
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
        known = [_moments(motion, prior, steps, account, a) for a in range(d)]
        told = [(a, s) for a in range(d) for s in range(2) if s or account.seen[a]]
        figures = [(known[a][0][s], known[a][1][s, s]) for a, s in told]
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


def _joint(motion, prior, steps, account, a):
    """Mean and covariance of the states of all steps and all offsets of one axis."""
    n, count = motion.order, len(steps)
    size = n * count + account.offsets[a]
    information, vector = np.zeros((size, size)), np.zeros(size)
    begun, speed = account.rate[a]
    first = n * begun + np.arange(1, n)
    information[first, first] = 1.0 / speed**2
    if not account.seen[a]:
        information[n * begun, n * begun] = 1.0  # anything: nothing that is asked for depends on it
    before = np.arange(n * begun)
    information[before, before] = 1.0  # likewise, of what was before the track began anew
    for k in range(begun + 1, count):
        dt = steps[k] - steps[k - 1]
        G = noise_factor(NAMES[n], 1, dt, motion.density[a])
        F = transition(NAMES[n], 1, dt)
        turn = F[:, n - 1] * sum(sigma for step, sigma in account.turns[a] if step == k - 1)
        Q = G @ G.T + np.outer(turn, turn)
        rows = np.hstack([-F, np.eye(n)])
        at = slice(n * (k - 1), n * (k + 1))
        information[at, at] += rows.T @ np.linalg.solve(Q, rows)
    for k, component, offsets, value, variance in account.rows[a]:
        h = np.zeros(size)
        h[n * k + component] = 1.0
        h[[n * count + b for b in offsets]] = 1.0
        information += np.outer(h, h) / variance
        vector += h * value / variance
    covariance = np.linalg.inv(information)
    return covariance @ vector, covariance


def _moments(motion, prior, steps, account, a):
    """Mean and covariance of [p, v, (a), b] at the last step; b is nought outside of runs."""
    n, count = motion.order, len(steps)
    mean, covariance = _joint(motion, prior, steps, account, a)
    T = np.zeros((n + 1, len(mean)))
    T[np.arange(n), n * (count - 1) + np.arange(n)] = 1.0
    T[0, [n * count + b for b in account.lasting[a]]] = 1.0
    if account.open[a] is not None:
        T[n, n * count + account.open[a]] = 1.0
    return T @ mean, T @ covariance @ T.T


def _wrap(nu, period):
    return (nu + 0.5 * period) % period - 0.5 * period if period > 0.0 else nu


def _told(account, gain, word, **changes):
    said = (*account.said[:-1], (account.said[-1] + " " + word).strip())
    return account._replace(weight=account.weight + gain, said=said, **changes)


def _set(values, a, value):
    return (*values[:a], value, *values[a + 1 :])


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
    wrong = prior.velocity
    if sensor in account.faulty:
        wrong = prior.again
        alike = sum(normal(nu[a] - account.slip[a], S[a] + r[d + a]) for a in seen)
        outside = np.logaddexp(outside + np.log(1.0 - ALIKE), alike + np.log(ALIKE))
    rows, slip = account.rows, account.slip
    for a in seen:
        variance = r[d + a] * (POOR if poor > usual else 1.0)
        rows = _set(rows, a, (*rows[a], (step, 1, (), z[d + a], variance)))
        slip = _set(slip, a, nu[a])
    gain = np.logaddexp(usual, poor) + np.log(1.0 - wrong)
    faulty = account.faulty
    out = [
        _told(
            account, gain, "moves", rows=rows, faulty=faulty - {sensor}, touched=step, moved=time
        ),
        _told(account, outside + np.log(wrong), "slips", faulty=faulty | {sensor}, slip=slip),
    ]
    gap = time - steps[account.touched] if account.touched >= 0 else 0.0
    strange = sum(nu[a] ** 2 / S[a] for a in seen) > STRANGE
    if not strange or not gap > 0.0 or not prior.manoeuvre > 0.0:
        return out
    far = _reach(motion.order, 1, gap)
    free = np.array([(far * _agility(motion, a, gap)) ** 2 + S[a] for a in seen])
    gain = cauchy(np.array([nu[a] for a in seen]) ** 2 / free, free)
    gain += np.log(prior.manoeuvre) + np.log(1.0 - wrong)
    rows, turns = account.rows, account.turns
    for a in seen:
        rows = _set(rows, a, (*rows[a], (step, 1, (), z[d + a], r[d + a])))
        speed = max(_agility(motion, a, gap), HASTE * abs(nu[a]) / far)
        turns = _set(turns, a, (*turns[a], (account.touched, speed)))
    faulty = faulty - {sensor}
    return [
        *out,
        _told(
            account, gain, "turns", rows=rows, faulty=faulty, turns=turns, touched=step, moved=time
        ),
    ]


def _use(account, z, variance, time, step, axes, period, known, *, running=False):
    """Take the positions of some axes into the account; the others are left out."""
    rows, seen, lost = account.rows, account.seen, account.lost
    for a in np.flatnonzero(~np.isnan(z[: len(seen)])):
        since, count = lost[a]
        out = running or a not in axes
        lost = _set(lost, a, (since if count else time, count + 1) if out else (np.nan, 0))
    for a in axes:
        offsets = account.lasting[a]
        if running and account.open[a] is not None:
            offsets = (*offsets, account.open[a])
        value = z[a]
        if seen[a]:  # the turn that lies nearest
            centre = known[a][0][0] + (known[a][0][-1] if running else 0.0)
            value = centre + _wrap(z[a] - centre, period)
        rows = _set(rows, a, (*rows[a], (step, 0, offsets, value, variance[a])))
        seen = _set(seen, a, True)
    new = any(seen) and np.isnan(account.began)
    began = time if new else account.began
    touched = step if len(axes) else account.touched
    return account._replace(rows=rows, seen=seen, lost=lost, began=began, touched=touched)


def _position(motion, prior, account, known, z, r, time, sensor, steps):
    step = len(steps) - 1
    d, period = motion.axes, motion.period
    axes = [a for a in range(d) if not np.isnan(z[a])]
    inside, poor, square, wide, distance, shifted = {}, 0.0, {}, {}, 0.0, 0.0
    for a in axes:
        m, P = known[a]
        if not account.seen[a]:
            square[a], wide[a] = 1.0, prior.spread[a] ** 2 + r[a]
            inside[a] = cauchy(np.ones(1), np.array([wide[a]]))
            continue
        nu, S = _wrap(z[a] - m[0], period), P[0, 0] + r[a]
        inside[a] = normal(nu, S)
        poor += normal(nu, S + (POOR - 1.0) * r[a])
        distance += nu**2 / S
        wide[a] = prior.spread[a] ** 2 + S
        square[a] = nu**2 / wide[a]
        h = np.eye(len(m))[0] + np.eye(len(m))[-1]
        shifted += normal(_wrap(z[a] - h @ m, period), h @ P @ h + r[a])
    unknown = not all(account.seen[a] for a in axes)
    belongs = sum(inside.values())
    own, running = account.run == sensor, account.run >= 0

    def wild(some):
        return cauchy(np.array([square[a] for a in some]), np.array([wide[a] for a in some]))

    def used(base, some, variance=r, **how):
        return _use(base, z, variance, time, step, some, period, known, **how)

    over = {"run": -1, "open": (None,) * d}
    out = [_told(used(account, []), wild(axes) + np.log(prior.isolated), "isolated")]
    if own:
        ended = used(account._replace(**over), axes)
        out.append(_told(ended, belongs + np.log(prior.ending), "drop"))
        if not unknown:
            gain = shifted + np.log(1.0 - prior.isolated - prior.ending)
            more = used(account, axes, running=True)._replace(length=account.length + 1)
            out.append(_told(more, gain, "continue"))
    else:
        usual, noisy = belongs + np.log(1.0 - prior.poor), poor + np.log(prior.poor)
        gain = belongs if unknown else np.logaddexp(usual, noisy)
        gain += np.log(1.0 - prior.isolated - prior.partial - prior.burst)
        is_poor = noisy > usual and not unknown
        good = used(account, axes, POOR * r if is_poor else r)
        if running and not unknown and belongs - shifted > PREFERS:
            good = good._replace(opened=time)  # the run is not a jump, up to now
        out.append(_told(good, gain, "poor" if is_poor else "belongs"))
        out += _partial(prior, account, axes, inside, wild, used)
        confirmed = running and not unknown and account.length >= CONFIRMED
        if confirmed and shifted - belongs > PREFERS:
            out.append(_told(used(_jumped(account), axes), shifted + np.log(prior.burst), "commit"))
    if distance > GROSS and not unknown and (own or not running):
        new, offsets = (None,) * d, account.offsets
        for a in axes:
            new = _set(new, a, offsets[a])
            offsets = _set(offsets, a, offsets[a] + 1)
        begun = account._replace(open=new, offsets=offsets, run=sensor, opened=time, length=1)
        known = [(np.append(m[:-1], 0.0), P) for m, P in known]
        begun = _use(begun, z, r, time, step, axes, period, known, running=True)
        out.append(_told(begun, wild(axes) + np.log(prior.burst), "open"))
    touched = account.touched
    gap = time - steps[touched] if touched >= 0 else 0.0
    if distance > STRANGE and not unknown and gap > 0.0 and not own and prior.manoeuvre > 0.0:
        far = _reach(motion.order, 0, gap)
        free = np.array(
            [(far * _agility(motion, a, gap)) ** 2 + known[a][1][0, 0] + r[a] for a in axes]
        )
        off = {a: _wrap(z[a] - known[a][0][0], period) for a in axes}
        gain = cauchy(np.array([off[a] for a in axes]) ** 2 / free, free) + np.log(prior.manoeuvre)
        turns = account.turns
        for a in axes:
            speed = max(_agility(motion, a, gap), HASTE * abs(off[a]) / far)
            turns = _set(turns, a, (*turns[a], (touched, speed)))
        out.append(_told(used(account._replace(turns=turns), axes), gain, "turns"))
    due = [a for a in axes if account.seen[a] and _due(prior, account, a, time)]
    if due and (due == axes or not own):
        fresh = account
        for a in due:
            far = abs(_wrap(z[a] - known[a][0][0], period)) / (time - account.lost[a][0])
            fresh = _forgotten(fresh, a, step, max(prior.sigma_velocity, HASTE * far))
        gain = np.log(ANEW) + sum(inside[a] for a in axes if a not in due)
        gain += sum(cauchy(np.ones(1), np.array([prior.spread[a] ** 2 + r[a]])) for a in due)
        fresh = used(fresh._replace(**over, began=time), axes)
        out.append(_told(fresh, gain, "anew"))
    return out


def _reach(order, component, gap):
    """What a unit of the highest rate does to a component in a time."""
    return transition(NAMES[order], 1, gap)[component, order - 1]


def _agility(motion, a, gap):
    """Scale of a change of the highest rate."""
    return 30.0 * np.sqrt(motion.density[a] * gap)


def _due(prior, account, a, time):
    """Whether an axis has been left out for so long that its track may begin anew."""
    since, count = account.lost[a]
    patience = AIDED if account.moved > since else PATIENCE
    return count >= CONFIRMED and time - since >= patience * prior.longest


def _forgotten(account, a, step, speed):
    """Nothing is known of an axis but that its rates are about nought."""
    return account._replace(
        rows=_set(account.rows, a, ()),
        offsets=_set(account.offsets, a, 0),
        lasting=_set(account.lasting, a, ()),
        seen=_set(account.seen, a, False),
        rate=_set(account.rate, a, (step, speed)),
        turns=_set(account.turns, a, ()),
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
        out.append(_told(used(account, rest), gain, "off" + "".join("xyz"[a] for a in some)))
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
    return _told(_jumped(account), 0.0, "lasting")


def _mixture(motion, prior, steps, accounts, evidence):
    """Moments of the mixture; a position only by those accounts that know one."""
    d, order = motion.axes, motion.order
    whole = accounts
    likeliest = max(accounts, key=lambda account: account.weight)
    accounts = [each for each in accounts if each is likeliest or "turns" not in each.said[-1]]
    mean, sigma = np.full(order * d, np.nan), np.full(order * d, np.nan)
    for a in range(d):
        known = [_moments(motion, prior, steps, account, a) for account in accounts]
        weight = np.exp([account.weight for account in accounts])
        told = np.array([account.seen[a] for account in accounts])
        for s in range(order):
            w = weight * told if s == 0 else weight
            if not w.any():
                continue
            w = w / w.sum()
            m, P = np.array([(each[0][s], each[1][s, s]) for each in known]).T
            centre = m[np.argmax(w)]
            gap = _wrap(m - centre, motion.period) if s == 0 else m - centre
            mean[s * d + a] = centre + w @ gap
            sigma[s * d + a] = np.sqrt(w @ P + w @ gap**2 - (w @ gap) ** 2)
    return Mixture(mean, sigma, evidence, whole)
