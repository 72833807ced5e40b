"""Sentences of every kind that is read, and what transmission, machines and malice make of them."""

import json
from functools import reduce
from operator import xor

from acoustic_logs import dvl, evologics

BODIES = (
    b"GPGGA,123519.25,4807.0380,N,01131.0001,W,4,08,0.9,-545.4,M,46.9,M,,",
    b"GNGNS,123519,4807.038,S,01131.000,E,ANNN,08,0.9,545.4,46.9,,",
    b"GPRMC,123519.5,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W,A",
    b"GPGLL,4916.45,N,12311.12,W,225444,A,D",
    b"GPVTG,054.7,T,034.4,M,005.5,N,010.2,K,A",
    b"GPZDA,201530.00,04,07,2002,00,00",
    b"GPGST,172814.0,0.006,0.023,0.020,273.6,0.023,0.0,0.031",
    b"HEHDT,218.53,T",
    b"HCHDM,011.0,M",
    b"HETHS,127.3,A",
    b"HCHDG,101.1,2.5,W,7.1,E",
    b"IIVHW,218.5,T,011.0,M,05.12,N,09.48,K",
    b"VDVBW,1.1,0.2,A,1.0,0.1,A",
    b"SDDPT,0017.6,0.5",
    b"SDDBT,17.2,f,5.2,M,2.8,F",
    b"WIMWV,214.8,R,0.1,K,A",
    b"PSXN,20,1,2,3,4",
    b"PSXN,23,0.58,-1.09,218.83,0.78",
    b"PASHR,204132.040,010.99,T,+00.41,-00.75,-00.84,0.151,0.088,0.569,1,0",
    b"PHTRO,10.37,P,77.62,T",
    b"IIXDR,A,-1.7,D,PITCH,A,3.4,D,ROLL,C,,C,AIRTEMP",
    b"PSIMSSB,180554.432,M44,A,,C,N,M,-61.300,39.017,34.026,0.072,T,0.050576,",
    b"PSIMSSB,121826.836,B33,A,,C,H,M,3.1,-4.5,33.2,12.5,0.75,N,,",
    b"PSIMSNS,075617.446,,1,1,-1.27,-1.13,-0.04,250.87,,a0,0.000,,M121",
    b"PTSAG,#16068,124544.449,18,12,2017,1,4305.25355,N,00631.76852,E,F,1013.10,1,9999.00",
    b"PTSAH,0,359.671,0.000",
    b"PSONLLD,133707.52,2401,A,51.3315406,-0.83563975,999.916,5.33,5.33,0.00,0.62,,,,",
    b"PSONALL,2401,Transducer,134446.178,650778.88,5688917.56,1000.09,,,G,,,,7.521,0.606",
)
OTHERS = (
    b":00FFCA -0003F-0325  0319",
    evologics(12.9, 12.5, 4.5, -6.5, -20.25).strip(),
    dvl(1.7e9 + 0.3, 1.7e9).strip(),
    json.dumps({"type": "position_local", "x": 1.0, "y": 2.0, "ts": 1.7e9}).encode(),
    b"!AIVDM,1,1,,A,13u?etPv2;0n:dDPwUM1U1Cb069D,0*23",
)
RECEIVED = (b"", b"", b"", b"2014-08-01T00:00:00Z ", b"1406851200.250 ", b"[1406851200250] ")
ENDS = (b"\r\n", b"\r\n", b"\r\n", b"\n", b"\r", b"")
FIGURES = (
    b"", b"0", b"-0", b"nan", b"inf", b"-inf", b"1e308", b"1e999", b"-1", b"999999999999999999999",
    b"0." + b"0" * 40 + b"1", b"9" * 400, b"+5", b"0x10", b"1_0", b"\xd9\xa3", b" 7", b"12.34.56",
    b"240000", b"235960", b"9100.0", b"18060.0", b"A", b"V", b"N", b"S", b"E", b"W", b"null",
    b"true", b"[]", b"{}", b'"', b"NaN", b"Infinity", b"\0", b"-", b".", b"+",
)  # fmt: skip
NOISE = bytes(range(256))


def sentence(body):
    return b"$%s*%02X" % (body, reduce(xor, body))


def one(source):
    """One valid line without its end."""
    usual = source.random() < 0.88
    line = sentence(source.choice(BODIES)) if usual else source.choice(OTHERS)
    return source.choice(RECEIVED) + line


def mutated(source):
    """A line, mutated, and its end, which may be missing; a right checksum is put back often."""
    line = bytearray(one(source))
    for _ in range(source.choice((0, 1, 1, 1, 2, 4))):
        _KINDS[int(source.random() * len(_KINDS))](line, source)
    start, star = line.find(b"$"), line.rfind(b"*")
    if 0 <= start < star and source.random() < 0.6:
        line[star:] = b"*%02X" % reduce(xor, line[start + 1 : star], 0)
    return bytes(line) + source.choice(ENDS)


def _at(line, source):
    return int(source.random() * (len(line) + 1))


def _flip(line, source):
    if line:
        line[_at(line, source) - 1] ^= 1 << int(source.random() * 8)


def _other(line, source):
    if line:
        line[_at(line, source) - 1] = source.choice(NOISE)


def _drop(line, source):
    at = _at(line, source)
    del line[at : at + source.choice((1, 1, 2, 10))]


def _insert(line, source):
    at = _at(line, source)
    line[at:at] = bytes(source.choices(NOISE, k=source.choice((1, 1, 3, 20))))


def _cut(line, source):
    del line[_at(line, source) :]


def _behead(line, source):
    del line[: _at(line, source)]


def _fields(line):
    return bytes(line).split(b",")


def _figure(line, source):
    fields = _fields(line)
    fields[int(source.random() * len(fields))] = source.choice(FIGURES)
    line[:] = b",".join(fields)


def _shuffle(line, source):
    fields = _fields(line)
    a, b = (int(source.random() * len(fields)) for _ in range(2))
    fields[a], fields[b] = fields[b], fields[a]
    line[:] = b",".join(fields)


def _lose(line, source):
    fields = _fields(line)
    del fields[int(source.random() * len(fields))]
    line[:] = b",".join(fields)


def _double(line, source):
    fields = _fields(line)
    at = int(source.random() * len(fields))
    fields[at:at] = fields[at : at + 1] * source.choice((1, 1, 30))
    line[:] = b",".join(fields)


def _glue(line, source):
    at = _at(line, source)
    line[at:at] = one(source)


def _long(line, source):
    if source.random() < 0.02:
        at = _at(line, source)
        line[at:at] = source.choice((b"x", b"9", b",", b"$", b"\0")) * source.choice((5000, 20_000))


def _case(line, source):
    line[:] = line.swapcase()


_KINDS = (
    _flip, _other, _drop, _insert, _cut, _behead, _figure, _figure, _shuffle, _lose, _double, _glue,
    _long, _case,
)  # fmt: skip
