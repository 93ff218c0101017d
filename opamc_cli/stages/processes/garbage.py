"""How often Python looks for garbage that refers to itself."""

import gc

OBJECTS_BETWEEN_LOOKS = 300_000
"""Made and not yet gone; Python's own choice is 700, in some releases 2000."""


def look_for_garbage_seldom() -> None:
    """Spare a short command, in a process that is ours, most looks for garbage.

    Of what libraries make as they are loaded, some 200 000 objects, nothing is garbage; to look for
    it every 700 objects is a twentieth of the computing of a single night, every 20 000 still a
    thirtieth. What a night or a diagnosis leaves before the first look takes a few megabytes.
    """
    _, *older = gc.get_threshold()
    gc.set_threshold(OBJECTS_BETWEEN_LOOKS, *older)
