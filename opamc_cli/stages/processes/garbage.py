"""How often Python looks for garbage that refers to itself."""

import gc

OBJECTS_BETWEEN_LOOKS = 20_000
"""Made and not yet gone; Python's own choice is 700, in some releases 2000."""


def look_for_garbage_seldom() -> None:
    """Spare a short command, in a process that is ours, most looks for garbage.

    Of what libraries make as they are loaded nothing is garbage; to look for it every 700 objects
    is a twentieth of the computing of a single night.
    """
    _, *older = gc.get_threshold()
    gc.set_threshold(OBJECTS_BETWEEN_LOOKS, *older)
