"""Print the set-up commands of README.md: the lines of its first ```sh block, so that they cannot drift."""

import re
import sys

text = open(sys.argv[1], encoding="utf-8").read()
block = re.search(r"```sh\n(.*?)```", text, re.S)
print("\n".join(line for line in (block.group(1) if block else "").splitlines() if line and not line.startswith("#")))
