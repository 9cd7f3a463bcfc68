"""`python -m aerofdi`: the same as the command `aerofdi`."""

from .cli import main

main()
