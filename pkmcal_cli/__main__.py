"""`python -m pkmcal_cli`."""

from .app import main

main()
