"""Measurement of a chain of known gaps from its sound: arrival times, speed, friction and push.

The model predicts the pattern of hits up to friction and push. `_search` compares the sounds with
the patterns of a grid of both, `_refine` improves the best, and `_fit` matches each hit with a
sound and adjusts start, friction and push by robust least squares. Several matches may be
plausible: `_log_likelihood` ranks them, and the errors contain those that are almost as likely.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike
from scipy import fft, ndimage, optimize, signal, special

from domino_env.core.checks import numbers, require
from domino_env.core.results import draw
from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.physics import STANDARD, Physics, require_arguments
from domino_env.physics.wave import simulate
from domino_env.view.sound import MAX_RATE

HOP = 0.00025  # [s] between two values of the loudness
LEAST_RATE = 8000  # [1/s] samples per second, for several samples per hop
HIGH_PASS = 1500.0  # [Hz], above thuds on the table and hum; lower at low rates
QUIET = 0.02  # of the loudest moments: what is quieter does not count
FRICTIONS = np.linspace(0.0, 0.6, 121)  # of the search
PUSHES = np.geomspace(2.0, 30.0, 25)  # [rad/s] likewise, for dominoes of 48 mm on Earth
COARSE = 4  # hops between two values of the search
FIRST_HITS = 48  # hits that the search compares; fits then have twice as many at a time
STARTS = 10  # results of the search that are refined
WIDTHS = 0.0025, 0.002, 0.0007  # [s] to which sounds are widened, from search to refinement
REACHES = 0.006, 0.004, *(0.003,) * 6  # [s] from a predicted hit to its sound
LEAST_SCALE, TUKEY = 0.0002, 4.685  # [s] of the residuals; scales beyond which a sound is no hit
EFFICIENCY = 0.95  # of estimates with Tukey's weights
ECHO = 0.013  # [s] behind a sound, in which a similar one is not the hit
FAINT = 0.6  # of the usual height, below which a sound is hardly a hit
UNLIKELY = 0.05  # credence below which a sound is no hit
STRAY = 0.03  # likelihood of a hit without its sound, relative to one with it
PUSH_PRIOR = 0.3  # standard deviation of the push's logarithm, where sounds leave it open
RELEASED_PRIOR = 1e-5  # likewise of a released domino, whose fall before the first hit is silent
STRETCHES = 2, 3, 4  # Legendre polynomials by which times may differ from those of the model
REJECTED, LEAST_MISFIT = 0.001, 0.0005  # level, and RMS [s], from which the model is rejected
CLOCK = 1e-4  # relative standard error of the clock of a recorder
LEAST_HITS, LEAST_HEARD = 8, 0.5  # hits heard, and their fraction
SILENT = 6  # hits at an end of the chain; if none of them is heard, it stopped or was cut off
SECOND_HEIGHT = 0.7  # of the rises of a second chain, over those of the first; echoes are fainter
CHANCE, SECOND_CHANCE = 8.0, 4.5  # standard deviations by which the hits, and those of a second
# chain beside them, agree better with the sounds than at other times


class _Sounds(NamedTuple):
    """Beginnings of sounds in a recording.

    Attributes
    ----------
    rises
        Rise of the logarithm of the loudness within 1 ms, one value per `HOP`.
    times, heights
        Times of its maxima [s], and their values.
    """

    rises: Floats
    times: Floats
    heights: Floats

    def match(self, times: Floats, reach: float) -> Floats:
        """Return the sound within reach that is most likely the hit at each time; nan if none."""
        found = np.full(len(times), np.nan)
        first, last = (np.searchsorted(self.times, times + side) for side in (-reach, reach))
        for k in np.flatnonzero(last > first):
            near = slice(first[k], last[k])
            lag = (self.times[near] - times[k]) / reach
            found[k] = self.times[near][np.argmax(self.heights[near] * np.exp(-2.0 * lag**2))]
        return found

    def credence(self, found: Floats, times: Floats) -> Floats:
        """Return how likely sounds are hits, 0 to 1: not faint, nor echoes of a similar sound.

        `times` are those of the hits, with one before the first.
        """
        credence = np.zeros(len(found))
        heard = np.flatnonzero(np.isfinite(found))
        if len(heard):
            at = np.searchsorted(self.times, found[heard])
            echo = np.minimum(ECHO, 0.5 * np.diff(times)[heard])
            before = np.searchsorted(self.times, found[heard] - echo)
            usual = FAINT * np.median(self.heights[at])
            for k, i, j in zip(heard, before, at, strict=True):
                is_echo = (self.heights[i:j] > 0.5 * self.heights[j]).any()
                credence[k] = min(self.heights[j] / usual, 1.0) ** 2 * (0.1 if is_echo else 1.0)
        return credence

    def height(self, found: Floats) -> float:
        """Return the median of the heights of sounds; 0 without any."""
        at = np.searchsorted(self.times, found[np.isfinite(found)])
        return float(np.median(self.heights[at])) if len(at) else 0.0

    def without(self, found: Floats) -> _Sounds:
        """Return the sounds without some of them and their echoes."""
        found = found[np.isfinite(found)]
        rises, left = self.rises.copy(), np.ones(len(self.times), bool)
        for t in found:
            rises[max(int((t - 0.002) / HOP), 0) : int((t + ECHO) / HOP)] = 0.0
            left &= (self.times < t - 0.002) | (self.times > t + ECHO)
        return _Sounds(rises, self.times[left], self.heights[left])


def _find_sounds(samples: Floats, rate: float) -> _Sounds:
    """Return the beginnings of sounds above the noise."""
    corner = signal.butter(2, min(HIGH_PASS, 0.2 * rate), "highpass", fs=rate, output="sos")
    edges = np.floor(np.arange(0.0, len(samples) / rate, HOP) * rate).astype(np.int64)
    edges = np.unique(edges[edges < len(samples)])
    power = np.add.reduceat(signal.sosfilt(corner, samples) ** 2, edges)
    level = ndimage.uniform_filter1d(np.sqrt(power / np.diff(edges, append=len(samples))), 4)
    quiet = max(3.0 * float(np.median(level)), QUIET * float(np.quantile(level, 0.999)))
    loudness = np.log1p(level / max(quiet, 1e-300))
    rises = np.maximum(np.append(loudness[4:] - loudness[:-4], np.zeros(4)), 0.0)
    values = _widen(rises, 1.25 * HOP, HOP)
    at, _ = signal.find_peaks(values, max(0.15 * float(np.quantile(values, 0.999)), 1e-6))
    a, heights, b = values[at - 1], values[at], values[at + 1]
    curvature = np.minimum(a - 2.0 * heights + b, -1e-300)  # 0 in the middle of a plateau
    return _Sounds(rises, (at + 0.5 * (a - b) / curvature) * HOP, heights)


def _widen(values: Floats, width: float, hop: float) -> Floats:
    """Return values, one per hop [s], smoothed by a Gaussian function of a width [s]."""
    return np.asarray(ndimage.gaussian_filter1d(values, width / hop, mode="constant"))


class _Model:
    """Times of the hits by friction and push, and their derivatives.

    Attributes
    ----------
    layout, physics
        The layout, gravity and the expected push.
    is_released
        True if that is the push of a released domino.
    prior
        Standard deviation of the logarithm of the push before the sound is heard.
    """

    def __init__(self, layout: Layout, physics: Physics) -> None:
        self.layout, self.physics = layout, physics
        self.is_released = physics.is_released(layout)
        self.prior = RELEASED_PRIOR if self.is_released else PUSH_PRIOR

    def head(self, hits: int) -> _Model:
        """Return the model of the first hits, which do not depend on later dominoes."""
        a, n = self.layout, hits + 1
        if n >= a.count:
            return self
        sizes = a.spacing[:hits], a.thickness[:n], a.height[:n], a.width, a.density[:n]
        return _Model(Layout(*sizes, a.rise[:hits], a.tilt[:n]), self.physics)

    def times(self, friction: float, push: float, rtol: float = 1e-8) -> Floats:
        """Return the times of all dominoes after the push [s], inf where not hit."""
        physics = self.physics.replace(friction=max(float(friction), 0.0), push=float(push))
        return np.asarray(simulate(self.layout, physics, rtol=rtol).arrival_times)

    def jacobian(self, values: Floats) -> Floats:
        """Return the derivatives of the times by start, friction, push and stretches."""
        friction, push = values[1:3]
        times, columns = self.times(friction, push), [np.ones(self.layout.count)]
        for a, b in (1e-4, 0.0), (0.0, 1e-3 * push):
            with np.errstate(invalid="ignore"):
                columns.append((self.times(friction + a, push + b) - times) / (a + b))
        place = np.linspace(-1.0, 1.0, self.layout.count)
        columns += [legendre.Legendre.basis(k)(place) for k in STRETCHES[: len(values) - 3]]
        return np.column_stack(columns)


class _Fit(NamedTuple):
    """Times of all dominoes in the recording, matched with sounds.

    Attributes
    ----------
    values, covariance
        Start [s], friction, push [rad/s] and stretches [s].
    times
        (N,) times [s], the first at the push.
    jacobian
        Their derivatives by the values.
    residual
        (N-1,) sounds minus hits [s], nan without a sound.
    weight, credence
        Tukey's weights, and how likely each sound is a hit.
    scale
        Standard deviation of the residuals of hits [s]; inf without a fit.
    """

    values: Floats
    covariance: Floats
    times: Floats
    jacobian: Floats
    residual: Floats
    weight: Floats
    credence: Floats
    scale: float

    @property
    def found(self) -> Floats:
        """Times of the sounds of hits in the recording [s], nan where a hit was not heard."""
        heard = (self.weight > 0.0) & (self.credence > UNLIKELY)
        return np.where(heard, self.times[1:] + self.residual, np.nan)


def _search(rises: Floats, model: _Model, frictions: Floats) -> list[Floats]:
    """Return the best start [s] and friction for each push, the one with most agreement first.

    A released domino has one push; the frictions are then searched in parts.
    """
    hop = COARSE * HOP
    coarse = rises[: len(rises) // COARSE * COARSE].reshape(-1, COARSE).max(1)
    coarse = _widen(coarse, WIDTHS[0], hop)
    coarse -= _widen(coarse, 0.05, hop)
    scale = np.sqrt(model.physics.gravity / 9.81 * 0.048 / float(model.layout.height.mean()))
    spectra: dict[int, Any] = {}
    starts = []
    candidates = [(frictions, push) for push in PUSHES * scale]
    if model.is_released:
        candidates = [(part, model.physics.push) for part in np.array_split(frictions, STARTS)]
    for part, push in candidates:
        best = (0.0, np.zeros(3))
        for friction in part:
            times = model.times(friction, push, 1e-4)
            if not np.isfinite(times[-1]):
                continue
            hits = np.round(times[1:] / hop).astype(np.int64)
            size = fft.next_fast_len(len(coarse) + int(hits[-1]) + 1, real=True)
            size = -(-size // 4096) * 4096  # few sizes
            if size not in spectra:
                spectra[size] = fft.rfft(coarse, size)
            match = fft.irfft(spectra[size] * fft.rfft(np.bincount(hits), size).conj(), size)
            k = int(match.argmax())
            if match[k] > best[0]:
                place = k if k < len(coarse) else k - size  # before the recording
                best = (float(match[k]), np.array([place * hop, friction, push]))
        starts.append(best)
    return [values for match, values in sorted(starts, key=lambda s: -s[0]) if match > 0.0]


def _refine(sounds: _Sounds, model: _Model, values: Floats) -> Floats:
    """Return start, friction and push near which the widened sounds agree most with the hits."""
    grid = np.arange(len(sounds.rises)) * HOP
    for width in WIDTHS[1:]:
        wide = _widen(sounds.rises, width, HOP)

        def disagreement(x: Floats, wide: Floats = wide) -> float:
            push = model.physics.push if model.is_released else x[2]
            if not (0.0 <= x[1] <= 1.0 and 0.5 < push < 1000.0):
                return 0.0
            times = model.times(x[1], push, 1e-6)[1:]
            return -float(np.interp(x[0] + times[np.isfinite(times)], grid, wide, 0.0, 0.0).sum())

        simplex = np.vstack([values, values + np.diag([width, 0.003, 0.1 * values[2]])])
        options = {"initial_simplex": simplex, "maxiter": 120, "xatol": 1e-5, "fatol": 1e-4}
        values = optimize.minimize(disagreement, values, method="Nelder-Mead", options=options).x
    return np.append(values[:2], model.physics.push) if model.is_released else np.asarray(values)


def _fit(sounds: _Sounds, model: _Model, values: Floats, stretches: int = 0) -> _Fit:
    """Fit the hits by least squares with Tukey's weights; the sounds are matched anew each time."""
    guess = model.physics.push
    values = np.append(values, np.zeros(3 + stretches - len(values)))
    covariance = np.zeros((len(values), len(values)))
    step = np.zeros(len(values))
    for reach in REACHES:
        step[2] = np.clip(step[2], -0.3 * values[2], 0.3 * values[2])
        values = values + step
        values[1] = max(values[1], 0.0)
        jacobian = model.jacobian(values)
        times = values[0] + model.times(*values[1:3]) + jacobian[:, 3:] @ values[3:]
        residual = sounds.match(times[1:], reach) - times[1:]
        heard = np.isfinite(residual)
        if heard.sum() < LEAST_HITS or not np.isfinite(jacobian).all():
            none = np.zeros(len(residual))
            return _Fit(values, covariance, times, jacobian, residual, none, none, np.inf)
        scale = max(1.4826 * float(np.median(np.abs(residual[heard]))), LEAST_SCALE)
        error = np.where(heard, residual, 0.0) / scale
        weight = np.where(heard, np.maximum(1.0 - (error / TUKEY) ** 2, 0.0) ** 2, 0.0)
        prior = np.eye(1, len(values), 2) / (model.prior * guess)
        system = np.vstack([jacobian[1:] * (np.sqrt(weight) / scale)[:, None], prior])
        aims = np.append(error * np.sqrt(weight), (guess - values[2]) * prior[0, 2])
        step = np.linalg.lstsq(system, aims, rcond=None)[0]
        freedom = max(int(heard.sum()) - len(values), 1)  # the scale is that of residuals of a fit
        covariance = np.linalg.pinv(system.T @ system) / EFFICIENCY * heard.sum() / freedom
    credence = sounds.credence(times[1:] + residual, times)
    return _Fit(values, covariance, times, jacobian, residual, weight, credence, scale)


def _log_likelihood(fit: _Fit, scale: float, model: _Model) -> float:
    """Return the logarithm of the likelihood of a fit, for a scale of the residuals [s]."""
    if not np.isfinite(fit.scale):
        return -np.inf
    near = np.exp(-0.5 * (np.nan_to_num(fit.residual, nan=1.0) / scale) ** 2) * fit.credence
    prior = 0.5 * (np.log(fit.values[2] / model.physics.push) / model.prior) ** 2
    return float(np.log(STRAY + (1.0 - STRAY) * near).sum() - prior)


def _rivals(sounds: _Sounds, model: _Model, fit: _Fit) -> list[Floats]:
    """Return starts of fits with other pushes, which agree with the later hits too."""
    late = slice(len(fit.residual) // 4, None)
    found = fit.times[1:] + fit.residual
    values, agreements = [], []
    for push in np.geomspace(0.3, 3.0, 93) * fit.values[2]:
        times = model.times(fit.values[1], push)[1:]
        lags = (found - times)[late]
        start = float(np.median(lags[np.isfinite(lags)])) if np.isfinite(lags).any() else 0.0
        values.append(np.array([start, fit.values[1], push]))
        distance = np.abs(sounds.match(start + times, REACHES[-1]) - start - times)
        agreements.append(np.exp(-np.nan_to_num(distance, nan=1.0) / WIDTHS[-1]).sum())
    peaks, _ = signal.find_peaks(np.pad(agreements, 1))
    return [values[k - 1] for k in sorted(peaks, key=lambda k: -agreements[k - 1])[:8]]


def _best_fit(sounds: _Sounds, model: _Model) -> _Fit:
    """Return the most likely fit; its covariance contains the spread of those that are close."""
    head = model.head(FIRST_HITS)
    starts = [_refine(sounds, head, v) for v in _search(sounds.rises, head, FRICTIONS)[:STARTS]]
    fits = [_fit(sounds, head, values) for values in starts]
    fits = [fit for fit in fits if np.isfinite(fit.scale)]
    if not fits:
        raise ValueError(_NO_PATTERN)
    scale = min(fit.scale for fit in fits)
    best = max(fits, key=lambda fit: _log_likelihood(fit, scale, head))
    fits += [_fit(sounds, head, values) for values in _rivals(sounds, head, best)]
    scale = min(fit.scale for fit in fits)
    ranked = sorted(((_log_likelihood(fit, scale, head), k) for k, fit in enumerate(fits)))[::-1]
    highest, best, spread = ranked[0][0], fits[ranked[0][1]], np.zeros((3, 3))
    pushes: list[float] = []
    for likelihood, k in ranked:
        values = fits[k].values
        if all(abs(values[2] / push - 1.0) > 0.02 for push in pushes):
            pushes.append(values[2])
            difference = values - best.values
            spread += np.exp(likelihood - highest) * np.outer(difference, difference)
    hits = len(best.residual)
    while hits < model.layout.count - 1:
        hits *= 2
        best = _fit(sounds, model.head(hits), best.values)
    return best._replace(covariance=best.covariance + spread)


_NO_PATTERN = (
    "the sound is not that of this layout: no pattern of hits stands out; check the layout, and "
    "cut the recording to the toppling"
)


def _require_pattern(sounds: _Sounds, model: _Model, fit: _Fit, seconds: float) -> None:
    """Raise a ValueError if the sounds are not those of one whole wave through the layout."""
    hits, heard = fit.times[1:], np.flatnonzero(np.isfinite(fit.found))
    if len(heard) < LEAST_HITS:
        raise ValueError(_NO_PATTERN)
    part = fit.times[heard[0] : heard[-1] + 2]
    contrast = _contrast(sounds, part, fit.scale, seconds)
    if contrast < CHANCE or len(heard) < LEAST_HEARD * len(part[1:]):
        raise ValueError(_NO_PATTERN)
    count = model.layout.count
    if heard[0] >= SILENT or hits[0] < 0.0:
        raise ValueError(
            "the recording begins after the push, or is of another layout: the first hit heard is "
            f"that of domino {heard[0] + 1} of {count}; record the whole chain"
        )
    if heard[-1] + 1 <= count - 1 - SILENT or hits[-1] > seconds:
        raise ValueError(
            f"the last hit heard is that of domino {heard[-1] + 1} of {count}: the chain stopped "
            "there, or the recording was cut; only whole chains can be measured"
        )
    rest, friction = sounds.without(fit.found), float(fit.values[1])
    for start, _, push in _search(rest.rises, model.head(FIRST_HITS), np.array([friction]))[:1]:
        times = start + model.times(friction, push)
        found = fit.found[np.isfinite(fit.found)]
        lag = times[1:, None] - found
        is_open = ~((lag > -0.002) & (lag < ECHO)).any(1)  # not beside hits of the first
        others = rest.match(times[1:], 0.0015)[is_open]
        second = float(np.isfinite(others).mean())
        apart = abs(times[1] - hits[0])  # not the echoes
        if (
            is_open.sum() >= LEAST_HITS
            and second > LEAST_HEARD
            and apart > 4.0 * ECHO
            and rest.height(others) > SECOND_HEIGHT * sounds.height(found)
            and _contrast(rest, times, 0.001, seconds) > SECOND_CHANCE
        ):
            raise ValueError(
                f"the recording contains two chains: {second:.0%} of the hits are heard twice, "
                f"{apart:.2f} s apart; cut the recording to one"
            )


def _is_rejected(fit: _Fit, stretched: _Fit) -> bool:
    """Return True if the hits differ smoothly from the model, by an F test and by 0.5 ms."""
    heard = np.isfinite(fit.residual) & np.isfinite(stretched.residual)
    freedom = heard.sum() - len(stretched.values)
    stretch = stretched.jacobian[:, 3:] @ stretched.values[3:]
    if not np.isfinite(stretched.scale) or freedom < len(STRETCHES) or stretch.std() < LEAST_MISFIT:
        return False
    sums = [float((f.weight * f.residual**2)[heard].sum() / f.weight[heard].sum())
            for f in (fit, stretched)]  # fmt: skip
    ratio = max(sums[0] / sums[1] - 1.0, 0.0) * freedom / len(STRETCHES)
    return bool(special.fdtrc(len(STRETCHES), freedom, ratio) < REJECTED)


def _contrast(sounds: _Sounds, times: Floats, scale: float, seconds: float) -> float:
    """Return how much better sounds agree with times than with others, in standard deviations."""

    def agreement(times: Floats) -> float:
        found = sounds.match(times[1:], REACHES[-1])
        near = np.exp(-0.5 * (np.nan_to_num(found - times[1:], nan=1.0) / scale) ** 2)
        return float((near * sounds.credence(found, times)).sum())

    rng = np.random.default_rng(0)
    centred = times - times.mean()
    others = [
        agreement(rng.uniform(0.0, seconds) + rng.uniform(0.8, 1.2) * centred) for _ in range(100)
    ]
    return float((agreement(times) - np.mean(others)) / max(float(np.std(others)), 1.0))


@dataclass(frozen=True, eq=False)
class Measurement:
    """Arrival times, speed, friction and push of a chain, from its sound.

    Every `…_error` is a standard error. It contains that of finding the hits, of the start, and a
    relative error of the recorder's clock of 1e-4.

    Attributes
    ----------
    layout
        The layout.
    physics
        Physics with the friction and push that fit best.
    friction, friction_error
        Coefficient of friction between dominoes.
    push, push_error
        Angular velocity of the first domino [rad/s].
    mean_speed, mean_speed_error
        Distance from the first to the last pivot over the time from the push to the last hit [m/s].
    arrival_times
        (N,) times of the hits since the push [s]; 0 for the first domino, nan where not heard.
    arrival_error
        Standard error of each of these times [s].
    predicted
        (N,) times of the model with the friction and push that fit best [s].
    curve
        (N,) smooth times, which follow the hits where the model is rejected, else `predicted`.
    model_rejected
        True if the hits differ smoothly from the model, by 0.5 ms RMS or more, and by more than
        their scatter at the level 0.001.
    start
        Time of the push in the recording [s].
    rises
        Rise of the logarithm of the loudness, every 0.25 ms of the recording.
    """

    layout: Layout
    physics: Physics
    friction: float
    friction_error: float
    push: float
    push_error: float
    mean_speed: float
    mean_speed_error: float
    arrival_times: Floats
    arrival_error: float
    predicted: Floats
    curve: Floats
    model_rejected: bool
    start: float
    rises: Floats
    _jacobian: Floats
    _covariance: Floats

    @property
    def heard(self) -> int:
        """Number of hits that were heard."""
        return int(np.isfinite(self.arrival_times[1:]).sum())

    @property
    def misfit(self) -> Floats:
        """Differences of the hits from the model (N,) [s], nan where not heard."""
        return np.asarray(self.arrival_times - self.predicted)

    @property
    def misfit_rms(self) -> float:
        """Root mean square of the differences from the model [s]."""
        return float(np.sqrt(np.nanmean(self.misfit[1:] ** 2)))

    @property
    def misfit_max(self) -> float:
        """Largest difference from the model [s]."""
        return float(np.nanmax(np.abs(self.misfit[1:])))

    def speed(self, first: int, last: int) -> tuple[float, float]:
        """Return the mean speed between two dominoes, and its standard error [m/s].

        Parameters
        ----------
        first, last
            Indices of the dominoes; the time of domino 0 is that of the push.

        Raises
        ------
        ValueError
            For indices that are not those of two dominoes in their order.
        """
        require("first", first, 0, self.layout.count - 2, whole=True)
        require("last", last, first + 1, self.layout.count - 1, whole=True)
        seconds = float(self.curve[last] - self.curve[first])
        change = self._jacobian[last] - self._jacobian[first]
        error = np.hypot(np.sqrt(change @ self._covariance @ change) / seconds, CLOCK)
        speed = float(self.layout.positions[last] - self.layout.positions[first]) / seconds
        return speed, float(speed * error)

    @property
    def verdict(self) -> str:
        """Result in a sentence."""
        model = "is rejected" if self.model_rejected else "explains the hits"
        return (
            f"{self.heard} of {self.layout.count - 1} hits heard: "
            f"{self.mean_speed:.4f} ± {self.mean_speed_error:.4f} m/s, friction "
            f"{self.friction:.4f} ± {self.friction_error:.4f}, push {self.push:.2f} ± "
            f"{self.push_error:.2f} rad/s; the model {model} (differences "
            f"{1e3 * self.misfit_rms:.2f} ms RMS, {1e3 * self.misfit_max:.2f} ms at most)"
        )

    def plot(self) -> Any:
        """Draw the sound, the hits that were found and predicted, and their differences.

        Returns
        -------
        matplotlib.figure.Figure
            The figure.
        """
        return draw("measurement", self)


def measure(
    samples: ArrayLike, rate: float, layout: Layout, physics: Physics = STANDARD
) -> Measurement:
    """Measure a chain of known gaps from the recording of its sound.

    The friction and the push with which the model predicts the hits best are fitted; if the hits
    differ from the model, the times are those of a smooth curve through the hits.

    Parameters
    ----------
    samples
        Samples (S,) of any scale.
    rate
        Samples per second, from 8000 to 1 000 000.
    layout
        The layout that was built, of at least nine dominoes.
    physics
        Gravity, and the expected push [rad/s]. A push other than that is less likely (standard
        deviation of its logarithm 0.3), which counts where the sound leaves the push open. The push
        of a released domino (`Physics.released`) is not fitted, because a slower finger delays the
        whole sound.

    Returns
    -------
    Measurement
        Speed, friction and push with their standard errors, and the hits that were heard.

    Raises
    ------
    TypeError
        For a layout or physics of another type.
    ValueError
        For samples that are not finite, silence, a rate out of range, a layout of less than nine
        dominoes, and if the sound is not that of one whole wave through the layout: another layout,
        noise, a chain that stopped, two chains, or a part of the recording.

    Examples
    --------
    >>> import domino_env as de
    >>> layout = de.Layout.uniform(30, pitch=0.024)
    >>> sound = de.clicks(de.simulate(layout, de.Physics(friction=0.2)))
    >>> result = de.measure(sound, 44100, layout)
    >>> round(result.friction, 2)
    0.2
    """
    require_arguments(layout, physics)
    require("rate", rate, LEAST_RATE, MAX_RATE, "samples per second")
    samples = numbers("samples", samples, None, ("S",), finite=True)
    if layout.count <= LEAST_HITS:
        raise ValueError(
            f"the layout has {layout.count} dominoes: measure one of at least {LEAST_HITS + 1}"
        )
    if len(samples) < rate * HOP * 100 or np.ptp(samples) == 0.0:
        raise ValueError("the recording is silent: record it again")
    sounds, model = _find_sounds(samples, rate), _Model(layout, physics)
    fit = _best_fit(sounds, model)
    _require_pattern(sounds, model, fit, len(samples) / rate)
    stretched = _fit(sounds, model, fit.values, len(STRETCHES))
    is_rejected = _is_rejected(fit, stretched)
    best = stretched if is_rejected else fit
    friction, push = map(float, best.values[1:3])
    curve = best.times - best.times[0]
    errors = np.sqrt(np.diag(best.covariance)[:3])
    result = Measurement(
        layout=layout, physics=physics.replace(friction=friction, push=push),
        friction=friction, friction_error=float(errors[1]), push=push, push_error=float(errors[2]),
        mean_speed=0.0, mean_speed_error=0.0,
        arrival_times=np.append(0.0, best.found - best.times[0]),
        arrival_error=float(np.hypot(best.scale, errors[0])),
        predicted=model.times(friction, push), curve=curve, model_rejected=is_rejected,
        start=float(best.times[0]), rises=sounds.rises, _jacobian=best.jacobian,
        _covariance=best.covariance,
    )  # fmt: skip
    speed, error = result.speed(0, layout.count - 1)
    return replace(result, mean_speed=speed, mean_speed_error=error)
