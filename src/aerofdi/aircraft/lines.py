"""TOML with the line of every key, which the standard reader does not give."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from ..core.errors import UnreadableFile

_HEADER = re.compile(r"^\s*(\[\[|\[)\s*([^\[\]]+?)\s*(\]\]|\])")
_KEY = re.compile(
    r"""^\s*((?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*'))*)\s*="""
)
_PART = re.compile(r"""[A-Za-z0-9_-]+|"[^"]*"|'[^']*'""")
_STRING = re.compile(
    r'"""(?:[^\\]|\\.)*?"""|\'\'\'.*?\'\'\'|"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\'|#[^\n]*', re.DOTALL
)

Path_ = tuple[str | int, ...]


def _parts(dotted: str) -> Path_:
    return tuple(p.strip("\"'") for p in _PART.findall(dotted))


def _blank(text: str) -> str:
    """The text with strings and comments of more than keys blanked out, lines kept."""

    def hide(match: re.Match[str]) -> str:
        s = match.group()
        quoted_key = (
            s[0] in "\"'" and "\n" not in s and text[match.end() :].lstrip(" \t")[:1] in ("=", ".", "]")
        )
        return s if quoted_key else re.sub(r"[^\n]", " ", s)

    return _STRING.sub(hide, text)


def key_lines(text: str) -> dict[Path_, int]:
    """Line (from 1) of every table header and key of valid TOML; entries of [[arrays]] have their index in the path.

    >>> key_lines('a = 1\\n[b]\\nc = [1,\\n 2]\\n[[d]]\\ne.f = 3\\n')[("d", 0, "e", "f")]
    6
    """
    lines: dict[Path_, int] = {}
    count: dict[Path_, int] = {}
    table: Path_ = ()
    depth = 0
    for number, line in enumerate(_blank(text).split("\n"), start=1):
        header = _HEADER.match(line) if depth == 0 else None
        key = _KEY.match(line) if depth == 0 and not header else None
        if header:
            name = _within(_parts(header.group(2)), count)
            if header.group(1) == "[[":
                count[name] = count.get(name, -1) + 1
                name = (*name, count[name])
            table = name
            lines.setdefault(table, number)
            continue
        if key:
            path = (*table, *_parts(key.group(1)))
            for i in range(len(table) + 1, len(path) + 1):
                lines.setdefault(path[:i], number)
            line = line[key.end() :]
        depth += sum(line.count(c) for c in "[{") - sum(line.count(c) for c in "]}")
    return lines


def _within(parts: Path_, count: dict[Path_, int]) -> Path_:
    """A header below an [[array]] belongs to its last entry."""
    out: Path_ = ()
    for i, part in enumerate(parts):
        out = (*out, part)
        if i < len(parts) - 1 and out in count:
            out = (*out, count[out])
    return out


def read_toml(path: Path) -> tuple[dict[str, Any], dict[Path_, int]]:
    """The document and the line of every key; UnreadableFile where the file is missing or not TOML."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise UnreadableFile(f"{path}: cannot be read ({error}); give the path of an aircraft file") from None
    try:
        return tomllib.loads(text), key_lines(text)
    except tomllib.TOMLDecodeError as error:
        raise UnreadableFile(f"{path}: not valid TOML: {error}; correct that line") from None
