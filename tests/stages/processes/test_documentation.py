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


def test_numpy_s_tools_for_makers_of_libraries_are_loaded_by_who_asks_for_them():
    asked = "import sys\nprint('numpy.f2py' in sys.modules, 'numpy.testing' in sys.modules)\n"
    loaded = "import scipy.special\n"
    assert printed(loaded + asked) == ["True", "True\n"]
    assert printed(FORGO + loaded + asked) == ["False", "False\n"]
    used = "import numpy\nprint(numpy.f2py.__name__, numpy.testing.__name__)\n"
    assert printed(FORGO + loaded + used) == ["numpy.f2py", "numpy.testing\n"]


def test_what_is_loaded_already_is_left_alone():
    assert printed("import scipy.special\n" + FORGO + LOAD) == printed(LOAD)


def test_a_scipy_without_that_part_loads_as_it_is():
    hidden = "import sys\nsys.modules['scipy._lib._docscrape'] = None\n"
    shown = "del sys.modules['scipy._lib._docscrape']\n"
    assert printed(hidden + FORGO + shown + LOAD) == printed(LOAD)
