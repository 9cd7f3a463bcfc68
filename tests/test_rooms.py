"""The one-way street: which room may import which. Reads the imports; nothing is executed."""

import ast
from pathlib import Path

import pytest

import aerofdi

ROOT = Path(aerofdi.__file__).parent
STREET = ["core", "parts", "aircraft", "dynamics", "autopilot", "scenarios", "simulate"]
EVERYTHING = {p.name for p in ROOT.iterdir() if p.is_dir() and p.name != "__pycache__"}
MAY = {room: set(STREET[: i + 1]) for i, room in enumerate(STREET)}
MAY |= {
    "diagnosers": {"core", "parts", "aircraft", "dynamics", "autopilot", "diagnosers"},
    "records": {"core", "aircraft", "records"},
    "identify": {"core", "parts", "aircraft", "dynamics", "identify"},
    "design": EVERYTHING - {"evaluate", "pipeline", "report", "papers", "records"},
    "evaluate": EVERYTHING,
    "pipeline": EVERYTHING,
    "report": EVERYTHING,
    "papers": EVERYTHING,
}


def rooms_of(node: ast.AST, here: tuple[str, ...]) -> set[str]:
    """Rooms of aerofdi an import statement reaches."""
    if isinstance(node, ast.Import):
        names = [n.name for n in node.names]
        return {n.split(".")[1] for n in names if n.startswith("aerofdi.")}
    if isinstance(node, ast.ImportFrom) and node.level:
        base = here[: len(here) - (node.level - 1)]
        full = [*base, *(node.module.split(".") if node.module else [])]
        return {full[0]} if full else {n.name for n in node.names if n.name in EVERYTHING}
    if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("aerofdi."):
        return {str(node.module).split(".")[1]}
    return set()


def imports(path: Path) -> set[str]:
    here = path.relative_to(ROOT).parent.parts
    tree = ast.parse(path.read_text())
    found = set().union(*(rooms_of(n, here) for n in ast.walk(tree)), set())
    return {r for r in found if r in EVERYTHING}


@pytest.mark.parametrize("room", sorted(EVERYTHING))
def test_a_room_imports_only_what_it_may(room):
    assert room in MAY, f"room {room} has no law in this test"
    for path in (ROOT / room).rglob("*.py"):
        wrong = imports(path) - MAY[room]
        assert not wrong, (
            f"{path.relative_to(ROOT)} imports {sorted(wrong)}; {room} may import {sorted(MAY[room])}"
        )


@pytest.mark.parametrize("room", sorted(EVERYTHING))
def test_a_room_states_its_law_in_at_most_ten_lines(room):
    lines = (ROOT / room / "README.md").read_text().strip().splitlines()
    assert 2 <= len(lines) <= 10


def test_the_reader_of_imports_sees_a_forbidden_arrow():
    node = ast.parse("from ..simulate import fly").body[0]
    assert rooms_of(node, ("diagnosers",)) == {"simulate"}
    node = ast.parse("from .bind import bind").body[0]
    assert rooms_of(node, ("core",)) == {"core"}
    node = ast.parse("import aerofdi.design.lpv").body[0]
    assert rooms_of(node, ("core",)) == {"design"}


def test_core_needs_numpy_only():
    for path in (ROOT / "core").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [n.name for n in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and not node.level:
                names = [node.module or ""]
            for name in names:
                assert name.split(".")[0] in {
                    "numpy", "math", "typing", "collections", "dataclasses", "enum", "__future__",
                }, f"{path.name} imports {name}"  # fmt: skip
