"""Stages: tables in, tables out."""
