"""Run one or all benchmarks; every module here with a run() is one. Medians of interleaved runs, never asserts."""

import importlib
import json
import pkgutil
import sys
from pathlib import Path


def names() -> list[str]:
    here = Path(__file__).parent
    found = [m.name for m in pkgutil.iter_modules([str(here)]) if not m.name.startswith("_")]
    return [n for n in found if hasattr(importlib.import_module(f"benchmarks.{n}"), "run")]


def main(arguments: list[str]) -> int:
    as_json = "--json" in arguments
    wanted = [a for a in arguments if not a.startswith("-")] or names()
    unknown = [w for w in wanted if w not in names()]
    if unknown:
        print(f"no benchmark {unknown[0]!r}; there are {', '.join(names())}", file=sys.stderr)
        return 2
    results = {}
    for name in wanted:
        print(f"{name} ...", file=sys.stderr)
        found = importlib.import_module(f"benchmarks.{name}").run()
        # A module may measure several things: {"NAME": {...}} each in the common form.
        results |= found if "unit" not in found else {name: found}
    if as_json:
        print(json.dumps(results, indent=2))
    else:
        for name, r in results.items():
            print(f"{name}: {r['ours']:.4g} {r['unit']}")
            for peer, p in r.get("peers", {}).items():
                print(f"    {peer}: {p['value']:.4g} {r['unit']} ({p['ratio']:.3g} x)")
            print(f"    {r.get('conditions', '')}")
    return 0


sys.exit(main(sys.argv[1:]))
