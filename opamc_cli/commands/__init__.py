"""Subcommands: options in, stage called, result printed."""
