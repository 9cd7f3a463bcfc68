"""Which reader a file needs: by its content first, then by its suffix."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from .log import Reader, unreadable

READERS: dict[str, tuple[str, str]] = {
    "ulog": ("ulog", "read_ulog"),
    "dataflash": ("dataflash", "read_dataflash"),
    "tlog": ("tlog", "read_tlog"),
    "rosbag": ("rosbag", "read_rosbag"),
    "alfa": ("alfa", "read_alfa"),
    "paparazzi": ("paparazzi", "read_paparazzi"),
    "mat": ("table_files", "read_mat"),
    "csv": ("table_files", "read_csv"),
    "parquet": ("table_files", "read_parquet_table"),
}
SUFFIXES = {
    ".ulg": "ulog",
    ".ulog": "ulog",
    ".bin": "dataflash",
    ".log": "dataflash",
    ".tlog": "tlog",
    ".bag": "rosbag",
    ".mcap": "rosbag",
    ".db3": "rosbag",
    ".data": "paparazzi",
    ".mat": "mat",
    ".csv": "csv",
    ".csv.gz": "csv",
    ".txt": "csv",
    ".parquet": "parquet",
}
_MAGIC = (
    (b"ULog\x01\x12\x35", "ulog"),
    (b"\xa3\x95", "dataflash"),
    (b"#ROSBAG V", "rosbag"),
    (b"\x89MCAP", "rosbag"),
    (b"SQLite format 3\0", "rosbag"),
    (b"PAR1", "parquet"),
    (b"MATLAB 5", "mat"),
    (b"MATLAB 7", "mat"),
)


def reader_of(name: str) -> Reader:
    """The reader function of a format; its module is imported only now."""
    module, function = READERS[name]
    reader: Reader = getattr(import_module(f"aerofdi.records.{module}"), function)
    return reader


def format_of(path: Path) -> str:
    """The format of a file or folder; UnreadableFile where it is missing, empty or of no known format."""
    if path.is_dir():
        from .alfa import is_alfa

        if is_alfa(path):
            return "alfa"
        if (path / "metadata.yaml").exists():
            return "rosbag"
        raise unreadable(path, "a folder that is neither an ALFA sequence nor a ROS 2 bag (no metadata.yaml)")
    try:
        with path.open("rb") as file:
            head = file.read(512)
    except OSError as error:
        raise unreadable(path, f"cannot be opened ({error.strerror or error})") from error
    if not head:
        raise unreadable(path, "the file is empty")
    for magic, name in _MAGIC:
        if head.startswith(magic):
            return name
    if (
        len(head) > 8
        and head[8] in (0xFE, 0xFD)
        and head[:2] in (b"\x00\x04", b"\x00\x05", b"\x00\x06", b"\x00\x07")
    ):
        return "tlog"
    lower = path.name.lower()
    for suffix in sorted(SUFFIXES, key=len, reverse=True):
        if lower.endswith(suffix):
            return SUFFIXES[suffix]
    raise unreadable(
        path, f"neither its content nor its suffix is known; known are {', '.join(sorted(SUFFIXES))}"
    )
