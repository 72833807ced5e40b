"""Options from a TOML file.

::

    [clean]                       # any option of `surefix clean`
    mode = "offline"
    sigma_position = 0.5

    [columns]                     # as --column
    time = "lcm_timestamp:us"

    [sensor.usbl]                 # single sensors, by name
    sigma = 1.2
    delay_s = 0.4
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from surefix.errors import OptionsError
from surefix.io.toml_file import read_toml

__all__ = ["OptionsFile", "read_options"]

_TABLES = ("clean", "columns", "sensor")
# Of surefix live, whose file holds for surefix clean too:
_LIVE = ("alarms", "input", "journal", "output", "web")
_SENSOR_KEYS = ("delay_s", "lever_arm", "sigma")
_BY_SENSOR = (
    ("sigma", "sensor_sigma"),
    ("delay_s", "sensor_delay_s"),
    ("lever_arm", "lever_arm"),
)


class OptionsFile(NamedTuple):
    """What an options file says: fields of `CleanOptions` by name, and columns by role."""

    clean: dict[str, Any]
    columns: dict[str, str]


def read_options(path: str | Path) -> OptionsFile:
    """Read an options file.

    Raises
    ------
    InputError, ParseError
        The file cannot be read, or is not TOML.
    OptionsError
        A table or key is not known, or a value has the wrong type.
    """
    place = Path(path)
    content = read_toml(place)
    for name, value in content.items():
        if name in _LIVE:
            continue
        if name not in _TABLES or not isinstance(value, dict):
            raise OptionsError(
                f"{place}: {name!r}", "the tables " + ", ".join(f"[{t}]" for t in _TABLES)
            )
    columns = content.get("columns", {})
    for role, column in columns.items():
        if not isinstance(column, str):
            raise OptionsError(f"{place}: columns.{role} = {column!r}", 'text such as "time:ms"')
    clean = dict(content.get("clean", {}))
    for name, figures in content.get("sensor", {}).items():
        _add_sensor(place, name, figures, clean)
    for table in content.get("input", []):
        if isinstance(table, dict) and "lever_arm" in table and "name" in table:
            arms = {**clean.get("lever_arm", {}), str(table["name"]): table["lever_arm"]}
            clean["lever_arm"] = arms
    return OptionsFile(clean, columns)


def _add_sensor(place: Path, name: str, figures: Any, clean: dict[str, Any]) -> None:
    if not isinstance(figures, dict) or set(figures) - set(_SENSOR_KEYS):
        raise OptionsError(f"{place}: [sensor.{name}]", "the keys " + ", ".join(_SENSOR_KEYS))
    for key, option in _BY_SENSOR:
        if key in figures:
            clean[option] = {**clean.get(option, {}), name: figures[key]}
