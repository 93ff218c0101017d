"""From runs to scores: one subcommand per stage."""
