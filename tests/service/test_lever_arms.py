"""Several receivers away from the reference point, on a ship that turns."""

from dataclasses import replace

import numpy as np
import pytest

from service.receivers import (  # noqa: F401
    CLEAN,
    START,
    Ship,
    _patient,
    cleaned_again,
    gga,
    hdt,
    sail,
    service_of,
)
from surefix.errors import OptionsError
from surefix.io.options_file import read_options
from surefix.service.options import read_live

SHIP = Ship(260.0, seed=3, turning=0.03)
BOW, STERN, MAST = [40.0, 0.0, 20.0], [-30.0, 6.0, 15.0], [5.0, -8.0, 30.0]
ARMS = {"bow": BOW, "stern": STERN, "mast": MAST}
CARRIED = replace(CLEAN, lever_arm=ARMS, sigma_heading_deg=0.5)


def heard_of(names, sigma=0.3, seed=0, faults=None, dark=()):
    """Receivers of these names a second, and a compass twice a second, but for ``dark`` times."""
    rng = np.random.default_rng(seed)
    bias = np.radians(0.3)

    def heard(i, second):
        if i == len(names):
            bow = [(t, SHIP.bow(t) + bias) for t in (second + 0.05, second + 0.55)]
            noisy = [(t + 0.02, hdt(each + rng.normal(0.0, np.radians(0.2)))) for t, each in bow]
            return [] if second in dark else noisy
        time = second + 0.1 * i
        place = SHIP.antenna(time, ARMS[names[i]][:2]) + rng.normal(0.0, sigma, 2)
        quality = 1
        if faults is not None and names[i] in faults:
            quality, place = faults[names[i]](second, place)
        return gga(time, place, quality)

    return heard


def service(folder, names, clean=CARRIED):
    clean = replace(clean, lever_arm={n: a for n, a in clean.lever_arm.items() if n in names})
    return service_of(folder, [*names, "gyro"], clean, gyro={"role": "heading"})


def figures(told, begin=61, end=10_000):
    """Errors over σ, and the errors, of the times between."""
    some = [each for each in told if begin <= each.time < end]
    errors = np.array([each.error for each in some])
    return errors, errors / np.array([each.sigma for each in some])[:, None]


def test_all_receivers_refer_to_one_point(tmp_path):
    live = service(tmp_path, ["bow", "stern"])
    told = sail(live, SHIP, 180, heard_of(["bow", "stern"]))
    errors, z = figures(told)
    assert np.sqrt(np.mean(errors**2)) < 0.35
    assert np.abs(errors).max() < 1.5
    assert 0.4 < np.sqrt(np.mean(z**2)) < 1.3
    assert not any(each.alarms for each in told if each.time > 60)
    assert told[-1].sensors["bow GNSS"].validity == "valid"
    assert told[-1].sensors["gyro HEHDT"].rate == pytest.approx(2.0, rel=0.1)
    assert live.station.session.health.rejected.max() < 0.1


def test_without_lever_arms_it_would_be_the_mean_of_two_places(tmp_path):
    live = service(tmp_path, ["bow", "stern"], replace(CARRIED, lever_arm={}))
    told = sail(live, SHIP, 120, heard_of(["bow", "stern"]))
    errors, _ = figures(told)
    assert np.sqrt(np.mean(errors**2)) > 3.0


def test_a_compass_that_fails_makes_the_position_less_certain_not_wrong(tmp_path):
    live = service(tmp_path, ["bow"])
    told = sail(live, SHIP, 200, heard_of(["bow"], dark=range(120, 160)))
    assert told[159].sensors["gyro HEHDT"].word == "stale"
    before = np.median([each.sigma for each in told[80:118]])
    assert np.median([each.sigma for each in told[150:160]]) > 5.0 * before
    _, z = figures(told, 80)
    assert np.abs(z).max() < 5.0
    errors, _ = figures(told, 175)
    assert np.sqrt(np.mean(errors**2)) < 0.6


def spoofed(second, place):
    """Led away to the east, half a metre a second."""
    return 1, place + np.array([0.5 * max(second - 100, 0), 0.0])


def jammed(second, place):
    """Louder and louder, then nothing."""
    rng = np.random.default_rng(second)
    return (0 if second >= 120 else 1), place + rng.normal(0.0, max(second - 100, 0) * 0.3, 2)


@pytest.mark.parametrize(("fault", "said"), [(spoofed, "biased"), (jammed, "stale")])
def test_one_of_three_is_led_astray(tmp_path, fault, said):
    names = ["bow", "stern", "mast"]
    live = service(tmp_path, names, replace(CARRIED, settle_rows=120))
    told = sail(live, SHIP, 170, heard_of(names, faults={"bow": fault}))
    state = told[-1].sensors["bow GNSS"]
    assert (state.validity, state.word) == ("invalid", said)
    for name in ("stern GNSS", "mast GNSS"):
        assert told[-1].sensors[name].validity == "valid"
    errors, _ = figures(told)
    assert np.abs(errors).max() < 2.0  # the one that is led away is 35 m off in the end
    steps = np.abs(np.diff(errors, axis=0)).max(axis=1)
    assert steps.max() < 1.5


def test_the_mission_is_cleaned_again_with_the_same_arms(tmp_path):
    """Live and `surefix clean` give the same numbers, whatever came first."""
    live = service(tmp_path, ["bow", "stern"])
    sail(live, SHIP, 130, heard_of(["bow", "stern"], dark=range(90, 100)))
    confirmed, again = cleaned_again(live, tmp_path)
    assert len(confirmed) > 180
    assert again.track.time[0] == START


def test_lever_arms_of_the_inputs_hold_for_clean_too(tmp_path):
    place = tmp_path / "live.toml"
    text = '[clean]\nsettle_rows = 40\n[[input]]\nname = "bow"\nfrom = "udp://0.0.0.0:1"\n'
    place.write_text(text + "lever_arm = [40.0, 0.0, 20.0]\n")
    assert read_live(place).clean.lever_arm == {"bow": [40.0, 0.0, 20.0]}
    assert read_options(place).clean["lever_arm"] == {"bow": [40.0, 0.0, 20.0]}
    for wrong in ("40.0", '["a", 0, 0]', "[1.0, 2.0]", "[nan, 0, 0]"):
        place.write_text(text + f"lever_arm = {wrong}\n")
        with pytest.raises(OptionsError, match="bow"):
            read_live(place)
