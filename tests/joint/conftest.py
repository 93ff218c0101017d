"""The folder of the simulators is found from the folders below it, too."""
