"""`python -m opamc_cli`."""

from opamc_cli.app import main

main()
