"""scipy is loaded without its documentation, and does the same."""

import subprocess
import sys

LOAD = (
    "import scipy.special, scipy.ndimage, scipy.linalg, scipy.stats, scipy.optimize\n"
    "print('Student t' in scipy.special.stdtr.__doc__, scipy.special.stdtr(3.0, 1.0),\n"
    "      scipy.ndimage.uniform_filter1d([1.0, 2.0, 6.0], 3).tolist())\n"
)
FORGO = (
    "from opamc_cli.stages.processes.documentation import forgo_documentation\n"
    "forgo_documentation()\n"
)


def printed(program):
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout.split(" ", 1)


def test_a_process_of_ours_does_without():
    documented, numbers = printed(LOAD)
    assert documented == "True"
    assert printed(FORGO + LOAD) == ["False", numbers]


def test_what_is_loaded_already_is_left_alone():
    assert printed("import scipy.special\n" + FORGO + LOAD) == printed(LOAD)


def test_a_scipy_without_that_part_loads_as_it_is():
    hidden = "import sys\nsys.modules['scipy._lib._docscrape'] = None\n"
    shown = "del sys.modules['scipy._lib._docscrape']\n"
    assert printed(hidden + FORGO + shown + LOAD) == printed(LOAD)
