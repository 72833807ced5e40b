"""What the live service reads, writes and keeps, from a TOML file.

::

    [clean]                           # as for `surefix clean`; the mode is real time
    settle_rows = 120                 # rows that are waited for before noise is settled
    reorder_s = 2.0

    [[input]]
    name = "gnss"
    from = "udp://0.0.0.0:10110"      # see surefix.service.addresses
    allow = ["192.168.1.0/24"]

    [[output]]
    to = "tcp-listen://127.0.0.1:10111"
    sentences = ["GGA", "RMC", "VTG", "GST"]
    talker = "GP"

    [[output]]
    to = "file:track.csv"             # the clean track, recorded; or .parquet

    [journal]
    url = "sqlite:///mission.db"

    [alarms]
    position_sigma_m = 10.0           # σ above which the position is called uncertain
    dead_reckoning_s = 10.0           # time without a fix after which it is called lost

    [web]                             # see surefix.service.web_options
    address = "127.0.0.1:8000"
"""

from __future__ import annotations

import ipaddress
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from surefix.errors import OptionsError
from surefix.io.feeds import ROLES, Feed, Task, feeds
from surefix.io.options_file import read_options
from surefix.io.toml_file import read_toml
from surefix.io.write_nmea import TYPES
from surefix.pipelines.options import CleanOptions, options_from
from surefix.service.addresses import INPUTS, OUTPUTS, Address, address
from surefix.service.web_options import WebOptions, read_web

__all__ = ["SENTENCES", "AlarmOptions", "InputOptions", "LiveOptions", "OutputOptions", "read_live"]

SENTENCES: Final = (*TYPES, "GBS")
"""What can be put out; gpsd takes its expected errors from GBS."""

_INPUT: Final = {
    "name", "from", "role", "allow", "require_checksum", "target", "lever_arm",
}  # fmt: skip
_TALKER: Final = re.compile(r"[A-Z]{2}")


@dataclass(frozen=True, kw_only=True)
class InputOptions:
    """One input.

    Parameters
    ----------
    name
        What its sensors are called after.
    address
        Where it is read from.
    role
        What it is for, one or several of `surefix.io.feeds.ROLES`: ``fixes``; ``depth`` and
        ``velocity``, which support them; ``heading``, of the vehicle, which turns velocities and
        lever arms; ``attitude``, its roll and pitch, which carry lever arms; ``ship``, position and
        heading of the ship that the fixes are seen from.
    allow
        Networks that datagrams and clients may come from; empty: any.
    require_checksum
        False accepts sentences without one.
    target
        Of an acoustic positioning system: the transponder whose sightings are the fixes, or
        ``first``, the one that is heard first; None, or ``ship``: the fixes are the receivers'.
    """

    name: str
    address: Address
    role: str | tuple[str, ...] = "fixes"
    allow: tuple[str, ...] = ()
    require_checksum: bool = True
    target: str | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise OptionsError(f"input name {self.name!r}", "a name")
        self._check_roles()
        for network in _texts("allow", self.allow):
            try:
                ipaddress.ip_network(network, strict=False)
            except ValueError as error:
                raise OptionsError(f"allow {network!r} of {self.name}", "a network") from error
        if not isinstance(self.require_checksum, bool):
            raise OptionsError(f"require_checksum {self.require_checksum!r}", "true or false")
        if self.target is not None and (not isinstance(self.target, str) or not self.target):
            raise OptionsError(f"target {self.target!r}", "the name of a transponder, or first")
        if self.target is not None and "fixes" not in self.roles:
            raise OptionsError(f"target of {self.name}, a source of {self.role}", "role fixes")

    def _check_roles(self) -> None:
        given = self.role if isinstance(self.role, tuple) else (self.role,)
        if not given or any(given.count(each) > 1 or each not in ROLES for each in given):
            raise OptionsError(
                f"role {self.role!r} of {self.name}", "one or several of " + ", ".join(ROLES)
            )
        if "ship" in given and {"fixes", "heading"} & set(given):
            raise OptionsError(
                f"role {self.role!r} of {self.name}, the ship's and the vehicle's at a time",
                "ship, or fixes and heading",
                "position and heading of the ship in the line of the target need no role",
            )

    @property
    def roles(self) -> tuple[str, ...]:
        """What it is for, in the order of `surefix.io.feeds.ROLES`."""
        given = self.role if isinstance(self.role, tuple) else (self.role,)
        return tuple(role for role in ROLES if role in given)

    @property
    def task(self) -> Task:
        """Its roles and target."""
        return Task(self.roles, self.target)


@dataclass(frozen=True, kw_only=True)
class OutputOptions:
    """One output.

    Parameters
    ----------
    address
        Where it goes to.
    sentences
        Some of ``SENTENCES``; HDT and DPT go out where a heading, a depth is known.
    talker
        Two letters that the sentences begin with.
    """

    address: Address
    sentences: tuple[str, ...] = TYPES
    talker: str = "GP"

    def __post_init__(self) -> None:
        for name in _texts("sentences", self.sentences):
            if name not in SENTENCES:
                raise OptionsError(f"sentence {name!r}", "one of " + ", ".join(SENTENCES))
        if not isinstance(self.talker, str) or not _TALKER.fullmatch(self.talker):
            raise OptionsError(f"talker {self.talker!r}", "two capital letters")


@dataclass(frozen=True, kw_only=True)
class AlarmOptions:
    """When the position is no longer to be relied on.

    Parameters
    ----------
    position_sigma_m
        Horizontal standard deviation above which it is uncertain, m.
    dead_reckoning_s
        Time without a fix that was used, s, after which it is lost. The default is the time within
        which IMO A.1046(27) wants to be warned.
    """

    position_sigma_m: float = 10.0
    dead_reckoning_s: float = 10.0

    def __post_init__(self) -> None:
        for name in ("position_sigma_m", "dead_reckoning_s"):
            value = getattr(self, name)
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not number or not value > 0.0:
                raise OptionsError(f"{name} = {value!r}", "a number above 0")


@dataclass(frozen=True, kw_only=True)
class LiveOptions:
    """What the live service does.

    Parameters
    ----------
    clean
        How the track is estimated.
    inputs, outputs
        At least one input.
    journal
        URL of the journal.
    snapshot_s
        Time between two snapshots, s.
    alarms
        When alarms are raised.
    web
        Dashboard and API; None: none.
    """

    clean: CleanOptions
    inputs: tuple[InputOptions, ...]
    outputs: tuple[OutputOptions, ...] = ()
    journal: str = "sqlite:///surefix.db"
    snapshot_s: float = 10.0
    alarms: AlarmOptions = AlarmOptions()
    web: WebOptions | None = None

    def __post_init__(self) -> None:
        roles = {role for each in self.inputs for role in each.roles}
        if "fixes" not in roles:
            raise OptionsError("no input of fixes", "[[input]] with name and from")
        if "velocity" in roles and not roles & {"heading", "attitude"}:
            raise OptionsError(
                "velocities along the vehicle's own axes, and no heading",
                "an input with the role heading: that of the vehicle",
            )
        if "ship" in roles and not any(each.target for each in self.inputs):
            raise OptionsError("an input of the ship, and no target", "an input with a target")
        names = [each.name for each in self.inputs]
        if len(set(names)) < len(names):
            raise OptionsError(f"inputs {', '.join(names)}", "names that differ")
        if not isinstance(self.snapshot_s, int | float) or not self.snapshot_s > 0.0:
            raise OptionsError(f"snapshot_s = {self.snapshot_s!r}", "seconds above 0")

    @property
    def feeds(self) -> tuple[Feed, ...]:
        """What goes to the cleaning: one series for each input, then those of further roles."""
        return feeds([each.task for each in self.inputs])


def read_live(path: str | Path) -> LiveOptions:
    """Read the options of the live service.

    Raises
    ------
    InputError, ParseError
        The file cannot be read, or is not TOML.
    OptionsError
        A key is not known, or a value is wrong.
    """
    place = Path(path)
    content = read_toml(place)
    given = read_options(place).clean
    if "settle_rows" not in given:
        raise OptionsError(
            f"{place}: [clean] without settle_rows",
            "how many rows are waited for before the first position",
            "add settle_rows = 120",
        )
    if given.setdefault("mode", "realtime") != "realtime":
        raise OptionsError(f"{place}: mode {given['mode']!r}", "realtime")
    journal = _table(place, content, "journal", {"url", "snapshot_s"})
    alarms = _table(place, content, "alarms", {"position_sigma_m", "dead_reckoning_s"})
    if (url := journal.get("url")) is not None:
        journal["url"] = _beside(place, str(url))
    return LiveOptions(
        clean=options_from(given),
        inputs=tuple(_input(place, each) for each in _list(place, content, "input")),
        outputs=tuple(_output(place, each) for each in _list(place, content, "output")),
        alarms=AlarmOptions(**alarms),
        web=_web(place, content),
        **{("journal" if key == "url" else key): value for key, value in journal.items()},
    )


def _texts(name: str, values: object) -> tuple[str, ...]:
    if isinstance(values, tuple) and all(isinstance(each, str) for each in values):
        return values
    raise OptionsError(f"{name} = {values!r}", 'a list of texts, as ["…"]')


def _beside(place: Path, url: str) -> str:
    """Let the path of a SQLite file begin at the folder of the options."""
    kind, mark, path = url.partition(":///")
    return f"{kind}{mark}{place.parent / path}" if kind == "sqlite" else url


def _table(place: Path, content: dict[str, Any], name: str, keys: set[str]) -> dict[str, Any]:
    table = content.get(name, {})
    if not isinstance(table, dict) or set(table) - keys:
        raise OptionsError(f"{place}: [{name}]", "the keys " + ", ".join(sorted(keys)))
    return dict(table)


def _web(place: Path, content: dict[str, Any]) -> WebOptions | None:
    table = content.get("web")
    if table is None:
        return None
    if not isinstance(table, dict):
        raise OptionsError(f"{place}: web = {table!r}", "a table [web]")
    return read_web(place, table)


def _list(place: Path, content: dict[str, Any], name: str) -> list[dict[str, Any]]:
    tables = content.get(name, [])
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise OptionsError(f"{place}: {name}", f"tables [[{name}]]")
    return tables


def _input(place: Path, table: dict[str, Any]) -> InputOptions:
    rest = _known(place, "input", table, _INPUT)
    rest.pop("lever_arm", None)  # read with the options of the cleaning
    if "name" not in rest or "from" not in rest:
        raise OptionsError(f"{place}: an input without name or from", "both")
    where = address(str(rest.pop("from")), INPUTS)
    if where.kind == "file":
        where = where._replace(path=str(place.parent / where.path))
    return InputOptions(address=where, **rest)


def _output(place: Path, table: dict[str, Any]) -> OutputOptions:
    rest = _known(place, "output", table, {"to", "sentences", "talker"})
    if "to" not in rest:
        raise OptionsError(f"{place}: an output without to", "an address")
    where = address(str(rest.pop("to")), OUTPUTS)
    if where.kind == "file":
        if rest:
            raise OptionsError(f"{place}: {min(rest)!r} of a recorded track", "only to")
        where = where._replace(path=str(place.parent / where.path))
    return OutputOptions(address=where, **rest)


def _known(place: Path, name: str, table: dict[str, Any], keys: set[str]) -> dict[str, Any]:
    unknown = sorted(set(table) - keys)
    if unknown:
        raise OptionsError(f"{place}: {unknown[0]!r} in [[{name}]]", "one of " + ", ".join(keys))
    return {key: tuple(v) if isinstance(v, list) else v for key, v in table.items()}
