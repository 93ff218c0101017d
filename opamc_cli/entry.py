"""Where an interpreter enters `opamc`: before all else, Ctrl-C ends it without a word.

Importing `signal` takes milliseconds in which an interruption would end in a traceback; the module
that it is made of is built in.
"""

import _signal  # type: ignore[import-not-found]

if _signal.getsignal(_signal.SIGINT) is _signal.default_int_handler:
    _signal.signal(_signal.SIGINT, _signal.SIG_DFL)


def main() -> None:
    """Run `opamc`."""
    from opamc_cli.__main__ import main as run

    run()
