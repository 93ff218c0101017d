"""YAML documents."""
