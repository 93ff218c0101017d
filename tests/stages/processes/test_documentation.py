"""scipy is loaded without its documentation, and does the same."""

import subprocess
import sys
from functools import cache

import pytest

from opamc_cli.stages.processes.documentation import UNUSED

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


@cache
def plain():
    """Return what is printed where nothing is forgone."""
    return printed(LOAD)


@pytest.mark.long
def test_a_process_of_ours_does_without():
    documented, numbers = plain()
    assert documented == "True"
    assert printed(FORGO + LOAD) == ["False", numbers]


def test_parts_of_numpy_that_nobody_uses_are_loaded_by_who_asks_for_them():
    parts = [f"numpy.{name}" for name in UNUSED]
    asked = f"import sys\nprint('', [name in sys.modules for name in {parts}])\n"
    loaded = "import scipy.special\n"
    assert printed(loaded + asked) == ["", f"{[True] * len(parts)}\n"]
    assert printed(FORGO + loaded + asked) == ["", f"{[False] * len(parts)}\n"]
    used = f"import numpy\nprint('', {', '.join(f'{name}.__name__' for name in parts)})\n"
    assert printed(FORGO + loaded + used) == ["", f"{' '.join(parts)}\n"]


@pytest.mark.long
def test_what_is_loaded_already_is_left_alone():
    assert printed("import scipy.special\n" + FORGO + LOAD) == plain()


@pytest.mark.long
def test_a_scipy_without_that_part_loads_as_it_is():
    hidden = "import sys\nsys.modules['scipy._lib._docscrape'] = None\n"
    shown = "del sys.modules['scipy._lib._docscrape']\n"
    assert printed(hidden + FORGO + shown + LOAD) == plain()


LOOP = (
    "import sys, numpy\n"
    "from opamc_cli.signal.ordinal.kernels import _next_order\n"
    "{}"
    "bits = [numpy.zeros(5, numpy.uint8) for _ in range(3)]\n"
    "_next_order(*numpy.float32([[3, 1, 4, 1, 5], [1, 4, 1, 5, 9]]), 1, 1, *bits)\n"
    "print('numba.np.random' in sys.modules, [each.tolist() for each in bits],\n"
    "      *_next_order.stats.cache_hits.values())\n"
)
FORGO_COMPILER = (
    "from opamc_cli.stages.processes.documentation import forgo_compiler\n"
    "forgo_compiler()\n"
    "forgo_compiler()\n"
)


@pytest.mark.long
def test_a_compiled_loop_is_read_without_the_compiler_and_compiled_with_it(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    ready, compiled = printed(LOOP.format(FORGO_COMPILER))
    assert ready == "True"
    assert printed(LOOP.format("")) == ["True", compiled.replace("]]\n", "]] 1\n")]
    assert printed(LOOP.format(FORGO_COMPILER)) == ["False", compiled.replace("]]\n", "]] 1\n")]


EVERY_LOOP = f"""
import importlib, pkgutil, sys
from numba.core.dispatcher import Dispatcher
import opamc_cli
{FORGO_COMPILER}
for module in pkgutil.walk_packages(opamc_cli.__path__, "opamc_cli."):
    text = module.module_finder.find_spec(module.name).loader.get_source(module.name)
    if "njit" in text and not module.ispkg:
        importlib.import_module(module.name)
ours = [v for m in [*sys.modules.values()] for v in vars(m).values() if isinstance(v, Dispatcher)
        and m.__name__.startswith("opamc_cli.")]
for loop in ours:
    for signature, *_ in loop._cache._cache_file._load_index():
        loop.compile(signature)
print("numba.np.random" in sys.modules, len(ours))
"""


@pytest.mark.long
def test_all_loops_that_are_kept_can_be_read_so():
    """One that lacks what the compiler would have loaded ends the process."""
    ready, number = printed(EVERY_LOOP)
    assert ready == "False"
    assert int(number) > 15


@pytest.mark.long
def test_loops_of_a_users_are_left_alone(tmp_path):
    effect = tmp_path / "effect.py"
    effect.write_text("import numba\n@numba.njit(cache=True)\ndef twice(x):\n    return 2 * x\n")
    used = f"import sys\nsys.path.insert(0, {str(tmp_path)!r})\nimport effect\n" + FORGO_COMPILER
    used += "print(effect.twice(4), 'numba.np.random' in sys.modules)\n"
    assert printed(used) == printed(used) == ["8", "True\n"]
