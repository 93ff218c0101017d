"""Foreign formats: CSV, MAT, HDF5 and TDMS become runs by a map file."""
