"""What a person sees of a result: `write_html` and the tables of the terminal. See README.md of this room."""

from .page import write_html

__all__ = ["write_html"]
