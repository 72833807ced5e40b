"""The live service does not grow; the long form, 4.3 million sentences, is `make soak`."""

import asyncio
import gc
import tracemalloc

from service.soak import LIVE, soak, write_log
from service.test_transport import free_port


def test_a_long_mission_takes_no_more_memory_than_a_short_one(tmp_path):
    assert write_log(tmp_path / "boat.nmea", 12_000) == 12_000
    (tmp_path / "live.toml").write_text(LIVE.format(port=free_port()))
    held = {}

    def look(share):
        mark = int(4.0 * share)
        if mark not in held:
            gc.collect()
            held[mark] = tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        live, heard = asyncio.run(soak(tmp_path, 60, look))
    finally:
        tracemalloc.stop()
    assert live.station.after == live.taken >= 200
    assert heard > 300
    assert held[4] < held[1] + 1e6
