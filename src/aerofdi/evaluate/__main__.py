"""`python -m aerofdi.evaluate campaign.toml -o folder`: fly a campaign, print its table, save its plot."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ..core import AerofdiError
from .campaign import load_campaign, load_rows, plot, run_campaign, scores
from .summary import summarise, table

INTERRUPTED = 130


def main() -> int:
    """Parse, fly with a progress bar, print; resumes where it was interrupted. Returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m aerofdi.evaluate", description=__doc__)
    parser.add_argument("campaign", type=Path, help="TOML file, see aerofdi.evaluate.campaign")
    parser.add_argument("-o", "--out", type=Path, required=True, help="folder for the Parquet parts")
    parser.add_argument("--seeds", type=int, help="fly only the first so many seeds")
    parser.add_argument("--workers", type=int, help="processes (default: all cores)")
    parser.add_argument("--plot", type=Path, help="picture file of share detected over time")
    given = parser.parse_args()
    try:
        fly(given)
    except AerofdiError as error:
        print(f"aerofdi: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print(
            f"interrupted; what was flown is kept in {given.out}: give the same command to go on",
            file=sys.stderr,
        )
        return INTERRUPTED
    return 0


def fly(given: argparse.Namespace) -> None:
    """The campaign as asked for, its table, its plot."""
    from rich.progress import Progress

    c = load_campaign(given.campaign, given.seeds)
    with Progress() as bar:
        task = bar.add_task(c.name, total=1.0)
        paths = run_campaign(
            c,
            given.out,
            lambda text, share: bar.update(task, description=text, completed=share),
            given.workers,
        )
    found = load_rows(paths)
    rows = {label: summarise(s for _, s in flights) for label, flights in scores(found).items()}
    print(table(rows))
    if given.plot:
        print(plot(found, given.plot, c.title))


if __name__ == "__main__":
    sys.exit(main())
