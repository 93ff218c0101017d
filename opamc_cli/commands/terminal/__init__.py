"""What the subcommands share: options, progress, tables, streams."""
