"""Fail if more tests skipped than known: none for want of data where the data are, the known ones where not."""

import json
import re
import sys

log, stored, data = sys.argv[1:4]
known = json.load(open(stored, encoding="utf-8"))
lines = open(log, encoding="utf-8").read().splitlines()
skips = [line for line in lines if line.startswith("SKIPPED")]
count = sum(int(n) for line in skips for n in re.findall(r"^SKIPPED \[(\d+)\]", line))
allowed = known["with_data" if data else "without_data"]
for line in skips:
    print(line)
print(f"{count} skipped, {allowed} known {'with' if data else 'without'} the data")
sys.exit(0 if count == allowed else 1)
