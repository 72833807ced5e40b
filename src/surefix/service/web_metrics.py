"""Figures of the live service in the text format of Prometheus."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Final

from prometheus_client import CollectorRegistry, Histogram
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.exposition import generate_latest
from prometheus_client.registry import Collector

from surefix.io.journal import Received
from surefix.service.inbox import Arrived
from surefix.service.web_guard import WebState
from surefix.types import Verdict

if TYPE_CHECKING:
    from surefix.service.running import Live

__all__ = ["Metrics"]

_LATENCIES: Final = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)  # s
_Samples = Iterable[tuple[Sequence[str], float]]
_Figures = tuple[tuple[Callable[..., Metric], str, str, Callable[[Any], float]], ...]


class Metrics(Collector):
    """Counts what the service does.

    Parameters
    ----------
    live, state
        The service, and its web side.
    clock
        s, Unix.
    """

    def __init__(self, live: Live, state: WebState, clock: Callable[[], float] = time.time) -> None:
        self._live, self._state, self._clock = live, state, clock
        self._registry = CollectorRegistry(auto_describe=False)
        self._registry.register(self)
        self._latency = Histogram(
            "surefix_latency_seconds",
            "From the arrival of bytes to the end of the step that journalled and answered them",
            buckets=_LATENCIES,
            registry=self._registry,
        )
        self._fixes: Counter[tuple[str, str]] = Counter()
        self._next = live.history.total
        self.stepped = clock()
        """s, Unix, when the service made its last step."""

    def notice(self, arrived: Sequence[Arrived]) -> None:
        """Count a step and what it took in."""
        self.stepped = self._clock()
        for each in arrived:
            if math.isfinite(each.time):
                self._latency.observe(max(0.0, self.stepped - each.time))
        history = self._live.history
        rows = history.take(history.since(self._next))
        self._next = history.total
        pairs = zip(rows["sensor"].tolist(), rows["verdict"].tolist(), strict=True)
        for (sensor, verdict), count in Counter(pairs).items():
            self._fixes[history.sensors[sensor], Verdict(verdict).name.lower()] += count

    def text(self) -> bytes:
        """Give all figures in the text format, version 0.0.4."""
        return generate_latest(self._registry)

    def collect(self) -> Iterator[Metric]:
        """Give the figures that are not kept here but read when they are asked for."""
        live, now = self._live, self._clock()
        names = [each.name for each in live.options.inputs]
        fixes = self._fixes.items()
        yield _counter("fixes", "Fixes cleaned for good", ["sensor", "verdict"], fixes)
        for make, name, text, read in _LINES:
            values = [float(read(line)) for line in live.lines]
            yield make(
                name, text, ["input"], [([n], v) for n, v in zip(names, values, strict=True)]
            )
        for make, name, text, read in _EXITS:
            exits = [output.state for _, output in live.outputs]
            samples = [([str(each.address)], float(read(each))) for each in exits]
            yield make(name, text, ["output"], samples)
        yield from self._knowledge(now)
        yield from self._journal(now)
        yield _gauge("web_clients", "WebSocket clients", [], [([], self._state.clients)])
        yield _counter("web_dropped_clients", "Did not read", [], [([], self._state.dropped)])
        yield _counter("web_late", "Connections cut for being slow", [], [([], self._state.late)])
        answers = [([str(status)], count) for status, count in self._state.answers.items()]
        yield _counter("web_answers", "HTTP answers", ["status"], answers)

    def _knowledge(self, now: float) -> Iterator[Metric]:
        live = self._live
        if live.now is not None:
            sigma = zip("xyz", live.now.sigma_position.tolist(), strict=True)
            yield _gauge("sigma_metres", "Of the position", ["axis"], [([a], v) for a, v in sigma])
            yield _gauge("position_age_seconds", "", [], [([], now - live.now.time)])
            yield _gauge("fix_age_seconds", "Last used", [], [([], now - live.now.observed)])
        labels = ["sensor", "quantity"]
        for name, text in (
            ("rate", "Hz, of the last minute"),
            ("latency", "s, median of the last minute"),
            ("rejected", "Share of the last minute"),
            ("innovation", "RMS, normalised, of the last minute"),
        ):
            values = [([s.name, s.quantity], getattr(s, name)) for s in live.sensors]
            yield _gauge(f"sensor_{name}", text, labels, values)
        judged = [([s.name, s.quantity, s.validity], 1.0) for s in live.sensors]
        yield _gauge("sensor_validity", "1 as judged", [*labels, "validity"], judged)
        urgent = Counter(each.priority for each in live.alarms if each.open)
        levels = [([level], urgent[level]) for level in ("alarm", "warning", "caution")]
        yield _gauge("alarms", "To be seen", ["priority"], levels)

    def _journal(self, now: float) -> Iterator[Metric]:
        waiting = self._live.unsaved
        oldest = next((each.time for each in waiting if isinstance(each, Received)), math.nan)
        lag = max(0.0, now - oldest) if math.isfinite(oldest) else 0.0
        yield _gauge("journal_unwritten", "Things to be written", [], [([], len(waiting))])
        yield _gauge("journal_lag_seconds", "Age of the oldest of them", [], [([], lag)])
        yield _gauge(
            "journal_missing_bytes", "Of the present gap", [], [([], self._live.keeper.gap.size)]
        )


def _counter(name: str, text: str, labels: Sequence[str], samples: _Samples) -> Metric:
    metric = CounterMetricFamily(f"surefix_{name}", text, labels=labels)
    for values, value in samples:
        metric.add_metric(values, value)
    return metric


def _gauge(name: str, text: str, labels: Sequence[str], samples: _Samples) -> Metric:
    metric = GaugeMetricFamily(f"surefix_{name}", text, labels=labels)
    for values, value in samples:
        metric.add_metric(values, value)
    return metric


_LINES: Final[_Figures] = (
    (_counter, "received_bytes", "Received", lambda line: line.size),
    (_counter, "refused_senders", "Not listed", lambda line: line.refused),
    (_gauge, "input_connected", "1 if open", lambda line: line.connected),
)
_EXITS: Final[_Figures] = (
    (_counter, "sent_bytes", "Handed on", lambda out: out.size),
    (_gauge, "clients", "Connected", lambda out: out.clients),
    (_counter, "dropped_clients", "Did not read", lambda out: out.dropped),
    (_counter, "refused_clients", "Were too many", lambda out: out.refused),
)
