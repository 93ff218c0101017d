"""Health of robot-arm joints with strain wave gearing, told from motor current."""

__version__ = "0.1.0"
