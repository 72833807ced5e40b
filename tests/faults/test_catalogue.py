"""Every fault of the catalogue, 1 to 51, has a test that carries its number."""

import re
from pathlib import Path

TESTS = Path(__file__).parents[1]
ELSEWHERE = {
    21: "acceptance/test_edges_of_the_earth.py::test_the_antimeridian_changes_nothing",
    22: "acceptance/test_edges_of_the_earth.py::test_across_the_pole",
    34: "service/test_failures.py::",
}


def test_every_fault_has_its_test():
    found = set()
    for place in TESTS.rglob("test_*.py"):
        for numbers in re.findall(r"def test_fault((?:_\d\d)+)_", place.read_text()):
            found |= {int(number) for number in numbers.split("_") if number}
    for number, where in ELSEWHERE.items():
        place, _, name = where.partition("::")
        assert f"def {name}" in (TESTS / place).read_text(), number
        found.add(number)
    assert found >= set(range(1, 52)), sorted(set(range(1, 52)) - found)
