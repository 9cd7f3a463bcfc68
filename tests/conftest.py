"""Where the real flights are: tests marked `data` skip, counted, without AEROFDI_DATA."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def flights() -> Path:
    """The folder of real flights, or a skip that says how to have them."""
    root = os.environ.get("AEROFDI_DATA")
    if not root or not (Path(root) / "flights").is_dir():
        pytest.skip(
            "real flights are not here; set AEROFDI_DATA to the folder that holds flights/ and facts/"
        )
    return Path(root) / "flights"
