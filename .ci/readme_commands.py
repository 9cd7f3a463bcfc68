"""Print the set-up commands of README.md: the lines of its first ```sh block, so that they cannot drift."""

import re
import sys
from pathlib import Path

block = re.search(r"```sh\n(.*?)```", Path(sys.argv[1]).read_text(encoding="utf-8"), re.S)
lines = block.group(1).splitlines() if block else []
print("\n".join(line for line in lines if line and not line.startswith("#")))
