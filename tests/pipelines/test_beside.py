"""One thing is worked on while the next is made: in order, and no error is lost."""

import threading

import pytest

from surefix.pipelines.beside import while_next_is_made


def alive():
    return [each.name for each in threading.enumerate() if each.name.startswith("beside")]


def test_each_is_worked_on_once_in_order_while_the_next_is_made():
    done, met = [], threading.Event()

    def items():
        yield 0
        assert met.wait(10.0)  # the work on 0 goes on while 1 is made
        yield from range(1, 50)

    def work(item):
        met.set()
        done.append(item)

    while_next_is_made(work, items())
    assert done == list(range(50))
    assert not alive()
    while_next_is_made(done.append, [])
    assert len(done) == 50


@pytest.mark.parametrize("place", [0, 3, 9])
def test_an_error_of_the_work_is_raised_and_ends_it(place):
    done = []

    def work(item):
        if item == place:
            raise OSError("the disk is full")
        done.append(item)

    with pytest.raises(OSError, match="full"):
        while_next_is_made(work, range(10))
    assert done == list(range(place))
    assert not alive()


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_error_while_something_is_made_waits_for_the_work(error):
    done = []

    def items():
        yield from range(4)
        raise error

    with pytest.raises(error):
        while_next_is_made(done.append, items())
    assert done == list(range(4))
    assert not alive()
