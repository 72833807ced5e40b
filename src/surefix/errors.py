"""Every error surefix raises on purpose.

::

    SurefixError
    ├── OptionsError      an option is wrong or two of them contradict each other
    ├── InputError        a file cannot be read as what it should be
    │   └── ParseError    …at one known line or field
    ├── OutputError       a file cannot be written
    └── MissingExtraError an optional dependency is not installed

Bad *data* is never an error: it becomes a verdict or a counted problem.
"""

from __future__ import annotations

__all__ = [
    "InputError",
    "MissingExtraError",
    "OptionsError",
    "OutputError",
    "ParseError",
    "SurefixError",
]


class SurefixError(Exception):
    """Something the user can mend: what was given, what was expected, what to do.

    Parameters
    ----------
    given
        What was found.
    expected
        What would have been right.
    remedy
        What the user can do about it.
    """

    def __init__(self, given: str, expected: str = "", remedy: str = "") -> None:
        self.given, self.expected, self.remedy = given, expected, remedy
        super().__init__(given, expected, remedy)

    def __str__(self) -> str:
        parts = [self.given]
        if self.expected:
            parts.append(f"expected {self.expected}")
        if self.remedy:
            parts.append(self.remedy)
        return "; ".join(parts)


class OptionsError(SurefixError):
    """An option is wrong, or two of them contradict each other."""


class InputError(SurefixError):
    """A file cannot be read as what it should be."""


class ParseError(InputError):
    """A file cannot be read at one known line or field."""


class OutputError(SurefixError):
    """A file cannot be written."""


class MissingExtraError(SurefixError):
    """An optional dependency is not installed."""
