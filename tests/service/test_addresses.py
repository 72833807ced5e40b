import pytest

from surefix.errors import OptionsError
from surefix.service.addresses import INPUTS, OUTPUTS, Address, address


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("udp://0.0.0.0:10110", Address("udp", "0.0.0.0", 10110)),
        ("tcp://gps.local:2000", Address("tcp", "gps.local", 2000)),
        ("tcp-listen://[::1]:0", Address("tcp-listen", "::1", 0)),
        ("serial:///dev/ttyUSB0", Address("serial", path="/dev/ttyUSB0", figure=4800.0)),
        ("serial:///dev/ttyS1?baud=38400", Address("serial", path="/dev/ttyS1", figure=38400.0)),
        ("file:///a/b.nmea?speed=0", Address("file", path="/a/b.nmea", figure=0.0)),
    ],
)
def test_is_taken_apart_and_written_again(text, parts):
    assert address(text, INPUTS) == parts
    assert address(str(parts), INPUTS) == parts


@pytest.mark.parametrize(
    "text",
    [
        "", "10110", "udp://:10110", "udp://host", "udp://host:70000", "udp://host:x",
        "http://host:80", "serial://ttyUSB0", "serial:///dev/ttyS0?baud=x",
        "serial:///dev/ttyS0?baud=0", "serial:///dev/ttyS0?bd=9600", "file:///a?speed=-1",
        "file:///a?speed=nan", "tcp://host:1/path",
    ],
)  # fmt: skip
def test_is_refused_with_what_was_expected(text):
    with pytest.raises(OptionsError, match="expected"):
        address(text, INPUTS)


def test_outputs_are_files_of_a_kind_that_can_be_gone_on_with():
    assert address("file:///a.csv", OUTPUTS).path == "/a.csv"
    with pytest.raises(OptionsError, match=r"ends in \.csv or \.parquet"):
        address("file:///a", OUTPUTS)
