"""Files and folders: whole or not there, one writer, read within bounds."""
