"""`python -m pkmcal_cli`."""

from pkmcal_cli.app import main

main()
