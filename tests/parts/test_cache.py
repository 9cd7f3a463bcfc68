"""Compiled code on disk serves the next process, and is dropped when anything it was made from changes."""

import os
import subprocess
import sys

import pytest

from aerofdi.parts.ops import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="nothing is compiled")

FILES = {
    "__init__.py": "",
    "deep.py": "from aerofdi.parts.ops import jit\n\n@jit\ndef deep(x):\n    return x + 1.0\n",
    "kinds.py": (
        "from typing import NamedTuple\n"
        "from aerofdi.parts.dispatch import by_type\n"
        "from aerofdi.parts.ops import jit\n"
        "from .deep import deep\n\n"
        "class Kind(NamedTuple):\n    k: float\n\n"
        "act = by_type('act')\n\n"
        "@act.register(Kind)\n@jit\ndef kind(params, x):\n    return params.k * deep(x)\n"
    ),
    "loop.py": (
        "from aerofdi.parts.ops import jit\n"
        "from .acts import act\n\n"
        "@jit\ndef loop(params, x):\n    return act(params, x)\n"
    ),
    "acts.py": "from .kinds import act\n",
    "__main__.py": (
        "from .kinds import Kind\nfrom .loop import loop\n"
        "value, stats = loop(Kind(2.0), 3.0), loop.stats\n"
        "print(value, sum(stats.cache_hits.values()), sum(stats.cache_misses.values()))\n"
    ),
}


def run(folder):
    out = subprocess.run(
        [sys.executable, "-m", "tiny"],
        cwd=folder,
        env={**os.environ},
        capture_output=True,
        text=True,
        check=True,
    )
    value, hits, misses = out.stdout.split()
    return float(value), int(hits), int(misses)


@pytest.mark.parametrize("changed", ["deep.py", "kinds.py"])
def test_second_process_loads_and_a_change_anywhere_below_recompiles(tmp_path, changed):
    package = tmp_path / "tiny"
    package.mkdir()
    for name, text in FILES.items():
        (package / name).write_text(text)
    assert run(tmp_path) == (8.0, 0, 1)
    assert run(tmp_path) == (8.0, 1, 0)
    text = (
        FILES[changed].replace("x + 1.0", "x + 5.0").replace("params.k * deep(x)", "params.k * deep(x) + 8.0")
    )
    assert text != FILES[changed]
    (package / changed).write_text(text)
    assert run(tmp_path) == (16.0, 0, 1)
    assert run(tmp_path) == (16.0, 1, 0)
