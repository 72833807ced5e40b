"""An antenna aloft, and a log of roll and pitch, on the command line."""

import numpy as np
import pandas as pd

from acceptance.product import clean, read
from pipelines.rolling import ARM, Rolling


def test_a_log_of_its_own_carries_the_antenna(tmp_path):
    ship, rng = Rolling(300.0, 8), np.random.default_rng(8)
    time, told = np.arange(0.0, 300.0), np.arange(0.0, 300.0, 0.2)
    x, y, z = (ship.at(time) + ship.offset(time) + rng.normal(0.0, 0.2, (300, 3))).T
    heading, roll, pitch = np.degrees(ship.attitude(told))
    roll[700] = 120.0
    paths = [tmp_path / f"{name}.csv" for name in ("mast", "mru", "out")]
    pd.DataFrame({"time": time, "x": x, "y": y, "z": z}).to_csv(paths[0], index=False)
    mru = {"time": told, "heading": heading % 360.0, "roll": roll, "pitch": pitch}
    pd.DataFrame(mru).to_csv(paths[1], index=False)
    options = tmp_path / "options.toml"
    arm = f"mast = {ARM.tolist()}"
    options.write_text(f"[clean]\nsigma_attitude_deg = 0.2\n[clean.lever_arm]\n{arm}\n")
    said = clean(
        paths[0], "--attitude", paths[1], "--options", options, "-o", paths[2], "--json"
    ).json
    wrong = read(paths[2])[["x", "y", "z"]].to_numpy() - ship.at(time)
    assert np.sqrt(np.mean(wrong[20:] ** 2)) < 0.2
    assert {each["name"] for each in said["channels"]} == {"heading_deg", "roll_deg", "pitch_deg"}
    (problem,) = said["problems"]
    assert (problem["kind"], problem["total"]) == ("range", 1)
