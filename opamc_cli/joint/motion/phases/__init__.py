"""The motion from three phase currents alone."""
