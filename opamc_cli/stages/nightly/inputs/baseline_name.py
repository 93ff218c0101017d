"""What a baseline is called: where it begins, and the condition that it was recorded at."""


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
