from functools import reduce
from operator import xor

from surefix.io.nmea_log import sniff


def line(body: str, received: str = "") -> str:
    return f"{received}${body}*{reduce(xor, body.encode(), 0):02X}"


def test_sniff() -> None:
    hdt = line("HEHDT,218.53,T").encode()
    assert sniff(hdt)
    assert sniff(hdt + b"\r\n$HEHDT,2")
    assert sniff(b"# a\n# b\n# c\n# d\n" + hdt + b"\n")
    assert sniff(b"2014-08-01T00:00:00Z " + hdt + b"\n")
    assert sniff(b"1406851200.5," + hdt + b"\n")
    assert sniff(b"\xb5b\x01\x02\n\x00\x01\n\xff\n" * 9 + hdt + b"\n")
    assert sniff(b"$GPGLL,4807.038,N,01131.000,W\n")
    assert sniff(line("IIMWV,273,R,03.2,N,A").encode() + b"\n")
    assert not sniff(b"")
    assert not sniff(b"time,lat,lon\n1,2,3\n")
    assert not sniff(b"\0\1\2" * 1000)
    assert not sniff(b"A manual.\nIt says:\nfor example\nthis\n" + hdt + b"\n")
    assert sniff(b"Jan 1 12:00:00 bridge: " + hdt + b"\n")
    assert not sniff(b"$PRICE,1\n$OTHER,2\n")
