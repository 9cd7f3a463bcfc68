"""Fail if more tests skipped than known: none for want of data where the data are, the known ones where not."""

import json
import re
import sys
from pathlib import Path

log, stored, data = sys.argv[1:4]
known = json.loads(Path(stored).read_text(encoding="utf-8"))
skips = [s for s in Path(log).read_text(encoding="utf-8").splitlines() if s.startswith("SKIPPED")]
count = sum(int(n) for line in skips for n in re.findall(r"^SKIPPED \[(\d+)\]", line))
allowed = known["with_data" if data else "without_data"]
print("\n".join(skips))
print(f"{count} skipped, {allowed} known {'with' if data else 'without'} the data")
sys.exit(0 if count == allowed else 1)
