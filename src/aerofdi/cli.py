"""The command line: parse, call one function, print. Rooms are imported inside commands: --help stays quick."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer

from . import __version__

INTERRUPTED = 130
T = TypeVar("T")


def _place(path: Path | None) -> Path | None:
    """Refuse a file that cannot be written before any work is done."""
    if path is not None and (path.is_dir() or not os.access(path.parent, os.W_OK)):
        raise typer.BadParameter(
            f"{path} cannot be written; give a file in a folder that exists and is yours"
        )
    return path


app = typer.Typer(
    name="aerofdi",
    help="Find, isolate and measure faults of small unmanned aircraft from the signals they already have.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
_kept: list[Path] = []

Flights = Annotated[
    list[str],
    typer.Argument(
        metavar="FLIGHT...",
        help="Flight records: .ulg, .BIN, .log, .tlog, ROS bag, ALFA folder, Paparazzi .data, .mat, .csv, .parquet.",
    ),
]
Healthy = Annotated[
    str | None, typer.Option(metavar="T0:T1", help="Learn from this span, in s on the log's clock.")
]
ProfileName = Annotated[
    str | None, typer.Option("--profile", metavar="P", help="Channel map: a shipped profile or a TOML file.")
]
FalseAlarms = Annotated[
    float | None,
    typer.Option(
        "--false-alarms-per-hour",
        metavar="N",
        help="False alarms to accept in an hour of healthy flight as rough as the learnt one, above 0 and at most "
        "60 (per hour); sets the thresholds [0.1].",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]


def main() -> None:
    """The console script."""
    sys.exit(execute(sys.argv[1:]))


def execute(arguments: Sequence[str]) -> int:
    """Run one command; returns its exit code. Every error becomes one line on stderr."""
    # Many small matrices: threads of BLAS only wait for each other.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    words = [a for a in arguments if a != "--debug"]
    debug = len(words) < len(arguments) or os.environ.get("AEROFDI_DEBUG", "0") not in ("", "0")
    _kept.clear()
    try:
        # Typer turns Ctrl-C into this exit code or an Abort, by version.
        code = int(app(args=words, prog_name="aerofdi", standalone_mode=False) or 0)
        sys.stdout.flush()
        return interrupted() if code == INTERRUPTED else code
    except (KeyboardInterrupt, typer.Abort):
        return interrupted()
    except BrokenPipeError:
        # Whoever reads has seen enough; the interpreter must not complain about it at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:
        if debug:
            raise
        return failure(error)


def interrupted() -> int:
    """Say what an interrupted command leaves behind; returns the exit code."""
    kept = ", ".join(map(str, _kept))
    return complain("interrupted", f"kept: {kept}" if kept else "nothing had been written yet", INTERRUPTED)


def failure(error: Exception) -> int:
    """Say an error in one line; returns the exit code."""
    if hasattr(error, "format_message"):  # of the command line itself: an unknown option, a missing argument
        return complain(
            "wrong use", f"{error.format_message()} (see aerofdi --help)", getattr(error, "exit_code", 2)
        )
    from .core.errors import AerofdiError

    if isinstance(error, AerofdiError):
        return complain("error", str(error), error.exit_code)
    text = f"{type(error).__name__}: {error}; this is a fault of aerofdi: please report it to its maintainers"
    return complain("internal error", f"{text} with what the same command prints with --debug", 1)


def complain(what: str, text: str, code: int) -> int:
    """One line on stderr."""
    from rich.console import Console
    from rich.text import Text

    one_line = " ".join(text.split())
    Console(stderr=True, soft_wrap=True).print(Text.assemble((f"{what}: ", "bold red"), one_line))
    return code


def show(*things: Any) -> None:
    """Print rich renderables on stdout."""
    from rich.console import Console

    console = Console()
    for thing in things:
        console.print(thing)


def show_json(value: Any) -> None:
    """Print one JSON object on stdout."""
    from .report.plain import to_json

    print(to_json(value))


def keep(path: str | Path) -> str:
    """Remember a file that was written, for the message of an interruption."""
    _kept.append(Path(path))
    return str(path)


@contextmanager
def working(what: str) -> Iterator[Callable[..., None]]:
    """A progress bar on stderr while something takes its time: say(text, share) moves it."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(24), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(what, total=None)

        def say(text: str, share: float | None = None) -> None:
            bar.update(task, description=text, total=None if share is None else 1.0, completed=share)

        yield say


def counted(items: Sequence[T], say: Callable[..., None]) -> Iterable[T]:
    """The items one after the other, the bar moved by one at each."""
    for i, item in enumerate(items):
        say(f"reading {item}", i / len(items) if len(items) > 1 else None)
        yield item


def _version(wanted: bool) -> None:
    if wanted:
        print(f"aerofdi {__version__}")
        raise typer.Exit


@app.callback()
def common(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
    debug: Annotated[
        bool, typer.Option("--debug", help="Show the traceback of an error (also AEROFDI_DEBUG=1).")
    ] = False,
) -> None:
    """Options of every command."""


@app.command()
def fly(
    scenario: Annotated[str, typer.Argument(help="Name of a scenario, or a TOML file.")],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", callback=_place, help="Flight file to write [SCENARIO.parquet]."),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="Seed of all randomness, instead of the scenario's.")
    ] = None,
    json: Json = False,
) -> None:
    """Fly a scenario and write the flight."""
    from .records import write_flight
    from .simulate import fly as flying

    with working(f"flying {scenario}"):
        flight = flying(scenario, seed)
    path = output or Path(f"{flight.name}.parquet")
    write_flight(flight, path)
    done = {
        "file": keep(path),
        "duration_s": flight.duration_s,
        "seed": flight.meta["seed"],
        "events": flight.events,
    }
    if json:
        return show_json(done)
    from .report.listings import flown

    show(flown(flight, path))


@app.command()
def diagnose(
    flights: Flights,
    aircraft: Annotated[
        str | None,
        typer.Option(
            metavar="A", help="A model saved before, or an aircraft file: no learning from the flight."
        ),
    ] = None,
    with_: Annotated[
        list[str] | None, typer.Option("--with", metavar="D", help="Only this diagnoser; may be repeated.")
    ] = None,
    healthy: Healthy = None,
    healthy_flight: Annotated[
        str | None, typer.Option(metavar="F", help="Learn from this flight, which is not judged itself.")
    ] = None,
    judge: Annotated[str | None, typer.Option(metavar="T0:T1", help="Judge this span only.")] = None,
    false_alarms_per_hour: FalseAlarms = None,
    profile: ProfileName = None,
    report: Annotated[
        Path | None,
        typer.Option(
            metavar="R.html",
            callback=_place,
            help="Write a page of all that was found; the model is kept beside it.",
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Say which control surface failed, when and how much of it is left. Exit code 10: a fault; else 2: a file that
    cannot be used, the others are judged; else 3: a flight nothing could judge; 0: no fault."""
    from .pipeline import diagnose as diagnosing
    from .pipeline import exit_code

    refused: list[tuple[str, Exception]] = []
    with working("diagnosing") as say:
        found = diagnosing(
            counted(flights, say), aircraft=aircraft, with_diagnosers=with_ or (), healthy=healthy,
            healthy_flight=healthy_flight, judge_span=judge, profile=profile, progress=say,
            false_alarms_per_hour=false_alarms_per_hour,
            refused=lambda name, error: refused.append((name, error)),
        )  # fmt: skip
    if len(flights) == len(refused) == 1:
        raise refused[0][1]
    some = len(refused) < len(flights)
    files = written(found, report) if report and some else []
    if json and some:
        told = [{"file": name, "error": str(error)} for name, error in refused]
        show_json({"flights": [d.to_json() for d in found], "refused": told, "files": files})
    elif some:
        from .report.terminal import diagnoses

        show(diagnoses(found, files))
    for name, error in refused:
        complain("not judged", str(error) if name in str(error) else f"{name}: {error}", 2)
    raise typer.Exit(exit_code(found, len(refused)))


def written(found: Sequence[Any], report: Path) -> list[str]:
    """The report and the models beside it, as written."""
    from .pipeline import save_models
    from .report import write_html

    return [keep(write_html(found, report)), *map(keep, save_models(found, report))]


@app.command()
def identify(
    flights: Flights,
    output: Annotated[
        Path, typer.Option("-o", "--output", callback=_place, help="Aircraft file to write.")
    ] = Path("aircraft.toml"),
    healthy: Healthy = None,
    false_alarms_per_hour: FalseAlarms = None,
    profile: ProfileName = None,
    json: Json = False,
) -> None:
    """Learn an aircraft from healthy flights: how its rates answer its commands, and how surely."""
    from .aircraft.identified import save_identified
    from .pipeline import learn

    with working("learning") as say:
        model = learn(
            counted(flights, say), healthy=healthy, false_alarms_per_hour=false_alarms_per_hour,
            profile=profile, progress=say,
        )  # fmt: skip
    save_identified(model, output)
    if json:
        return show_json({"file": keep(output), **model._asdict()})
    from .report.terminal import model as shown

    show(shown(model), f"\nwritten: {keep(output)}; use it with aerofdi diagnose FLIGHT --aircraft {output}")


@app.command()
def design(
    method: Annotated[str, typer.Argument(help="lpv_observer or smac.")],
    aircraft: Annotated[str, typer.Option(metavar="A", help="Name of an aircraft, or its file.")],
    output: Annotated[
        Path,
        typer.Option("-o", "--output", callback=_place, help="Design file to write, its numbers beside it."),
    ] = Path("design.toml"),
    setting: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="A setting of the method, VALUE as in TOML."),
    ] = None,
    json: Json = False,
) -> None:
    """Synthesise a diagnoser for a published aircraft; may take minutes."""
    from .design.catalogue import make, settings
    from .design.io import save_design

    with working(f"designing {method}") as say:
        made = make(method, aircraft, settings(setting or ()), say)
    path = save_design(made, output)
    if json:
        return show_json(
            {"file": keep(path), "method": made.method, "spec": made.spec, "certificate": made.certificate}
        )
    from .report.listings import design as shown

    show(shown(made), f"\nwritten: {keep(path)}")


@app.command()
def paper(
    name: Annotated[str, typer.Argument(help="A paper of the package.")],
    item: Annotated[str | None, typer.Option(help="One table, figure or group of claims.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="A smaller run of the same claims.")] = False,
    json: Json = False,
) -> None:
    """Reproduce a paper: its claims beside what is found here."""
    from .papers import reproduce

    with working(name) as say:
        told = reproduce(name, item, quick, say)
    if json:
        return show_json(told)
    from .report.listings import claims

    show(claims(told))


@app.command()
def info(
    target: Annotated[
        str, typer.Argument(metavar="FLIGHT|AIRCRAFT|SCENARIO", help="A file, or a name of the package.")
    ],
    profile: ProfileName = None,
    json: Json = False,
) -> None:
    """Say what a flight record holds and who can judge it, or what an aircraft or a scenario is."""
    from .pipeline.inspect import find, told

    with working(f"reading {target}"):
        thing = find(target, profile)
    if json:
        return show_json(told(thing))
    from .report.listings import thing as shown

    show(shown(thing))


@app.command()
def demo(
    report: Annotated[
        Path, typer.Option(metavar="R.html", callback=_place, help="The page to write.")
    ] = Path("aerofdi-demo.html"),
) -> None:
    """Fly a small flying wing whose right elevon sticks, and diagnose it."""
    from .pipeline import diagnose as diagnosing
    from .simulate import fly as flying

    with working("flying") as say:
        flight = flying("demo")
        found = diagnosing([flight], progress=say)
    files = written(found, report)
    from .report.terminal import diagnoses

    show(flight.meta["title"] + " (simulated; the diagnosers do not know)\n", diagnoses(found, files))
