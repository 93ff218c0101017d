"""The signal chain: from phase currents to ordinal counts."""
