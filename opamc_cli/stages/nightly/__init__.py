"""Stage `nightly`: a cell's recordings in, each robot's nights, its history and alarms out."""
