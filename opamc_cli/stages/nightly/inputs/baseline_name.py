"""What a baseline is called: where it begins, and the condition that it was recorded at."""

import re


def baseline_name(begin: str, condition: str) -> str:
    """Return a baseline's name.

    Parameters
    ----------
    begin
        Which nights or files it is made of; without a comma.
    condition
        Rate, speed and payload, in words.

    Examples
    --------
    >>> baseline_name("from 2026-03-02", "100 Hz, 70 %")
    'from 2026-03-02, 100 Hz, 70 %'
    """
    return f"{begin}, {condition}"


def condition_in(name: str) -> str:
    """Return the condition of a baseline of this name.

    Examples
    --------
    >>> condition_in("from 2026-03-02, 100 Hz, 70 %")
    '100 Hz, 70 %'
    """
    return name.partition(", ")[2]


def rate_in(condition: str) -> float | None:
    """Return the sampling rate that a condition names; None if it names none.

    Examples
    --------
    >>> rate_in("100 Hz, 70 %")
    100.0
    """
    told = re.match(r"(\d+(?:\.\d+)?(?:e[+-]\d+)?) Hz", condition)
    return float(told[1]) if told else None
